"""Answers of workers: honest ones pass, and a lie is found whatever it is about."""

import contextlib
import dataclasses
import math
import pickle
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest

from hardware import Robot, load_robot
from hardware.description.urdf import Urdf
from skills.motion import (
    BadQuery,
    Body,
    Box,
    Carry,
    MotionError,
    Plan,
    Query,
    Reached,
    Request,
    Rest,
    Sphere,
    ToolQuery,
    World,
)
from skills.motion.errors import GoalInCollision, Unreachable
from skills.motion.planner import Planner
from skills.motion.trajectory.curve import Curve
from skills.motion.trajectory.time_law import TimeLaw
from skills.motion.workers.answer_checker import AnswerChecker
from skills.motion.workers.messages import InvalidMessage
from tests.support.arms.robots import ARMS, foreign

PICK = Query("arm", (0.0, 0.0, 0.0, 0.0), (-1.4, -0.6, -0.07))
BENT = dataclasses.replace(PICK, via=((-0.7, 0.2, 0.0), (-1.0, -0.2, 0.1)))
POST = World((Body("post", Box((0.03, 0.03, 0.3)), (0.115, 0.115, 0.15)),))
ROUND = Query("arm", (0.3, 0.3, -0.3, 0.0), (-1.3, 0.3, -0.3), world=POST)
TOOL = ToolQuery("arm", PICK.start, (0.1, 0.05, 0.08))
CARRY = Carry(POST, "post", "claw_support", PICK.start)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def planner(robot: Robot) -> Planner:
    return Planner(robot)


@pytest.fixture(scope="module")
def checker(robot: Robot) -> AnswerChecker:
    return AnswerChecker(robot)


def received(answer: Any) -> Any:
    """An answer as the parent of a worker receives it."""
    return pickle.loads(pickle.dumps(answer))


def rest_of(plan: Plan, share: float) -> Rest:
    """The rest of a motion of the shipped arm that was stopped."""
    time = share * plan.duration
    return Rest(plan, time, (*plan.sample([time])[0].tolist(), 0.0))


@pytest.mark.parametrize("query", [PICK, BENT, ROUND, Query("gripper", PICK.start, (-0.7,))])
def test_honest_plans(planner: Planner, checker: AnswerChecker, query: Query) -> None:
    plan = planner.plan(query)
    checker.check(query, received(plan))
    if query.group == "arm":
        for share in (0.0, 0.1, 0.5, 0.9, 1.0):
            rest = rest_of(plan, share)
            checker.check(rest, received(planner.rest(rest)))


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-3])
def test_honest_plans_of_any_length(planner: Planner, checker: AnswerChecker, size: float) -> None:
    goal = (-size, 0.3 * size, 0.1 * size)
    for query in (
        dataclasses.replace(PICK, goal=goal),
        dataclasses.replace(PICK, goal=goal, via=((size, size, 0.0),)),
    ):
        checker.check(query, received(planner.plan(query)))


@pytest.mark.parametrize("name", ARMS)
def test_honest_plans_of_other_arms(name: str) -> None:
    """One of them turns without end: its goal may be off by whole turns."""
    robot = foreign(name)
    planner, checker = Planner(robot), AnswerChecker(robot)
    draw = np.random.default_rng(1)
    boot = tuple(joint.boot for joint in robot.actuated)
    arm = robot.actuated_in("arm")
    found = 0
    for _ in range(20):
        goal, via = (
            tuple(
                float(draw.uniform(max(j.lower, j.boot - 8.0), min(j.upper, j.boot + 8.0)))
                for j in arm
            )
            for _ in range(2)
        )
        for query in (Query("arm", boot, goal), Query("arm", boot, goal, via=(via,))):
            try:
                plan = planner.plan(query)
            except MotionError as error:
                checker.check(query, received(error))
            else:
                found += 1
                checker.check(query, received(plan))
    assert found > 5


def test_honest_answers_to_other_requests(planner: Planner, checker: AnswerChecker) -> None:
    for request in (TOOL, CARRY):
        checker.check(request, received(planner.answer(request)))


def curved(plan: Plan, **changes: Any) -> Plan:
    return dataclasses.replace(plan, curve=dataclasses.replace(plan.curve, **changes))


def timed(plan: Plan, **changes: Any) -> Plan:
    return dataclasses.replace(plan, profile=dataclasses.replace(plan.profile, **changes))


def faster(plan: Plan) -> Plan:
    return dataclasses.replace(plan, profile=plan.profile.slowed(1 / 3))


def slow(plan: Plan) -> Plan:
    return dataclasses.replace(plan, profile=plan.profile.slowed(1e7))


def ends_elsewhere(plan: Plan) -> Plan:
    """Everything is right, but for another goal: 0.1 rad off."""
    goal = plan.goal + np.array([0.0, 0.1, 0.0])
    curve = Curve.line(plan.origin, goal)
    law = TimeLaw.trapezoidal(0.0, curve.length, 0.1, 0.1)
    waypoints = np.array([plan.origin, goal])
    return dataclasses.replace(plan, goal=goal, curve=curve, profile=law, waypoints=waypoints)


