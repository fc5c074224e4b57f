"""Inverse kinematics: solutions, and correct errors if there is none."""

import dataclasses
import re

import numpy as np
import pinocchio as pin
import pytest

from hardware import RealClock, Robot, load_robot
from skills.motion import Body, Box, NotFinite, Query, ToolQuery, Unreachable, World
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.planning_scene import PlanningScene
from skills.motion.planner import Planner
from tests.support.arms.robots import foreign

HOME = (0.0, 0.0, 0.0, 0.0)
WITHIN, FAR = (0.1, 0.05, 0.08), (0.0575, -0.2841, -0.0468)
ROOM = World(
    (
        Body("post", Box((0.1, 0.1, 1.2)), (0.35, 0.35, 0.4)),
        Body("other", Box((0.1, 0.1, 1.2)), (0.4, -0.2, 0.4)),
        Body("roof", Box((0.6, 0.6, 0.1)), (0.4, 0.0, 0.9)),
    )
)


class Reads(RealClock):
    """A clock that counts its readings."""

    def __init__(self) -> None:
        self.count = 0

    def now(self) -> float:
        self.count += 1
        return super().now()


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner(load_robot())


@pytest.fixture(scope="module")
def six_axes() -> Planner:
    return Planner(foreign("six_axes"))


def refusal(planner: Planner, query: ToolQuery) -> Unreachable:
    with pytest.raises(Unreachable) as caught:
        planner.reach(query)
    return caught.value


@pytest.mark.parametrize("seed", range(1, 6))
def test_the_nearest_point_is_the_nearest(planner: Planner, seed: int) -> None:
    error = refusal(planner, ToolQuery("arm", HOME, FAR, seed=seed))
    assert error.distance == pytest.approx(0.1446, abs=1e-4)
    assert np.linalg.norm(np.subtract(error.nearest, FAR)) == pytest.approx(error.distance)
    assert {type(value) for value in (*error.point, *error.nearest)} == {float}


@pytest.mark.parametrize(
    ("start", "point", "direction"),
    [
        (
            (2.5464, -1.9487, 1.6416, -1.4307, 0.4988, 1.5336),
            (0.4765, 0.5515, -0.0059),
            (-0.218, 0.9759, -0.0062),
        ),
        (
            (-1.228, -0.7828, 2.3373, 2.0532, -1.6533, 0.4476),
            (-0.1348, -0.0734, -0.3564),
            (-0.1975, -0.5728, -0.7955),
        ),
        (
            (-1.6929, 0.1132, 0.5759, -0.709, 0.1873, 2.4049),
            (-0.4138, 0.0332, 0.2952),
            (-0.3519, -0.7514, -0.5581),
        ),
    ],
)
def test_solutions_that_few_starting_points_lead_to(
    six_axes: Planner,
    start: tuple[float, ...],
    point: tuple[float, float, float],
    direction: tuple[float, float, float],
) -> None:
    query = ToolQuery("arm", start, point, direction)
    found = six_axes.reach(query)
    assert six_axes.reach(query) == found
    assert six_axes.plan(Query("arm", start, found.positions)).duration > 0.0


def test_more_solutions_are_searched_if_the_first_are_in_collision(six_axes: Planner) -> None:
    start = (0.211, 1.748, -1.87, -0.492, 0.673, 2.231)
    found = six_axes.reach(ToolQuery("arm", start, (0.4283, -0.4088, 0.0789), world=ROOM))
    checker = CollisionChecker(PlanningScene(foreign("six_axes"), ROOM))
    assert checker.first_invalid(np.array([found.positions]), 0.01) is None


