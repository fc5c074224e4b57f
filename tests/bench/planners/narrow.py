"""Goals in a shelf, for arms of all sizes: the search has to find the way into a narrow place."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
from click.testing import CliRunner

from executive.cli.main import cli
from hardware import Robot, load_robot
from skills.motion import Body, Box, World
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from tests.bench.planners import mesh_arms
from tests.bench.planners.problems import Problem
from tests.bench.planners.reference.reference_checker import Array
from tests.support.arms.real_arms import ROBOTS
from tests.support.arms.robots import foreign

_BOARD = 0.015  # thickness of a board, as a share of the arm's reach
_DRAWS = 2_000  # configurations drawn at a time

Point = tuple[float, ...]


def narrow(folder: Path, count: int) -> Iterator[Problem]:
    """Yield goals in a shelf for each arm, with five seconds each.

    Args:
        folder: Folder for robot files.
        count: Goals of each arm.
    """
    ours = load_robot(Path("so101")), foreign("seven_axes")
    for robot in (*mesh_arms.arms(folder), so100(folder), *ours):
        world, pairs = _shelf_and_pairs(robot, count)
        yield Problem(robot.name, robot, world, pairs, timeout=5.0, boxes=False)


def so100(folder: Path) -> Robot:
    """Return the SO-100. `armtree new-arm` writes its robot file into a folder."""
    urdf, file = ROBOTS / "so_arm_description/urdf/so100.urdf", folder / "so100.toml"
    words = ["new-arm", str(urdf), "--output", str(file), "--trees", str(folder)]
    done = CliRunner().invoke(cli, words)
    assert done.exit_code == 0, done.output
    return load_robot(file)


def _shelf_and_pairs(robot: Robot, count: int) -> tuple[World, list[tuple[Point, Point]]]:
    """Return a shelf, and free configurations of the arm outside and inside of it."""
    reach = float(np.percentile(np.linalg.norm(_tips(robot, _draws(robot, 1)), axis=1), 95))
    center, size = reach * np.array([0.65, 0.0, 0.35]), reach * np.array([0.3, 0.8, 0.7])
    world = _shelf(center, size, _BOARD * reach)
    checker, arm = CollisionChecker(PlanningScene(robot, world)), len(robot.actuated_in("arm"))
    starts, goals, seed = list[Array](), list[Array](), 1
    while min(len(starts), len(goals)) < count:
        seed += 1
        rows = _draws(robot, seed)
        offsets = _tips(robot, rows) - center
        inside = (abs(offsets) < 0.5 * size).all(axis=1)
        outside = offsets[:, 0] < -0.8 * size[0]
        for found, chosen in ((goals, inside), (starts, outside)):
            for row in rows[chosen]:
                if len(found) < count and _is_free(checker, robot, row):
                    found.append(row)
    ends = ([tuple(row[:arm].tolist()) for row in rows] for rows in (starts, goals))
    return world, list(zip(*ends, strict=True))


def _is_free(checker: CollisionChecker, robot: Robot, row: Array) -> bool:
    return checker.first_invalid(row[None, :], robot.collision.margin) is None


def _shelf(center: Array, size: Array, board: float) -> World:
    """Return four boards, two walls and a back; the shelf is open towards the arm."""
    x, y, z = center.tolist()
    depth, width, height = size.tolist()
    levels = np.linspace(z - 0.5 * height, z + 0.5 * height, 4).tolist()
    bodies = [
        Body(f"board_{i}", Box((depth, width, board)), (x, y, level))
        for i, level in enumerate(levels)
    ]
    for name, side in (("left", 0.5), ("right", -0.5)):
        bodies.append(Body(name, Box((depth, board, height)), (x, y + side * width, z)))
    bodies.append(Body("back", Box((board, width, height)), (x + 0.5 * depth, y, z)))
    return World(tuple(bodies))


def _draws(robot: Robot, seed: int) -> Array:
    """Return random configurations; joints outside the arm are at zero (N, A) [rad]."""
    lower = [max(joint.lower, -np.pi) for joint in robot.actuated]
    upper = [min(joint.upper, np.pi) for joint in robot.actuated]
    rows = np.random.default_rng(seed).uniform(lower, upper, (_DRAWS, len(lower)))
    others = [i for i, joint in enumerate(robot.actuated) if joint not in robot.actuated_in("arm")]
    rows[:, others] = 0.0
    return rows


def _tips(robot: Robot, rows: Array) -> Array:
    """Return the positions of the arm's last joint (N, 3) [m]."""
    model = PlanningScene(robot).robot_model
    data = model.kinematics.createData()
    last = model.kinematics.getJointId(robot.actuated_in("arm")[-1].name)
    tips = []
    for q in model.coordinates(rows).T:
        pin.forwardKinematics(model.kinematics, data, q)
        tips.append(data.oMi[last].translation.copy())
    return np.array(tips)
