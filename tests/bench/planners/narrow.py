"""Goals in a shelf, for arms of all sizes: the search has to find the way into a narrow place."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from hardware import Robot, load_robot
from skills.motion import Body, Box, MotionError, Query, World
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from tests.bench.planners import mesh_arms
from tests.bench.planners.reference_checker import Array
from tests.support.arms.robots import foreign

_BOARD = 0.015  # thickness of a board, as a share of the arm's reach
_DRAWS = 2_000  # configurations drawn at a time


@dataclass(frozen=True)
class NarrowScore:
    """Result for one arm: number of queries, and time of each solved one [ms]."""

    arm: str
    queries: int
    spent: list[float] = field(default_factory=list)


def scores(folder: Path, count: int) -> Iterator[NarrowScore]:
    """Run our planner on goals in a shelf, with five seconds each.

    Args:
        folder: Folder for robot files.
        count: Goals of each arm.
    """
    arms = [*mesh_arms.arms(folder), load_robot(Path("so101")), foreign("seven_axes")]
    for robot in arms:
        queries = list(_queries(robot, count))
        planner, score = Planner(robot), NarrowScore(robot.name, len(queries))
        for query in queries:
            begun = time.perf_counter()
            try:
                planner.plan(query)
            except MotionError:
                continue
            score.spent.append(1e3 * (time.perf_counter() - begun))
        yield score


def _queries(robot: Robot, count: int) -> Iterator[Query]:
    """Yield queries from free configurations outside of a shelf into its compartments."""
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
    for number, (start, goal) in enumerate(zip(starts, goals, strict=True)):
        yield Query("arm", tuple(start), tuple(goal[:arm]), number, world=world)


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
    """Return random configurations; joints outside the arm are where they boot (N, A) [rad]."""
    lower = [max(joint.lower, -np.pi) for joint in robot.actuated]
    upper = [min(joint.upper, np.pi) for joint in robot.actuated]
    rows = np.random.default_rng(seed).uniform(lower, upper, (_DRAWS, len(lower)))
    others = [i for i, joint in enumerate(robot.actuated) if joint not in robot.actuated_in("arm")]
    rows[:, others] = np.array(robot.boot_pose)[others]
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