@pytest.mark.parametrize(
    ("direction", "degrees"), [((0.0, 0.0, -1.0), 69.7), ((0.8, 0.4, 0.45), 47.6)]
)
def test_an_unreachable_direction_differs_from_an_unreachable_point(
    planner: Planner, direction: tuple[float, float, float], degrees: float
) -> None:
    error = refusal(planner, ToolQuery("arm", HOME, WITHIN, direction))
    assert error.nearest == pytest.approx(WITHIN, abs=error.tolerance)
    assert np.degrees(error.askew) == pytest.approx(degrees, abs=0.1)
    assert error.direction == direction
    shown = re.escape(", ".join(f"{x:g}" for x in direction))
    wanted = rf"can reach \(100\.0, .*at least {degrees} deg off the direction \({shown}\)"
    assert re.search(wanted, str(error))
    assert "leave it out" in str(error)


def test_an_unreachable_point_is_reported_with_a_direction_too(planner: Planner) -> None:
    alone = refusal(planner, ToolQuery("arm", HOME, FAR))
    both = refusal(planner, ToolQuery("arm", HOME, FAR, (0.0, 0.0, -1.0)))
    assert both.distance == pytest.approx(alone.distance, abs=1e-5)
    assert "in any direction" in str(both)
    assert "within reach" in str(both)


def test_a_point_slightly_out_of_reach_is_shown_with_enough_digits(planner: Planner) -> None:
    far = refusal(planner, ToolQuery("arm", HOME, FAR))
    out = np.subtract(far.point, far.nearest) / far.distance
    x, y, z = (np.array(far.nearest) + 2e-5 * out).tolist()
    error = refusal(planner, ToolQuery("arm", HOME, (x, y, z)))
    assert error.distance == pytest.approx(2e-5, abs=3e-6)
    requested, nearest = re.findall(r"\(.*?\) mm", str(error))
    assert requested != nearest
    assert re.search(r", 0\.0[12]\d* mm away \(tolerance: 0\.001 mm\); ", str(error))


def test_a_point_that_is_missed_by_microns_is_reached(planner: Planner) -> None:
    """As at a step sideways of a stretched arm."""
    far = refusal(planner, ToolQuery("arm", HOME, FAR))
    out = np.subtract(far.point, far.nearest) / far.distance
    x, y, z = (np.array(far.nearest) + 3e-6 * out).tolist()
    assert planner.reach(ToolQuery("arm", HOME, (x, y, z))).positions


def test_a_number_that_is_not_finite_is_named(planner: Planner) -> None:
    axis = (0.0, 1.0, float("inf"))
    with pytest.raises(NotFinite, match=r"^The z of the axis is inf; give") as caught:
        planner.reach(ToolQuery("arm", HOME, WITHIN, axis=axis))
    assert caught.value.joint == ""


def test_accelerations_count_for_the_shortest_motion() -> None:
    robot, start = foreign("six_axes"), (0.0, 0.5, 0.5, 0.0, 0.5, 0.0)
    slow = _with_acceleration(robot, "turn", 0.05)
    query = ToolQuery("arm", start, (-0.3, 0.2, 0.4))
    one, other = Planner(robot).reach(query).positions, Planner(slow).reach(query).positions
    assert one != other
    planner = Planner(slow)
    seconds = [planner.plan(Query("arm", start, goal)).duration for goal in (one, other)]
    assert seconds[1] < seconds[0]


def _with_acceleration(robot: Robot, name: str, limit: float) -> Robot:
    joints = tuple(
        dataclasses.replace(joint, acceleration=limit) if joint.name == name else joint
        for joint in robot.joints
    )
    return dataclasses.replace(robot, joints=joints)


def test_the_deadline_is_checked_at_every_step(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, seen, ask = Reads(), list[int](), pin.computeJointJacobians

    def noted(*given: object) -> object:
        seen.append(clock.count)
        return ask(*given)

    monkeypatch.setattr(pin, "computeJointJacobians", noted)
    refusal(Planner(load_robot(), clock), ToolQuery("arm", HOME, WITHIN, (0.0, 0.0, -1.0)))
    _, most = np.unique(seen, return_counts=True)
    assert most.max() <= 3
