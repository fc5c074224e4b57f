"""The queries for every planner."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hardware import Robot, load_robot
from skills.motion import EMPTY, Body, Box, Query, World
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from tests.bench.planners.reference.padded import padded
from tests.bench.planners.reference.reference_checker import ReferenceChecker
from tests.support.arms.robots import foreign, robot_of

Array = NDArray[np.float64]
DATA = Path(__file__).parents[2] / "data"

POST = World((Body("post", Box((0.03, 0.03, 0.3)), (0.115, 0.115, 0.15)),))
POSTS = World(
    (
        Body("left", Box((0.1, 0.1, 1.2)), (0.4, 0.3, 0.4)),
        Body("right", Box((0.1, 0.1, 1.2)), (0.4, -0.3, 0.4)),
    )
)
BLOCK = World((Body("block", Box((0.03, 0.03, 0.2)), (0.065, 0.075, 0.1)),))

# The fixed queries for three simple axes: two straight motions and one around a block.
EASY = (((0.0, 0.0, 0.0), (-1.4, -0.6, -0.07)), ((0.0, 0.0, 0.0), (-1.57, 0.0, -0.9)))
HARD = (((0.0, 0.3, 0.2), (-1.4, 0.3, 0.2)),)


@dataclass(frozen=True)
class Problem:
    """Queries for one arm in one world; only its arm moves, all other joints are at zero.

    Attributes:
        name: Name in the table.
        robot: The arm.
        world: Bodies around it.
        pairs: Start and goal of each query, only the arm's joints [rad].
        timeout: Longest time for a query [s].
        boxes: True if the other planners get bounding boxes in place of meshes; False if they get
            the meshes, and the world is padded by the whole margin.
    """

    name: str
    robot: Robot
    world: World
    pairs: Sequence[tuple[tuple[float, ...], tuple[float, ...]]]
    timeout: float = 1.0
    boxes: bool = True

    def queries(self) -> Iterator[Query]:
        """Yield queries for our planner. Each has its own seed."""
        arm = self.robot.actuated_in("arm")
        for seed, (start, goal) in enumerate(self.pairs, 1):
            own = dict(zip((joint.name for joint in arm), start, strict=True))
            whole = tuple(own.get(joint.name, 0.0) for joint in self.robot.actuated)
            yield Query("arm", whole, goal, seed, self.timeout, world=self.world)


def fixed(times: int) -> list[Problem]:
    """Return the problems for three simple axes: two straight motions, and one around a block."""
    robot = robot_of(DATA / "three_axes.urdf", margin=0.005)
    return [
        Problem("straight", robot, EMPTY, EASY * times),
        Problem("hard", robot, BLOCK, HARD * 2 * times),
    ]


def random(count: int) -> list[Problem]:
    """Return random pairs: the shipped arm alone and near a post; six and seven axes, posts."""
    arduinobot = load_robot()
    return [
        _drawn("bare", arduinobot, EMPTY, count),
        _drawn("post", arduinobot, POST, count),
        _drawn("six", foreign("six_axes"), POSTS, count),
        _drawn("seven", foreign("seven_axes"), POSTS, count),
    ]


def _drawn(name: str, robot: Robot, world: World, count: int) -> Problem:
    """Both ends are free with our margin, and in the padded world of the other planners."""
    free = _free(robot, world)
    return Problem(name, robot, world, [(next(free), next(free)) for _ in range(count)])


def _free(robot: Robot, world: World) -> Iterator[tuple[float, ...]]:
    checker = CollisionChecker(PlanningScene(robot, world))
    reference = ReferenceChecker(padded(robot, world))
    arm, draw = robot.actuated_in("arm"), np.random.default_rng(1)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm]).T
    columns = [robot.actuated.index(joint) for joint in arm]
    while True:
        pose, whole = draw.uniform(lower, upper), np.zeros((1, len(robot.actuated)))
        whole[0, columns] = pose
        free = checker.first_collision(whole, robot.collision.margin) is None
        if free and not reference.collides(pose[None, :]):
            yield tuple(pose.tolist())
