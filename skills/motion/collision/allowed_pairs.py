"""Finds the pairs of links that need no check, by sampling, as MoveIt's Setup Assistant does.

The reasons have the names that MoveIt uses. Neighbours touch by design. Other pairs touch in every
configuration, in no configuration, or in the start configuration of the arm.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np

from hardware import Joint, Robot
from hardware.description.meshes import MAX_SIZE, mesh_in_mm
from hardware.description.neighbours import adjacent_links
from hardware.loading.dataclass import dataclass
from skills.motion.arrays import Array
from skills.motion.errors import ModelUnusable
from skills.motion.robot_model.geometry import corners
from skills.motion.robot_model.robot_model import RobotModel

from .checker import CollisionChecker, Contact
from .planning_scene import PlanningScene

_SAMPLES = 10_000
_ROUGH = 500  # samples in which the hulls of a pair are checked first
_EXACT = 200  # samples in which the exact shapes of a pair are checked
_ALWAYS = 0.95  # least share of samples in contact for a pair that is always in contact
# Hulls that keep the margin plus this distance in all samples never touch [m]. The addition covers
# configurations between two samples.
_RESERVE = 0.01
_SHARES = np.linspace(1.0, 0.0, 41)  # shares of the way from the start to a pose
NO_POSES: Mapping[str, Mapping[str, float]] = {}


@dataclass(frozen=True, slots=True)
class AllowedPairs:
    """The result of sampling.

    Attributes:
        reasons: `adjacent`, `always`, `never` or `default`, by the pair of links.
        count: Number of pairs of links that move against each other.
        boot: Configuration in which the arm may start [rad].
        nearest: The closest two of the checked links in `boot`; None if no links are checked.
        poses: The given poses, by name. A pose in collision is moved towards `boot` until the arm
            is free. Joints that the pose does not name are at their `boot` positions.
    """

    reasons: Mapping[tuple[str, str], str]
    count: int
    boot: tuple[float, ...]
    nearest: Contact | None
    poses: Mapping[str, Mapping[str, float]]


def find_allowed_pairs(
    robot: Robot, poses: Mapping[str, Mapping[str, float]] = NO_POSES
) -> AllowedPairs:
    """Find the pairs of links that need no check, and a free configuration for the start.

    A pair is `adjacent` if no other link with a shape is between the two links. It is `always` if
    the links are closer than the margin in 95 % of the samples. It is `never` if their convex hulls
    keep the margin plus 10 mm in all 10,000 samples. It is `default` if the links are closer than
    the margin at the boot positions. The reason `default` is used only if the boot positions, the
    middle of the limits and all samples are in collision. Otherwise, if the boot positions are in
    collision, the arm starts in the free sample that is nearest to the middle of the limits.

    Args:
        robot: The robot, with its margin and boot positions. Its allowed pairs are ignored.
        poses: Poses to make free of collisions: position by joint [rad], by name.

    Raises:
        ModelUnusable: The robot cannot be loaded, or a mesh is longer than 20 m.
        BadWorld: There are too many pairs of shapes.
    """
    margin, samples = robot.collision.margin, _random(robot)
    scene = _scene(robot, ())
    _check_meshes(robot, scene.robot_model)
    names = scene.linked_pairs(scene.hulls)
    adjacent = adjacent_links(robot.description, {link for pair in names for link in pair})
    checker, reasons = CollisionChecker(scene), dict[tuple[str, str], str]()
    for k, pair in enumerate(names):
        only = frozenset((k,))
        if frozenset(pair) in adjacent:
            reasons[pair] = "adjacent"
        elif not checker.hulls_near(samples, margin + _RESERVE, only).any():
            reasons[pair] = "never"
        elif checker.hulls_near(samples[:_ROUGH], margin, only).mean() >= _ALWAYS:
            rows = samples[:_EXACT]
            hits = [checker.first_collision(q[None, :], margin, only) == 0 for q in rows]
            if np.mean(hits) >= _ALWAYS:
                reasons[pair] = "always"
    checker = CollisionChecker(_scene(robot, reasons, scene.robot_model))
    starts = (robot.boot_pose, *_from_middle(robot, samples))
    boot = next((each for each in starts if _free(checker, each, margin)), robot.boot_pose)
    while invalid := checker.first_invalid_contact(np.array([boot]), margin):
        reasons[invalid[1].first, invalid[1].second] = "default"
        checker = CollisionChecker(_scene(robot, reasons, scene.robot_model))
    free = {name: _free_pose(robot, checker, boot, pose) for name, pose in poses.items()}
    return AllowedPairs(reasons, len(names), boot, checker.nearest(boot), free)


def _check_meshes(robot: Robot, model: RobotModel) -> None:
    for shape in model.exact:
        longest = np.ptp(corners(shape), axis=0).max()
        if isinstance(shape.geometry, coal.BVHModelBase) and longest > MAX_SIZE:
            why = mesh_in_mm(Path(shape.meshPath).name, longest, shape.meshScale)
            raise ModelUnusable(str(robot.urdf), why)


def _scene(
    robot: Robot, allowed: Iterable[tuple[str, str]], model: RobotModel | None = None
) -> PlanningScene:
    rules = replace(robot.collision, allowed=frozenset(map(frozenset, allowed)))
    return PlanningScene(replace(robot, collision=rules), robot_model=model)


def _free_pose(
    robot: Robot, checker: CollisionChecker, boot: tuple[float, ...], pose: Mapping[str, float]
) -> Mapping[str, float]:
    """Return the free configuration that is closest to a pose, on the line from `boot` to the pose.

    Samples of the line are tried, from the pose to `boot`. If none is free, the result is `boot`.
    """
    for share in _SHARES:
        ends = [pose.get(joint.name, q) for joint, q in zip(robot.actuated, boot, strict=True)]
        row = [share * end + (1.0 - share) * q for end, q in zip(ends, boot, strict=True)]
        if _free(checker, tuple(row), robot.collision.margin):
            break
    positions = zip(robot.actuated, row, strict=True)
    return {joint.name: float(q) for joint, q in positions if joint.name in pose}


def _from_middle(robot: Robot, samples: Array) -> Iterator[tuple[float, ...]]:
    """Yield the middle of the limits, then the samples by their distance from it.

    The distance is the largest share of a joint's range.
    """
    lower, upper = np.transpose([_range(joint) for joint in robot.actuated])
    middle = 0.5 * (lower + upper)
    ranges = np.maximum(upper - lower, 1e-9)  # a joint's limits may be equal
    order = np.abs((samples - middle) / ranges).max(axis=1).argsort()
    for row in middle, *samples[order]:
        yield tuple(row.tolist())


def _free(checker: CollisionChecker, configuration: tuple[float, ...], margin: float) -> bool:
    return checker.first_invalid(np.array([configuration]), margin) is None


def _random(robot: Robot) -> Array:
    """Return the same random configurations each time, within the limits (N, A) [rad]."""
    lower, upper = zip(*map(_range, robot.actuated), strict=True)
    samples: Array = np.random.default_rng(1).uniform(lower, upper, (_SAMPLES, len(lower)))
    return samples


def _range(joint: Joint) -> tuple[float, float]:
    return (-np.pi, np.pi) if joint.continuous else (joint.lower, joint.upper)