def round_trip(plan: Plan) -> Plan:
    """Leads to the right goal, but through a point outside the limits."""
    corner = np.array([0.0, 3.0, 0.0])
    waypoints = np.array([plan.origin, corner, plan.goal])
    curve = Curve.through(waypoints, np.zeros(1))
    first, second = (
        TimeLaw.trapezoidal(begin, end, 0.1, 0.1)
        for begin, end in ((0.0, curve.stops[0]), (curve.stops[0], curve.length))
    )
    return dataclasses.replace(plan, waypoints=waypoints, curve=curve, profile=first.then(second))


def cut_corner(plan: Plan) -> Plan:
    """Does not stop where its direction jumps."""
    waypoints = np.array([plan.origin, [-0.1, 0.6, 0.0], plan.goal])
    curve = Curve.through(waypoints, np.zeros(1))
    law = TimeLaw.trapezoidal(0.0, curve.length, 0.2, 0.1)
    corner = float(np.interp(curve.stops[0], law.positions, law.times))
    place, speed, push = law.at(np.array([corner]))
    k = int(np.searchsorted(law.times, corner))
    law = TimeLaw(
        np.insert(law.times, k, corner),
        np.insert(law.positions, k, place),
        np.insert(law.speeds, k, speed),
        np.insert(law.accelerations, k, push),
    )
    return dataclasses.replace(plan, waypoints=waypoints, curve=curve, profile=law)


LIES: list[tuple[str, Callable[[Plan], Any], str]] = [
    ("group", lambda p: dataclasses.replace(p, group="gripper"), "a plan for 'gripper'"),
    ("joints", lambda p: dataclasses.replace(p, joints=("a", "b", "c")), "'a', 'b', 'c'"),
    ("seed", lambda p: dataclasses.replace(p, seed=2), "with seed 2, not for .* with seed 1"),
    ("stages", lambda p: dataclasses.replace(p, milliseconds={"time": math.inf * 0}), "durations"),
    ("other limits", lambda p: dataclasses.replace(p, velocity=9 * p.velocity), "velocity limit"),
    ("start", lambda p: dataclasses.replace(p, start=p.start + 0.1), "starts with joint_1 at 5.7"),
    ("origin", lambda p: dataclasses.replace(p, origin=p.origin + 0.1), "starts with joint_1"),
    ("goal", lambda p: dataclasses.replace(p, goal=p.goal + 0.1), "ends with joint_1 at -74.4"),
    ("another goal", ends_elsewhere, "ends with joint_2 at -28.6479 deg, not at -34.3775 deg"),
    ("a whole turn", lambda p: dataclasses.replace(p, goal=p.goal + 2 * np.pi), "ends with"),
    ("empty", lambda p: dataclasses.replace(p, waypoints=np.empty((0, 3))), "the shape"),
    ("flat", lambda p: curved(p, constant=np.zeros(3)), "constant have the shape"),
    ("short", lambda p: timed(p, speeds=np.zeros(2)), r"speeds have the shape \(2,\), not \(4,\)"),
    ("no time", lambda p: timed(p, times=np.float64(0.0)), "times have the shape"),
    ("more joints", lambda p: dataclasses.replace(p, origin=np.zeros(4)), "origin have the shape"),
    ("breaks", lambda p: curved(p, breaks=-p.curve.breaks), "whose breaks are"),
    ("jump", lambda p: curved(p, constant=p.curve.constant + 0.1), "continues with joint_1 at 5.7"),
    ("far", lambda p: curved(p, linear=1e200 * p.curve.linear), "continues with joint_1 at"),
    ("huge", lambda p: curved(p, linear=np.full((1, 3), 1.7e308)), "continues with joint_1 at"),
    ("outside", round_trip, r"with joint_2 at 171.887 deg, outside \[-90 deg, 90 deg\]"),
    ("fast", faster, r"with joint_1 at -143.* deg/s, outside \[-57.* deg/s, 57"),
    ("a year", slow, "a plan of .* s; the limit is 600 s"),
    ("backwards", lambda p: timed(p, times=-p.profile.times), "time law does not cover"),
    ("not to the end", lambda p: timed(p, positions=0.5 * p.profile.positions), "time law does"),
    ("standstill", lambda p: dataclasses.replace(p, profile=TimeLaw.standstill()), "time law"),
    ("corner", cut_corner, "does not stop at a corner"),
]


@pytest.mark.parametrize(("lie", "words"), [each[1:] for each in LIES], ids=[x[0] for x in LIES])
def test_lies_about_a_plan(
    planner: Planner, checker: AnswerChecker, lie: Callable[[Plan], Any], words: str
) -> None:
    with pytest.raises(InvalidMessage, match=words):
        checker.check(PICK, received(lie(planner.plan(PICK))))


