"""Arms with large meshes: no call is so long that a deadline or an error is late."""

import dataclasses
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
import pytest

from hardware import RealClock, Robot
from skills.motion import Body, Box, MotionError, PlanTimeout, Query, ToolQuery, World
from skills.motion.collision.broad_phase import MAX_MESH_PAIRS
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from tests.support.arms.real_arms import real
from tests.support.arms.robots import free_poses

pytestmark = pytest.mark.slow

POST = World((Body("post", Box((0.1, 0.1, 1.2)), (0.35, 0.35, 0.4)),))


class Reader(RealClock):
    """A clock that advances by a second with each reading."""

    def __init__(self) -> None:
        self.reads = 0

    def now(self) -> float:
        self.reads += 1
        return float(self.reads)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return real("jaco", tmp_path_factory.mktemp("arm"))


class Call(NamedTuple):
    """One call of pinocchio."""

    rows: int
    pairs: int
    meshed: bool


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[Call]:
    """All calls from now on."""
    made, ask = list[Call](), pin.computeCollisionsInParallel
    place = pin.updateGeometryPlacements

    def noted(threads: int, pool: pin.GeometryPool, q: Any, *rest: bool) -> Any:
        pairs = sum(pool.getGeometryData(0).activeCollisionPairs)
        made.append(Call(q.shape[1], pairs, _meshed(pool.getGeometryModels()[0])))
        return ask(threads, pool, q, *rest)

    def noted_boxes(*given: Any) -> None:  # the shapes' boxes are compared next
        made.append(Call(1, len(given[2].collisionPairs), _meshed(given[2])))
        place(*given)

    monkeypatch.setattr(pin, "updateGeometryPlacements", noted_boxes)
    monkeypatch.setattr(pin, "computeCollisionsInParallel", noted)
    return made


def _meshed(geometry: pin.GeometryModel) -> bool:
    return any(isinstance(shape.geometry, coal.BVHModelBase) for shape in geometry.geometryObjects)


def _queries(robot: Robot) -> list[Query]:
    poses = free_poses(robot, 6, 1, CollisionChecker(PlanningScene(robot, POST)))
    own = [i for i, j in enumerate(robot.actuated) if j in robot.actuated_in("arm")]
    ends = zip(poses[::2], poses[1::2], strict=True)
    return [Query("arm", tuple(a), tuple(b[own]), world=POST, timeout=200.0) for a, b in ends]


def test_no_call_is_long(robot: Robot, calls: list[Call]) -> None:
    planner, queries = Planner(robot), _queries(robot)
    calls.clear()
    for query in queries:
        planner.plan(query)
    assert not any(call.meshed for call in calls if call.rows > 1)
    assert all(call.rows * call.pairs <= MAX_MESH_PAIRS for call in calls if not call.meshed)
    assert {call.meshed for call in calls} == {False, True}


def test_the_deadline_is_read_between_calls(robot: Robot, calls: list[Call]) -> None:
    clock, queries, timeouts = Reader(), _queries(robot), 0
    planner = Planner(robot, clock)
    for query in queries:
        _answered(planner, dataclasses.replace(query, timeout=1e9))  # all is made by then
    for query in queries:
        calls.clear()
        clock.reads = 0
        late = dataclasses.replace(query, timeout=30.0)  # some need more readings
        timeouts += isinstance(_answered(planner, late), PlanTimeout)
        long = sum(call.rows > 1 or call.meshed for call in calls)
        # A row whose boxes are compared takes microseconds; 32 of them share a reading.
        assert 0 < long + (len(calls) - long) / 32 <= clock.reads
    assert timeouts


def test_inverse_kinematics_reads_the_deadline_between_steps(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, ask = list[None](), pin.computeJointJacobians

    def noted(*given: Any) -> Any:
        steps.append(None)
        return ask(*given)

    monkeypatch.setattr(pin, "computeJointJacobians", noted)
    clock = Reader()
    query = ToolQuery("arm", robot.boot_pose, (2.0, 0.0, 0.0), timeout=30.0)
    assert isinstance(_answered(Planner(robot, clock), query), PlanTimeout)
    assert len(steps) <= 40


def _answered(planner: Planner, request: Query | ToolQuery) -> object:
    try:
        return planner.answer(request)
    except MotionError as error:
        return error


def test_no_distance_of_touching_meshes_is_computed(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A distance takes a hundred times as long as a collision check."""
    checker, checked = CollisionChecker(PlanningScene(robot)), list[object]()
    draws = np.random.default_rng(2).uniform(-np.pi, np.pi, (200, len(robot.actuated)))
    touching = [row for row in draws if checker.first_collision([row], 0.0) == 0]
    every, of_two = pin.computeDistances, coal.distance

    def all_of(*given: Any) -> Any:
        checked.extend(shape.geometry for shape in given[2].geometryObjects)
        return every(*given)

    def one(*given: Any) -> Any:
        checked.extend((given[0], given[2]))
        return of_two(*given)

    monkeypatch.setattr(pin, "computeDistances", all_of)
    monkeypatch.setattr(coal, "distance", one)
    for row in touching:
        nearest = checker.nearest(row)
        assert nearest
        assert nearest.distance < 0.0
    assert len(touching) > 10
    assert not any(isinstance(shape, coal.BVHModelBase) for shape in checked)
