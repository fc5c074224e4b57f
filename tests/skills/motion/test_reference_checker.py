"""Plans checked again, every millisecond, by a checker that shares no code with the planner."""

import dataclasses
import itertools
from collections.abc import Iterator
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from hardware import Robot, load_robot
from skills.motion import Plan, Query
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]

# Found by search: on the shipped robot the line between these would pass through its base.
FOLDED = (-1.44023649, 0.16565795, -0.993262)
NEAR_FOLDED = (-1.43, 0.17, -0.98)
LEANING = (-1.33750881, 1.30914797, -1.10353502)

POST = """
<link name="post"><collision>
  <origin xyz="0.115 0.115 0.1"/><geometry><box size="0.03 0.03 0.2"/></geometry>
</collision></link>
<joint name="post_joint" type="fixed"><parent link="world"/><child link="post"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def robot_with_post(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Another obstacle stands on the table, in front and to the right."""
    urdf: Path = tmp_path_factory.mktemp("post") / "post.urdf"
    urdf.write_text(robot.urdf.read_text().replace("</robot>", POST))
    ignores = robot.collision.floor_ignores | {"post"}
    rules = dataclasses.replace(robot.collision, floor_ignores=ignores)
    return dataclasses.replace(robot, urdf=urdf, collision=rules)


class ReferenceChecker:
    """Checks one configuration and one pair of primitives at a time, with coal only."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.model = pin.buildModelFromUrdf(str(robot.urdf))
        self.data = self.model.createData()
        self.shapes = pin.buildGeomFromUrdf(
            self.model, str(robot.urdf), pin.GeometryType.COLLISION
        ).geometryObjects
        self.links = [self.model.frames[shape.parentFrame].name for shape in self.shapes]
        pairs = itertools.combinations(range(len(self.shapes)), 2)
        self.pairs = [pair for pair in pairs if self.wanted(*pair)]

    def wanted(self, i: int, j: int) -> bool:
        first, second = self.links[i], self.links[j]
        pair = frozenset((first, second))
        return first != second and pair not in self.robot.collision.allowed

    def distances(self, configuration: Array) -> Iterator[tuple[float, str, str]]:
        own = dict(zip([j.name for j in self.robot.actuated], configuration, strict=True))
        q = pin.neutral(self.model)
        for joint in self.robot.joints:
            value = joint.mimic.value(own[joint.mimic.leader]) if joint.mimic else own[joint.name]
            q[self.model.joints[self.model.getJointId(joint.name)].idx_q] = value
        pin.forwardKinematics(self.model, self.data, q)
        places = [self.data.oMi[shape.parentJoint] * shape.placement for shape in self.shapes]
        placed = [coal.Transform3s(place.rotation, place.translation) for place in places]
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        for i, j in self.pairs:
            result.clear()
            a, b = self.shapes[i].geometry, self.shapes[j].geometry
            yield (
                coal.distance(a, placed[i], b, placed[j], request, result),
                self.links[i],
                self.links[j],
            )
        yield from self.heights(places)

    def heights(self, places: list[pin.SE3]) -> Iterator[tuple[float, str, str]]:
        """Height above the floor, in closed form for box and cylinder."""
        floor, ignored = self.robot.collision.floor, self.robot.collision.floor_ignores
        for place, shape, link in zip(places, self.shapes, self.links, strict=True):
            if floor is None or link in ignored:
                continue
            geometry, up = shape.geometry, place.rotation[2]
            if isinstance(geometry, coal.Box):
                drop = float(abs(up) @ geometry.halfSide)
            else:
                drop = abs(up[2]) * geometry.halfLength + geometry.radius * np.hypot(up[0], up[1])
            yield place.translation[2] - drop - floor, link, "floor"


def test_agrees_with_the_planner(robot: Robot) -> None:
    checker = CollisionChecker(PlanningScene(robot))
    reference, random = ReferenceChecker(robot), np.random.default_rng(3)
    lower = np.array([joint.lower for joint in robot.actuated])
    upper = np.array([joint.upper for joint in robot.actuated])
    hits = 0
    for configuration in random.uniform(lower, upper, (300, 4)):
        distance, _, _ = min(reference.distances(configuration))
        nearest = checker.nearest(configuration)
        assert nearest is not None
        assert nearest.distance == pytest.approx(distance, abs=2e-5)
        if abs(distance - 0.005) > 2e-5:
            assert (checker.first_collision([configuration], 0.005) == 0) == (distance < 0.005)
        hits += distance < 0.005
    assert 50 < hits < 250


REACH = 1.0  # no point of the arm is farther from the axis of a joint [m]


def least_distance(robot: Robot, plan: Plan) -> float:
    """Least distance of the whole motion, every millisecond, with all other joints at rest [m].

    Milliseconds in which no link can have come closer than the least distance so far are left out.
    """
    reference = ReferenceChecker(robot)
    states = plan.sample(np.arange(0.0, plan.duration + 0.001, 0.001))
    rows = np.tile(plan.start, (len(states), 1))
    names = [joint.name for joint in robot.actuated]
    rows[:, [names.index(name) for name in plan.joints]] = states
    turned = np.append(0.0, np.cumsum(np.abs(np.diff(rows, axis=0)).sum(axis=1)))
    least, at = np.inf, 0
    while at < len(rows):
        distance = min(reference.distances(rows[at]))[0]
        least = min(least, distance)
        near = turned[at] + (distance - least) / REACH
        at = max(at + 1, int(np.searchsorted(turned, near, side="right")))
    return float(least)


@pytest.mark.parametrize(
    ("via", "rungs"),
    [((), {"bend"}), ((NEAR_FOLDED,), {"bend", "blend"})],
)
def test_detour_on_the_shipped_robot(
    robot: Robot, via: tuple[tuple[float, ...], ...], rungs: set[str]
) -> None:
    plan = Planner(robot).plan(Query("arm", (*FOLDED, 0.0), LEANING, via=via))
    assert len(plan.waypoints) > 2
    assert plan.milliseconds.keys() == {"ends", "straight", "time"} | rungs
    assert least_distance(robot, plan) > 0.5 * robot.collision.margin


def test_the_straight_line_is_not_free(robot: Robot) -> None:
    reference, a, b = ReferenceChecker(robot), np.array((*FOLDED, 0.0)), np.array((*LEANING, 0.0))
    line = a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a)
    assert min(min(reference.distances(row))[0] for row in line) < robot.collision.margin


@pytest.mark.parametrize("seed", [1, 2])
def test_detour_around_a_post(robot_with_post: Robot, seed: int) -> None:
    query = Query("arm", (0.3, -0.6, 0.3, 0.0), (-1.4, -0.6, -0.07), seed)
    plan = Planner(robot_with_post).plan(query)
    assert len(plan.waypoints) > 2
    assert least_distance(robot_with_post, plan) > 0.5 * robot_with_post.collision.margin