def test_a_plan_that_leaves_out_a_via_point(planner: Planner, checker: AnswerChecker) -> None:
    with pytest.raises(InvalidMessage, match="does not pass via point 1"):
        checker.check(BENT, received(planner.plan(PICK)))
    backwards = dataclasses.replace(BENT, via=BENT.via[::-1])
    with pytest.raises(InvalidMessage, match="does not pass via point 2"):
        checker.check(backwards, received(planner.plan(BENT)))


def test_a_rest_that_leads_elsewhere(planner: Planner, checker: AnswerChecker) -> None:
    rest = rest_of(planner.plan(PICK), 0.5)
    with pytest.raises(InvalidMessage, match="starts with joint_1"):
        checker.check(rest, received(planner.plan(PICK)))


@pytest.mark.parametrize(
    ("request_", "answer", "words"),
    [
        (PICK, Reached((0.0,), 1), "Query with Reached"),
        (PICK, None, "Query with NoneType"),
        (TOOL, Reached((0.0, 0.0), 1), "one position for each of joint_1, joint_2, joint_3"),
        (TOOL, Reached((0.0, 0.0, float("nan")), 1), "one position for each of"),
        (TOOL, Reached((0.0, 9.0, 0.0), 1), "with joint_2 at 515.662 deg, outside"),
        (TOOL, Reached(cast("Any", ("1", 0.0, 0.0)), 1), "one position for each of"),
        (CARRY, Body("other", Sphere(0.1)), "not post attached to claw_support"),
        (CARRY, POST.bodies[0], "not post attached to claw_support"),
    ],
)
def test_lies_about_other_requests(
    checker: AnswerChecker, request_: Request, answer: Any, words: str
) -> None:
    with pytest.raises(InvalidMessage, match=words):
        checker.check(request_, received(answer))


@pytest.mark.parametrize("name", ARMS)
def test_solutions_of_other_arms(name: str) -> None:
    """Honest ones pass, relative or not, with any tool and direction."""
    robot = foreign(name)
    planner, checker = Planner(robot), AnswerChecker(robot)
    group, random = next(iter(robot.groups)), np.random.default_rng(3)
    own = ToolQuery(group, robot.boot_pose, (0.0, 0.0, 0.0), relative=True, timeout=600.0)
    link = Urdf.read(robot.urdf).joints[-1].child
    named = dataclasses.replace(own, link=link, offset=(0.01, 0.0, 0.02))
    solved = 0
    for tool in (own, named, dataclasses.replace(named, direction=(0.0, 0.6, -0.8))):
        point = tuple(random.uniform(-0.04, 0.04, 3).tolist())
        request = dataclasses.replace(tool, point=point)
        with contextlib.suppress(Unreachable, GoalInCollision):
            answer = received(planner.answer(request))
            assert checker.check(request, answer) == answer
            solved += 1
    assert solved


def test_a_solution_within_the_limits_that_does_not_reach(
    planner: Planner, checker: AnswerChecker
) -> None:
    answer = received(planner.answer(TOOL))
    assert checker.check(TOOL, answer) == answer
    for off in (0.1, 1e-3, -1e-4):
        shifted = Reached(tuple(each + off for each in answer.positions), 1)
        with pytest.raises(InvalidMessage, match=r"with the tool .* mm from its target"):
            checker.check(TOOL, shifted)


def test_a_solution_in_another_direction(planner: Planner, checker: AnswerChecker) -> None:
    pointing = dataclasses.replace(TOOL, direction=(0.0, 1.0, 0.0))
    answer = received(planner.answer(TOOL))
    with pytest.raises(InvalidMessage, match=r"with the tool .* deg from its direction"):
        checker.check(pointing, answer)


@pytest.mark.parametrize(
    "odd",
    [
        {"point": ("a", "b", "c")},
        {"point": (0.1,)},
        {"point": (float("nan"),) * 3},
        {"direction": (0.0, 0.0, 0.0)},
        {"link": "nowhere"},
        {"offset": None},
    ],
)
def test_a_solution_of_an_invalid_query(
    planner: Planner, checker: AnswerChecker, odd: dict[str, Any]
) -> None:
    answer = received(planner.answer(TOOL))
    with pytest.raises(InvalidMessage, match="a solution"):
        checker.check(dataclasses.replace(TOOL, **odd), answer)


def test_an_error_with_other_durations(checker: AnswerChecker) -> None:
    error = BadQuery("?")
    error.milliseconds = {"time": float("nan")}
    with pytest.raises(InvalidMessage, match="invalid durations"):
        checker.check(PICK, received(error))


def test_a_plan_for_a_request_that_has_none(planner: Planner, checker: AnswerChecker) -> None:
    plan = received(planner.plan(PICK))
    for odd in ({"start": (0.0,)}, {"goal": (0.0,)}, {"group": "leg"}):
        with pytest.raises(BadQuery):
            checker.check(dataclasses.replace(PICK, **odd), plan)
