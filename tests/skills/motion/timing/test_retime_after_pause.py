"""The rest of a motion: the same path, timed again from standstill within the limits."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from hardware import load_robot
from skills.motion import BadQuery, NotFinite, Plan, Query, Rest
from skills.motion.planner import Planner
from skills.motion.timing.time_parameterization import time_curve

ROBOT = load_robot()
PLANNER = Planner(ROBOT)
LINE = PLANNER.plan(Query("arm", (0.0,) * 4, (0.7, 0.2, -0.3)))
BENT = PLANNER.plan(
    Query("arm", (0.0,) * 4, (0.6, 0.3, -0.4), via=((0.5, -0.2, 0.1), (0.55, 0.1, 0.1)))
)
CORNER = PLANNER.plan(Query("arm", (0.0,) * 4, (0.1, 0.0, 0.0), via=((0.05, 0.05, 0.0),)))
HOOK = PLANNER.plan(Query("arm", (0.0,) * 4, (0.3, 0.05, 0.0), via=((0.25, 0.0, 0.0),)))
GRIPPER = PLANNER.plan(Query("gripper", (0.3, 0.0, 0.0, 0.0), (-0.7,)))


def left(plan: Plan, time: float) -> Plan:
    start = np.array(plan.start)
    names = [joint.name for joint in ROBOT.actuated]
    start[[names.index(name) for name in plan.joints]] = plan.sample([time])[0]
    return PLANNER.rest(Rest(plan, time, tuple(start.tolist())))


def check(plan: Plan, time: float, rest: Plan) -> None:
    assert np.array_equal(rest.origin, plan.sample([time])[0])
    assert np.array_equal(rest.sample([rest.duration])[0], plan.goal)
    times = np.linspace(0.0, rest.duration, 400)
    assert np.all(abs(rest.velocities(times)) <= plan.velocity * (1 + 1e-6))
    assert np.all(abs(rest.accelerations(times)) <= plan.acceleration * (1 + 1e-6))
    if rest.duration:
        assert np.allclose(rest.velocities(times[[0, -1]]), 0.0, atol=1e-6)
    path = plan.sample(np.linspace(time, plan.duration, 4000))
    for row in rest.sample(times[::20]):
        assert np.min(np.linalg.norm(path - row, axis=1)) < 2e-3


@settings(max_examples=60, deadline=None)
@given(st.sampled_from((LINE, BENT, CORNER, HOOK, GRIPPER)), st.floats(0.0, 1.0))
def test_the_rest_is_the_same_path_within_the_limits(plan: Plan, share: float) -> None:
    time = share * plan.duration
    check(plan, time, left(plan, time))


def test_blends_at_the_ends_of_a_path() -> None:
    assert [bool(plan.curve.quadratic[-1].any()) for plan in (CORNER, HOOK)] == [True, True]
    assert [len(plan.curve.constant) for plan in (CORNER, HOOK)] == [1, 2]


@settings(max_examples=30, deadline=None)
@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_rest_of_a_rest(first: float, second: float) -> None:
    rest = left(BENT, first * BENT.duration)
    time = second * rest.duration
    check(rest, time, left(rest, time))


@pytest.mark.parametrize("short", [1e-15, 1e-12, 1e-10, 1e-8])
def test_a_stop_slightly_before_a_blend_begins_or_ends(short: float) -> None:
    for end in BENT.curve.breaks[1:-1]:
        rest = BENT.curve.after(end - short)
        assert time_curve(rest, BENT.velocity, BENT.acceleration)
        assert np.allclose(rest.positions(np.zeros(1)), BENT.curve.positions(np.array([end])))
        assert rest.length == pytest.approx(BENT.curve.length - end, abs=2e-8)


@pytest.mark.parametrize("plan", [LINE, BENT, CORNER, GRIPPER])
@pytest.mark.parametrize("before", [1e-12, 1e-9, 1e-6, 3e-5, 1e-4])
def test_a_stop_slightly_before_the_end(plan: Plan, before: float) -> None:
    rest = left(plan, plan.duration - before)
    check(plan, plan.duration - before, rest)
    assert np.array_equal(rest.sample([0.0])[0], rest.origin)


def test_the_rest_from_the_start_is_the_whole_motion() -> None:
    rest = left(LINE, 0.0)
    assert list(rest.milliseconds) == ["time"]  # not what it took to find all of it
    assert rest.duration == LINE.duration
    assert np.array_equal(rest.waypoints, LINE.waypoints)


def test_an_arm_off_the_path_is_rejected() -> None:
    with pytest.raises(BadQuery, match="is not at the position of the stop"):
        PLANNER.rest(Rest(LINE, 0.5 * LINE.duration, tuple(LINE.start)))


@pytest.mark.parametrize("time", [math.nan, math.inf, -math.inf, np.float64("nan")])
def test_a_time_that_is_not_finite(time: float) -> None:
    with pytest.raises(NotFinite, match=r"time of the motion is .*; give a finite number"):
        PLANNER.rest(Rest(LINE, time, tuple(LINE.start)))


ODD: tuple[tuple[str, Any, str], ...] = (
    ("time", "a", "The time is 'a' s; give a number"),
    ("time", None, "The time is None s; give a number"),
    ("time", 10**400, "The time is 1000.* s; give a number"),
    ("plan", None, "The plan is None; give a Plan of this planner"),
    ("plan", GRIPPER, "arm is not at the position of the stop"),
    ("plan", replace(LINE, velocity=np.zeros(3)), "The limits of the plan are not above 0"),
    (
        "plan",
        replace(LINE, acceleration=np.array([1.0, np.nan, 1.0])),
        "The limits of the plan are not ab",
    ),
    (
        "plan",
        replace(LINE, joints=("joint_4",)),
        r"The plan moves joint_4, but arm has joint_1, joint_2",
    ),
)


@pytest.mark.parametrize(("what", "odd", "message"), ODD)
def test_invalid_requests(what: str, odd: Any, message: str) -> None:
    with pytest.raises(BadQuery, match=message):
        PLANNER.answer(replace(Rest(LINE, 0.1, tuple(LINE.start)), **{what: odd}))
