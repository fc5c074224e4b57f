"""Growth of planning time with the number of axes, obstacles and legs, up to ten times each.

No query is a straight motion: there is an obstacle on the line of every leg.
"""

import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hardware import Robot, load_robot
from skills.motion import Body, Box, NoPath, PlanTimeout, Query, World
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from tests.bench.planners.problems import POST
from tests.support.arms.robots import robot_of

Array = NDArray[np.float64]
Case = Callable[[int], tuple[Robot, World, int]]

FACTORS = (1, 2, 5, 10)
AXES, BOXES, LEGS = 3, 3, 1  # at factor 1
_LENGTH = 0.6  # of the chain, whatever its axes [m]
_LINE = np.linspace(0.0, 1.0, 100)[:, None]
POSTS = World(
    tuple(
        Body(f"post_{i}", Box((0.06, 0.06, 1.2)), (0.25 * np.cos(a), 0.25 * np.sin(a), 0.6))
        for i, a in enumerate(np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False).tolist())
    )
)


@dataclass(frozen=True)
class Growth:
    """Median time to plan at each of `FACTORS`.

    Attributes:
        what: Quantity that grows.
        counts: Its values.
        spent: Medians [ms].
        solved: Number of plans that were found.
        searched: Number of these that needed a search, because one bend was not enough.
    """

    what: str
    counts: Sequence[int]
    spent: Sequence[float]
    solved: Sequence[int]
    searched: Sequence[int]


def growths(count: int, folder: Path) -> Iterator[Growth]:
    """Yield all three, with `count` queries at each factor. Arms are written into a folder."""
    yield _growth("axes", AXES, count, lambda n: (chain(n, folder), POSTS, 1))
    yield _growth("boxes", BOXES, count, lambda n: (load_robot(), around(n), 1))
    yield _growth("legs", LEGS, count, lambda n: (load_robot(), POST, n))


def _growth(what: str, base: int, count: int, case: Case) -> Growth:
    counts = [base * factor for factor in FACTORS]
    found = [list(_found(*case(n), count)) for n in counts]
    medians = [statistics.median(spent for spent, _ in each) for each in found]
    searched = [sum(searched for _, searched in each) for each in found]
    return Growth(what, counts, medians, [len(each) for each in found], searched)


def _found(robot: Robot, world: World, legs: int, count: int) -> Iterator[tuple[float, bool]]:
    """Time of each query that is solved within ten seconds [ms], and True if it was searched."""
    planner, poses = Planner(robot), _stations(robot, world)
    own = [robot.actuated.index(joint) for joint in robot.actuated_in("arm")]
    for seed in range(count + 1):
        way = list(islice(poses, legs + 1))
        _, *via, goal = (tuple(pose[own].tolist()) for pose in way)
        query = Query("arm", tuple(way[0].tolist()), goal, seed, 10.0, tuple(via), world)
        begun = time.perf_counter()
        try:
            plan = planner.plan(query)
        except (NoPath, PlanTimeout):
            continue
        spent = 1e3 * (time.perf_counter() - begun)
        if seed:  # the first one warms up
            yield spent, "search" in plan.milliseconds


def _stations(robot: Robot, world: World) -> Iterator[Array]:
    """Random free configurations with no free line from one to the next (A,) [rad].

    Joints outside the arm are at zero.
    """
    checker, draw = CollisionChecker(PlanningScene(robot, world)), np.random.default_rng(3)
    moves = np.isin([j.name for j in robot.actuated], [j.name for j in robot.actuated_in("arm")])
    lower, upper = np.array([(joint.lower, joint.upper) for joint in robot.actuated]).T
    margin, last = robot.collision.margin, None
    while True:
        pose = np.where(moves, draw.uniform(lower, upper), 0.0)
        if checker.first_collision(pose[None, :], margin) is not None:
            continue
        if (
            last is None
            or checker.first_collision(last + _LINE * (pose - last), margin) is not None
        ):
            yield pose
            last = pose


def around(count: int) -> World:
    """Return small boxes at random positions around the shipped arm, none next to its base."""
    draw = np.random.default_rng(2).uniform(
        (-0.25, -0.25, 0.02), (0.25, 0.25, 0.3), (20 * count, 3)
    )
    away = [place for place in draw.tolist() if np.hypot(*place[:2]) > 0.12]
    size = Box((0.02, 0.02, 0.02))
    return World(
        tuple(Body(f"box_{i}", size, (x, y, z)) for i, (x, y, z) in enumerate(away[:count]))
    )


def chain(axes: int, folder: Path) -> Robot:
    """Return an arm with this many revolute joints and constant length and range; writes a URDF."""
    length, bend = _LENGTH / axes, 6.0 / axes
    links = [
        f'<link name="link_{i}"><collision><origin xyz="0 0 {0.5 * length}"/>'
        f'<geometry><cylinder radius="0.02" length="{0.9 * length}"/></geometry></collision></link>'
        for i in range(axes + 1)
    ]
    joints = [
        f'<joint name="joint_{i}" type="revolute"><parent link="link_{i}"/>'
        f'<child link="link_{i + 1}"/><origin xyz="0 0 {length}"/>'
        f'<axis xyz="{i % 2} {(i + 1) % 2} 0"/>'
        f'<limit lower="{-bend}" upper="{bend}" velocity="1" effort="1"/></joint>'
        for i in range(axes)
    ]
    urdf = folder / f"chain_{axes}.urdf"
    urdf.write_text(f'<robot name="chain_{axes}">{"".join(links + joints)}</robot>')
    return robot_of(urdf)
