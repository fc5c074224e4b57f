"""Plans in random scenes, checked each millisecond by code that is not ours.

The scenes are boxes, spheres and cylinders in any orientation around arms of three kinds:
primitives on a table, meshes on continuous joints, and meshes on seven axes with a gripper. A seed
that was never used gives scenes that the planner was not tuned for.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from hardware import Robot, load_robot
from skills.motion import Body, Box, Cylinder, MotionError, Query, Shape, Sphere, World
from skills.motion.planner import Planner
from tests.bench.planners.reference.reference_checker import Array, excess, ticks
from tests.support.arms.independent_checker import IndependentChecker
from tests.support.arms.real_arms import real

PROMISED = 0.5  # share of the margin that a plan keeps everywhere
_SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, PROMISED, 0.0)
_GOALS = 5  # in each scene
_BODIES = 6  # in each scene
_TIMEOUT = 5.0  # [s]


@dataclass(frozen=True)
class Checked:
    """A query, and its plan's values if it has one.

    Attributes:
        name: Arm, scene and number.
        solved: True if there is a plan.
        straight: True if the plan is a line.
        kept: Largest of `_SHARES` of the margin that all of the plan keeps; -1 if it collides.
        outside: Largest distance of a joint beyond its limits [rad, m].
        excess: Largest excess over a limit of velocity or acceleration, as a share of it.
    """

    name: str
    solved: bool
    straight: bool = True
    kept: float = 1.0
    outside: float = 0.0
    excess: float = 0.0


def arms(folder: Path) -> list[Robot]:
    """Return the three arms. Robot files are written into a folder."""
    return [load_robot(), real("jaco", folder), real("panda", folder)]


def checked(robot: Robot, scenes: int, seed: int) -> Iterator[Checked]:
    """Yield the results of queries between free configurations of random scenes.

    Args:
        robot: The arm.
        scenes: Number of scenes, with `_GOALS` queries each.
        seed: Seed of scenes and configurations.
    """
    planner, columns = Planner(robot), _columns(robot)
    for number in range(scenes):
        random = np.random.default_rng((seed, number))
        world, checker = _scene(robot, random)
        poses = _free(robot, checker, random)
        start = next(poses)
        for k in range(_GOALS):
            goal = start.copy()
            goal[columns] = next(poses)[columns]
            if not checker.hits(goal[None, :], robot.collision.margin).any():
                query = Query("arm", tuple(start), tuple(goal[columns]), k, _TIMEOUT, world=world)
                yield _checked(f"{robot.name}-{number}-{k}", robot, planner, checker, query)
                start = goal


def _checked(
    name: str, robot: Robot, planner: Planner, checker: IndependentChecker, query: Query
) -> Checked:
    try:
        plan = planner.plan(query)
    except MotionError as error:
        sys.stderr.write(f"{name}: {error}\n")
        return Checked(name, False)
    moved = ticks(plan)
    rows = np.tile(query.start, (len(moved), 1))
    rows[:, _columns(robot)] = moved
    margin = robot.collision.margin
    kept = next((s for s in _SHARES if not checker.hits(rows, s * margin).any()), -1.0)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in robot.actuated]).T
    outside = float(max((lower - rows).max(), (rows - upper).max()))
    arm = robot.actuated_in("arm")
    limits = (np.array([getattr(joint, k) for joint in arm]) for k in ("velocity", "acceleration"))
    return Checked(name, True, plan.curve.straight, kept, outside, excess(moved, *limits))


def _columns(robot: Robot) -> list[int]:
    return [robot.actuated.index(joint) for joint in robot.actuated_in("arm")]


def _draw(robot: Robot, random: np.random.Generator, count: int) -> Array:
    lower = [max(joint.lower, -np.pi) for joint in robot.actuated]
    upper = [min(joint.upper, np.pi) for joint in robot.actuated]
    return random.uniform(lower, upper, (count, len(lower)))


def _free(
    robot: Robot, checker: IndependentChecker, random: np.random.Generator
) -> Iterator[Array]:
    """Yield configurations that keep the margin (A,) [rad]."""
    while True:
        rows = _draw(robot, random, 50)
        yield from rows[~checker.hits(rows, robot.collision.margin)]


def _scene(robot: Robot, random: np.random.Generator) -> tuple[World, IndependentChecker]:
    """Return bodies that leave the arm some room, and a checker for them."""
    while True:
        world = _world(robot, random)
        checker = IndependentChecker(robot, world)
        if not checker.hits(_draw(robot, random, 200), robot.collision.margin).all():
            return world, checker


def _world(robot: Robot, random: np.random.Generator) -> World:
    """Return bodies around the arm, some of them in its way."""
    empty = IndependentChecker(robot, World())
    reach = 0.0
    for q in empty.coordinates(_draw(robot, random, 100)).T:
        pin.forwardKinematics(empty.model, empty.data, q)
        reach = max(reach, *(float(np.linalg.norm(pose.translation)) for pose in empty.data.oMi))
    bodies = []
    for number in range(_BODIES):
        direction, rotation = random.normal(size=3), random.normal(size=4)
        direction[2] = abs(direction[2])
        place = reach * random.uniform(0.4, 1.0) * direction / np.linalg.norm(direction)
        turn = rotation / np.linalg.norm(rotation)
        x, y, z, w = turn.tolist()
        shape = _shape(reach * random.uniform(0.05, 0.25, 3), int(random.integers(3)))
        bodies.append(Body(f"body_{number}", shape, tuple(place.tolist()), (x, y, z, w)))
    return World(tuple(bodies))


def _shape(sizes: Array, kind: int) -> Shape:
    a, b, c = sizes.tolist()
    return (Box((a, b, c)), Sphere(0.5 * a), Cylinder(0.5 * a, 2.0 * b))[kind]
