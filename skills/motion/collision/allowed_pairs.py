"""Finds the pairs of links that need no collision check, by sampling, as MoveIt's Setup Assistant.

The reasons are those of its `collision_default`: neighbours touch by design, some pairs touch in
every configuration, some in none, and some where the arm starts.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hardware import Joint, Robot
from hardware.description.neighbours import adjacent_links
from skills.motion.arrays import Array, Mask
from skills.motion.robot_model.robot_model import RobotModel

from .broad_phase import BATCH
from .checker import CollisionChecker, Contact
from .planning_scene import PlanningScene

_SAMPLES = 10_000
_EXACT = 200  # samples in which the exact shapes of a pair are checked
_ALWAYS = 0.95  # share of samples in contact from which a pair counts as always in contact
# Hulls that never come closer than the margin and this, in any sample, never touch [m]: between two
# of the samples they may come closer than in both.
_RESERVE = 0.01
_SHARES = np.linspace(1.0, 0.0, 41)  # of the way from the start to a pose
NO_POSES: Mapping[str, Mapping[str, float]] = {}


@dataclass(frozen=True, slots=True)
class AllowedPairs:
    """The result of sampling.

    Attributes:
        reasons: `adjacent`, `always`, `never` or `default`, by the pair of links.
        count: Number of pairs of links that move against each other.
        boot: Configuration in which the arm may start [rad].
        nearest: The closest links there that are checked, or None if none are.
        poses: The given poses, each moved towards the start until the arm collides no more if only
            the joints of the pose leave the start.
    """

    reasons: Mapping[tuple[str, str], str]
    count: int
    boot: tuple[float, ...]
    nearest: Contact | None
    poses: Mapping[str, Mapping[str, float]]


def find_allowed_pairs(
    robot: Robot, poses: Mapping[str, Mapping[str, float]] = NO_POSES, seed: int = 1
) -> AllowedPairs:
    """Find the pairs of links of a robot that need no check, and a free configuration to start in.

    Adjacent: no other link with a shape is between them. Always: closer than the margin in 95 % of
    the samples. Never: their convex hulls are farther apart than the margin and 10 mm in all
    10,000 samples. Default: closer than the margin at the boot positions, if the arm is free
    neither there nor in the middle of its limits.

    Args:
        robot: The robot. Its margin and its boot positions are used, its allowed pairs are not.
        poses: Poses to make free of collisions: position by joint [rad], by name.
        seed: Seed of the samples.

    Raises:
        ModelUnusable: The robot cannot be loaded.
        BadWorld: There are too many pairs of shapes.
    """
    margin, samples = robot.collision.margin, _random(robot, seed)
    model = RobotModel(robot)
    scene = _scene(robot, model, ())
    pairs = scene.hulls.collisionPairs
    names = [_names(scene, pair.first, pair.second) for pair in pairs]
    adjacent = adjacent_links(robot.description, {link for pair in names for link in pair})
    checker, reasons = CollisionChecker(scene), dict[tuple[str, str], str]()
    for k, pair in enumerate(names):
        if frozenset(pair) in adjacent:
            reasons[pair] = "adjacent"
        elif not _near(checker, samples, margin + _RESERVE, k).any():
            reasons[pair] = "never"
        elif _near(checker, samples[:BATCH], margin, k).mean() >= _ALWAYS:
            rows = samples[:_EXACT]
            hits = [checker.first_collision(q[None, :], margin, frozenset((k,))) == 0 for q in rows]
            if np.mean(hits) >= _ALWAYS:
                reasons[pair] = "always"
    checker = CollisionChecker(_scene(robot, model, reasons))
    boot = robot.boot_pose
    if not _free(checker, boot, margin):
        middle = tuple(0.5 * sum(_range(joint)) for joint in robot.actuated)
        boot = middle if _free(checker, middle, margin) else boot
    while not _free(checker, boot, margin):
        contact = checker.nearest(boot)
        assert contact
        reasons[contact.first, contact.second] = "default"
        checker = CollisionChecker(_scene(robot, model, reasons))
    free = {name: _free_pose(robot, checker, boot, pose) for name, pose in poses.items()}
    return AllowedPairs(reasons, len(pairs), boot, checker.nearest(boot), free)


def _scene(robot: Robot, model: RobotModel, allowed: Iterable[tuple[str, str]]) -> PlanningScene:
    rules = replace(robot.collision, allowed=frozenset(map(frozenset, allowed)))
    return PlanningScene(replace(robot, collision=rules), robot_model=model)


def _free_pose(
    robot: Robot, checker: CollisionChecker, boot: tuple[float, ...], pose: Mapping[str, float]
) -> Mapping[str, float]:
    """Return the free positions nearest to a pose, on the line from the start to the pose.

    The samples include both ends of the line.
    """
    for share in _SHARES:
        ends = [pose.get(joint.name, q) for joint, q in zip(robot.actuated, boot, strict=True)]
        row = [share * end + (1.0 - share) * q for end, q in zip(ends, boot, strict=True)]
        if _free(checker, tuple(row), robot.collision.margin):
            break
    positions = zip(robot.actuated, row, strict=True)
    return {joint.name: float(q) for joint, q in positions if joint.name in pose}


def _names(scene: PlanningScene, first: int, second: int) -> tuple[str, str]:
    return scene.link(scene.hulls, first), scene.link(scene.hulls, second)


def _near(checker: CollisionChecker, rows: Array, margin: float, pair: int) -> Mask:
    """Return for each configuration whether the hulls of a pair are closer than a margin (N,)."""
    parts = [rows[begin : begin + BATCH] for begin in range(0, len(rows), BATCH)]
    return np.concatenate([checker.hulls_near(part, margin, frozenset((pair,))) for part in parts])


def _free(checker: CollisionChecker, configuration: tuple[float, ...], margin: float) -> bool:
    return checker.first_invalid(np.array([configuration]), margin) is None


def _random(robot: Robot, seed: int) -> Array:
    """Return random configurations within the limits (N, A) [rad]."""
    lower, upper = zip(*map(_range, robot.actuated), strict=True)
    samples: Array = np.random.default_rng(seed).uniform(lower, upper, (_SAMPLES, len(lower)))
    return samples


def _range(joint: Joint) -> tuple[float, float]:
    return (-np.pi, np.pi) if joint.continuous else (joint.lower, joint.upper)
