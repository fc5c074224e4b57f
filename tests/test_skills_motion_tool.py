"""Joint positions for a tool: found where there are any, and told truly where there are none."""

import dataclasses

import pytest

from hardware import Robot, load_robot
from skills.motion import NotFinite, Query, ToolQuery
from skills.motion.planner import Planner
from tests.arms import foreign

HOME = (0.0, 0.0, 0.0, 0.0)
WITHIN = (0.1, 0.05, 0.08)


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner(load_robot())


def test_what_is_not_finite_is_named(planner: Planner) -> None:
    axis = (0.0, 1.0, float("inf"))
    with pytest.raises(NotFinite, match=r"^The z of the axis is inf; give") as caught:
        planner.reach(ToolQuery("arm", HOME, WITHIN, axis=axis))
    assert caught.value.joint == ""


def test_the_answer_is_soonest_reached_with_the_accelerations_too() -> None:
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
