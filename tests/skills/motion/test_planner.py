"""The planner: each stage with its own error, and plans that are exact at both ends."""

import dataclasses
import hashlib
import math
import pickle
import subprocess
import sys
from collections.abc import Iterator
from functools import partialmethod
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from hardware import RealClock, Robot, SimulatedClock, load_robot
from skills.motion import (
    BadQuery,
    Body,
    Box,
    GoalInCollision,
    GoalOutOfBounds,
    ModelUnusable,
    MotionCollides,
    MotionError,
    NoPath,
    NotFinite,
    Plan,
    PlanTimeout,
    Query,
    Rest,
    StartInCollision,
    StartOutOfBounds,
    TooLong,
    Verify,
    World,
)
from skills.motion.arrays import Array
from skills.motion.path import rrt_connect
from skills.motion.path.motion_validator import MotionValidator
from skills.motion.planner import Planner
from skills.motion.trajectory.curve import Curve
from tests.support.paths import ROOT

HOME, PICK, REST = (0.0, 0.0, 0.0), (-1.4, -0.6, -0.07), (-1.57, 0.0, -0.9)
UNDER_THE_TABLE = (0.0, -1.5, -0.5)
DETOUR = Query("arm", (-1.44023649, 0.16565795, -0.993262, 0.0), (-1.337505, 1.30914797, -1.103535))
WALLS = World(
    (
        Body("left", Box((0.02, 0.2, 0.3)), (0.09, 0.17, 0.15)),
        Body("right", Box((0.02, 0.2, 0.3)), (-0.09, 0.17, 0.15)),
        Body("roof", Box((0.2, 0.2, 0.02)), (0.0, 0.17, 0.2)),
    )
)
# One bend is not enough, in either direction.
SEARCHED = Query("arm", (0.19, -0.4, 0.56, 0.0), (-0.22, 0.05, 1.42), world=WALLS)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def planner(robot: Robot) -> Planner:
    return Planner(robot)


def arm(start: tuple[float, ...], goal: tuple[float, ...], **more: float) -> Query:
    return Query("arm", (*start, 0.0), goal, **more)  # type: ignore[arg-type]


def via(*points: tuple[float, ...]) -> Query:
    return dataclasses.replace(arm(HOME, PICK), via=points)


@pytest.mark.parametrize(
    ("start", "goal", "duration"),
    [(HOME, PICK, 3.3466), (PICK, REST, 2.5768), (REST, HOME, 3.5440)],
)
def test_tasks(
    planner: Planner, start: tuple[float, ...], goal: tuple[float, ...], duration: float
) -> None:
    plan = planner.plan(arm(start, goal))
    assert plan.duration == pytest.approx(duration, abs=1e-4)
    assert plan.joints == ("joint_1", "joint_2", "joint_3")
    assert len(plan.waypoints) == 2
    assert list(plan.milliseconds) == ["ends", "straight", "time"]


def test_gripper_moves_alone(planner: Planner) -> None:
    plan = planner.plan(Query("gripper", (*PICK, 0.0), (-0.7,)))
    assert plan.joints == ("joint_4",)
    assert plan.duration == pytest.approx(2 * math.sqrt(0.7 / 0.5))
    assert tuple(plan.start) == (*PICK, 0.0)


def test_a_goal_at_the_start(planner: Planner) -> None:
    plan = planner.plan(arm(PICK, PICK))
    assert plan.duration == 0.0
    assert np.array_equal(plan.sample([-1.0, 0.0, 1.0]), [PICK] * 3)
    assert not plan.velocities([0.0]).any()


ANGLES = st.tuples(st.floats(-1.57, 1.57), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))


@given(start=ANGLES, goal=ANGLES, times=st.lists(st.floats(-1.0, 9.0), max_size=20))
@settings(max_examples=60, deadline=None)
def test_ends_are_exact_and_limits_kept(
    planner: Planner, start: tuple[float, ...], goal: tuple[float, ...], times: list[float]
) -> None:
    plan = planner.plan(arm(start, goal))
    ends = plan.sample([0.0, plan.duration, -1.0, plan.duration + 1.0])
    assert [tuple(row) for row in ends] == [start, goal, start, goal]
    for time, row in zip(times, plan.sample(times), strict=True):
        assert np.array_equal(plan.sample([time])[0], row)
    grid = np.arange(0.0, plan.duration, 0.001)
    low, high = np.minimum(start, goal) - 1e-12, np.maximum(start, goal) + 1e-12
    assert np.all((low <= plan.sample(grid)) & (plan.sample(grid) <= high))
    assert np.all(abs(plan.velocities(grid)) <= 1.001 * plan.velocity)
    assert np.all(abs(plan.accelerations(grid)) <= 1.001 * plan.acceleration)


@given(start=ANGLES, goal=ANGLES, shares=st.lists(st.floats(-0.1, 1.1), min_size=1, max_size=50))
@settings(max_examples=100, deadline=None)
def test_every_sample_of_a_straight_motion_is_on_the_checked_line(
    planner: Planner, start: tuple[float, ...], goal: tuple[float, ...], shares: list[float]
) -> None:
    """Therefore it is not checked again after timing."""
    plan = planner.plan(arm(start, goal))
    rows, line = plan.sample(plan.duration * np.array(shares)), np.subtract(goal, start)
    longest = int(np.argmax(abs(line)))
    along = (rows[:, longest] - start[longest]) / (line[longest] or 1.0)
    on_it = np.array(start) + np.clip(along, 0.0, 1.0)[:, None] * line
    assert abs(rows - on_it).max() <= 1e-14


@pytest.mark.parametrize(
    "query",
    [
        DETOUR,
        SEARCHED,
        dataclasses.replace(SEARCHED, via=(SEARCHED.goal, (0.1, -0.4, 0.6)), seed=3),
    ],
    ids=["bend", "searched", "via"],
)
def test_every_part_of_a_rounded_motion_was_proved_free(
    planner: Planner, monkeypatch: pytest.MonkeyPatch, query: Query
) -> None:
    """Therefore it is not checked again after timing, which does not leave the path."""
    free = list[Curve]()

    def line(self: MotionValidator, a: Array, b: Array, check: Any) -> bool:
        free.extend([Curve.line(a, b)] if (found := check(self, a, b)) else [])
        return bool(found)

    def curve(self: MotionValidator, path: Curve, check: Any) -> Any:
        free.extend([path] if (found := check(self, path)) is None else [])
        return found

    for name, watched in ("line_is_free", line), ("collision_on", curve):
        check = getattr(MotionValidator, name)
        monkeypatch.setattr(MotionValidator, name, partialmethod(watched, check=check))
    plan = planner.plan(query)
    proved = [part for each in free for part in _parts(each)]
    parts = list(_parts(plan.curve))
    assert len(parts) > 1
    for part in parts:
        assert any(_is_in(part, other) for other in proved)
    along, _, _ = plan.profile.at(np.linspace(-1.0, plan.duration + 1.0, 1000))
    assert along.min() == 0.0
    assert along.max() == pytest.approx(plan.curve.length)
    assert along.max() <= plan.curve.length


def _parts(curve: Curve) -> Iterator[Array]:
    """Start, middle and end of each piece of a curve (3, J) [rad]: these determine the piece."""
    for begin, end in pairwise(curve.breaks):
        yield curve.positions(np.array([begin, 0.5 * (begin + end), end]))


def _is_in(part: Array, other: Array) -> bool:
    """True if a piece is another one, or both are lines and the other one contains it."""
    if abs(part - other).max() < 1e-9:
        return True
    if any(abs(each[0] - 2.0 * each[1] + each[2]).max() > 1e-9 for each in (part, other)):
        return False
    line = other[2] - other[0]
    shares = (part - other[0]) @ line / (line @ line)
    apart = abs(other[0] + np.clip(shares, 0.0, 1.0)[:, None] * line - part).max()
    return bool(apart < 1e-9)


def test_derivatives_are_those_of_the_samples(planner: Planner) -> None:
    plan = planner.plan(DETOUR)
    times = np.arange(0.001, plan.duration - 0.001, 0.001)
    slopes = (plan.sample(times + 1e-5) - plan.sample(times - 1e-5)) / 2e-5
    assert np.allclose(slopes, plan.velocities(times), atol=1e-4)
    away = abs(times[:, None] - plan.profile.times).min(axis=1) > 1e-4
    turns = (plan.velocities(times + 1e-6) - plan.velocities(times - 1e-6)) / 2e-6
    assert np.allclose(turns[away], plan.accelerations(times)[away], atol=1e-3)


@pytest.mark.slow
def test_every_seed_finds_a_path_within_the_limits(planner: Planner) -> None:
    for seed in range(40):
        plan = planner.plan(dataclasses.replace(SEARCHED, seed=seed))
        assert "search" in plan.milliseconds
        times = np.arange(0.0, plan.duration, 0.001)
        assert np.all(abs(plan.velocities(times)) <= 1.001 * plan.velocity)
        assert np.all(abs(plan.accelerations(times)) <= 1.001 * plan.acceleration)
        assert np.array_equal(plan.sample([plan.duration])[0], plan.goal)


def test_a_bend_does_not_depend_on_the_seed(planner: Planner) -> None:
    plan = planner.plan(DETOUR)
    assert list(plan.milliseconds) == ["ends", "straight", "bend", "time"]
    assert digest(planner.plan(dataclasses.replace(DETOUR, seed=2))) == digest(plan)


def test_other_paths_are_tried_if_one_cannot_be_timed(
    planner: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If the bend fails, a path is searched; if that fails, the motion stops at each corner."""
    monkeypatch.setattr("skills.motion.timing.time_parameterization.time_section", lambda *_: None)
    plan = planner.plan(DETOUR)
    assert {"bend", "search", "blend"} <= plan.milliseconds.keys()
    assert len(plan.curve.stops) == len(plan.waypoints) - 2 > 0


def test_arrays_are_read_only_on_both_sides_of_a_pipe(planner: Planner) -> None:
    for plan in (planner.plan(DETOUR), pickle.loads(pickle.dumps(planner.plan(DETOUR)))):
        for array in (
            plan.start,
            plan.goal,
            plan.waypoints,
            plan.curve.constant,
            plan.profile.times,
        ):
            assert not array.flags.writeable


REFUSED = [
    (arm((math.nan, 0, 0), PICK), NotFinite, "start of joint_1 is nan"),
    (arm(HOME, (0, math.inf, 0)), NotFinite, "goal of joint_2 is inf"),
    (
        arm((2.0, 0, 0), PICK),
        StartOutOfBounds,
        "start of joint_1, 114.592 deg, is outside its limits, -90 deg to 90 deg",
    ),
    (arm(HOME, (0, 0, -1.6)), GoalOutOfBounds, r"goal of joint_3, -91.6732 deg,"),
    (Query("gripper", (0, 0, 0, 0), (0.1,)), GoalOutOfBounds, r"goal of joint_4, 5.72958 deg,"),
    (arm(UNDER_THE_TABLE, HOME), StartInCollision, "At the start, .* mm deep in floor"),
    (arm(HOME, UNDER_THE_TABLE), GoalInCollision, "At the goal, .* mm deep in floor"),
    (via(HOME[:3], UNDER_THE_TABLE), GoalInCollision, "^At via point 2, .*choose another via"),
    (via((0, 0, -1.6)), GoalOutOfBounds, r"^Via point 1 of joint_3, -91.6732 deg,"),
    (via((0, math.nan, 0)), NotFinite, "^Via point 1 of joint_2 is nan"),
    (via(PICK[:2]), BadQuery, "^Via point 1 has 2 values"),
    (arm(HOME, PICK[:2]), BadQuery, "goal has 2 values; give one for each of joint_1"),
    (Query("legs", (0, 0, 0, 0), (0,)), BadQuery, "no group 'legs'; the groups are arm, gripper"),
    (arm(HOME, PICK, seed=-1), BadQuery, "seed is -1"),
    (Query("arm", None, PICK), BadQuery, "start has 1 value;"),  # type: ignore[arg-type]
    (arm(HOME, ((0.0, 0.0, 0.0),)), BadQuery, "goal has 3 values"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("query", "error", "message"), REFUSED)
def test_refusals(planner: Planner, query: Query, error: type[MotionError], message: str) -> None:
    with pytest.raises(error, match=message):
        planner.plan(query)
    assert planner.plan(arm(HOME, PICK)).duration > 3.0  # and the next is none the worse


@pytest.mark.parametrize("far", [5e-324, 1e-300, 1e-160, 1e-12])
def test_goals_very_close_to_the_start(planner: Planner, far: float) -> None:
    assert tuple(planner.plan(arm(HOME, (far, 0.0, 0.0))).sample([1.0])[0]) == (far, 0.0, 0.0)


def test_a_limit_itself_is_allowed(planner: Planner, robot: Robot) -> None:
    edge = robot.joint("joint_1").lower
    assert planner.plan(arm(HOME, (edge, 0.0, 0.0))).goal[0] == edge


WALL = """
<link name="wall"><collision>
  <origin xyz="0.354 0.421 0.35" rpy="0 0 0.8708"/><geometry><box size="0.9 0.01 0.7"/></geometry>
</collision></link>
<joint name="wall_joint" type="fixed"><parent link="world"/><child link="wall"/></joint>
</robot>"""


@pytest.fixture
def cut_off(robot: Robot, tmp_path: Path) -> Planner:
    """A wall between home and pick that the arm cannot pass."""
    urdf = tmp_path / "wall.urdf"
    urdf.write_text(robot.urdf.read_text().replace("</robot>", WALL))
    ignores = robot.collision.floor_ignores | {"wall"}
    base, *rest = robot.joints
    stiff = (
        dataclasses.replace(j, lower=max(j.lower, -0.7), upper=min(j.upper, 0.1)) for j in rest
    )
    rules = dataclasses.replace(robot.collision, floor_ignores=ignores)
    return Planner(dataclasses.replace(robot, urdf=urdf, collision=rules, joints=(base, *stiff)))


@pytest.mark.slow
def test_no_path(cut_off: Planner, monkeypatch: pytest.MonkeyPatch) -> None:
    """The message says what was tried."""
    monkeypatch.setattr(rrt_connect, "_FIRST_SAMPLES", 10)
    with pytest.raises(NoPath, match="16 searches with 1360 samples") as caught:
        cut_off.plan(arm(HOME, PICK))
    assert (caught.value.samples, caught.value.searches) == (1360, 16)
    assert min(caught.value.from_start, caught.value.from_goal) >= 16


def test_timeout(cut_off: Planner) -> None:
    with pytest.raises(PlanTimeout, match=r"within 0\.05 s"):
        cut_off.plan(arm(HOME, PICK, timeout=0.05))


def test_time_comes_from_the_clock(robot: Robot) -> None:
    plan = Planner(robot, SimulatedClock()).plan(arm(HOME, PICK, timeout=0.0))
    assert set(plan.milliseconds.values()) == {0.0}


class _Ticking(RealClock):
    """A clock that advances by a second with each reading."""

    looks = 0

    def now(self) -> float:
        """Number of readings."""
        self.looks += 1
        return float(self.looks)


def test_a_weak_supply_limits_the_sum_of_the_accelerations_of_every_motion(robot: Robot) -> None:
    """Of the group that moves, since the other may move at the same time; and after a pause."""
    weak = dataclasses.replace(robot, acceleration_sum=0.5)
    share = sum(j.acceleration for j in robot.actuated_in("arm"))
    most = 0.5 * share / sum(j.acceleration for j in robot.actuated)
    planner = Planner(weak)
    for query in (arm(HOME, PICK), SEARCHED):
        plan = planner.plan(query)
        rest = planner.rest(Rest(plan, time := 0.5 * plan.duration, _at(plan, time)))
        for each in (plan, rest):
            times = np.arange(0.0, each.duration, 0.001)
            assert abs(each.accelerations(times)).sum(axis=1).max() <= most * (1 + 1e-9)
        assert plan.duration > 1.1 * Planner(robot).plan(query).duration


def _at(plan: Plan, time: float) -> tuple[float, ...]:
    start = np.array(plan.start)
    start[: len(plan.joints)] = plan.sample([time])[0]
    return tuple(start.tolist())


def test_the_durations_of_the_stages_add_up(robot: Robot) -> None:
    """Also if a stage runs for each leg. The first reading begins the first stage."""
    clock = _Ticking()
    there_and_back = (SEARCHED.goal, SEARCHED.start[:3])
    plan = Planner(robot, clock).plan(
        dataclasses.replace(SEARCHED, via=there_and_back, timeout=1e9)
    )
    assert {"search", "shorten", "blend"} <= plan.milliseconds.keys()
    assert sum(plan.milliseconds.values()) == 1e3 * (clock.looks - 1)


def digest(plan: Plan) -> str:
    times = np.linspace(0.0, plan.duration, 500)
    parts = (plan.sample(times), plan.waypoints, plan.profile.times)
    return hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()


ELSEWHERE = """
import sys
from tests_planner import SEARCHED, digest, load_robot, Planner
planner = Planner(load_robot())
planner.checker.first_collision([(0.1 * i, 0.0, 0.0, 0.0) for i in range(10)], 0.001)
print(digest(planner.plan(SEARCHED)))
"""


@pytest.mark.slow
def test_same_query_same_bytes_in_another_process(planner: Planner, tmp_path: Path) -> None:
    here = digest(planner.plan(SEARCHED))
    assert digest(planner.plan(SEARCHED)) == here
    assert digest(planner.plan(dataclasses.replace(SEARCHED, seed=2))) != here
    (tmp_path / "tests_planner.py").write_text(Path(__file__).read_text())
    root = str(ROOT)
    there = subprocess.run(
        [sys.executable, "-c", ELSEWHERE],
        env={"PYTHONPATH": f"{tmp_path}:{root}", "PYTHONHASHSEED": "7"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert there.stdout.strip() == here


def test_invalid_limits(robot: Robot) -> None:
    base, *rest = robot.joints
    for odd in (
        dataclasses.replace(base, acceleration=0.0),
        dataclasses.replace(base, velocity=math.nan),
        dataclasses.replace(base, acceleration=math.nan),
        dataclasses.replace(base, acceleration=1e-300),
        dataclasses.replace(base, acceleration=math.inf),
        dataclasses.replace(base, velocity=math.inf),
        dataclasses.replace(base, lower=2.0),
    ):
        with pytest.raises(ModelUnusable, match="joint_1 has limits"):
            Planner(dataclasses.replace(robot, joints=(odd, *rest)))


@pytest.mark.parametrize("odd", [math.nan, math.inf, -2e6, "a", 10**400])
def test_invalid_distances(planner: Planner, robot: Robot, odd: Any) -> None:
    for name in ("margin", "floor"):
        rules = dataclasses.replace(robot.collision, **{name: odd})
        with pytest.raises(ModelUnusable, match=rf"the {name} is .* m; give a number from"):
            Planner(dataclasses.replace(robot, collision=rules))
    with pytest.raises(BadQuery, match=r"The margin is .* m; give a number from 0"):
        planner.verify(Verify([(*HOME, 0.0)], odd))
    if odd in ("a", 10**400):
        with pytest.raises(BadQuery, match=r"The times .* are not all numbers; give seconds"):
            Verify([(*HOME, 0.0)], 0.0, times=[odd])
        with pytest.raises(BadQuery, match=r"The configurations .* are not all numbers"):
            Verify([(odd, 0.0, 0.0, 0.0)], 0.0)


@pytest.mark.parametrize(("velocity", "acceleration"), [(1.0, 1e6), (1.0, 1e300), (1e-2, 1e-2)])
def test_the_check_of_a_bend_is_fast_for_all_limits(
    robot: Robot, velocity: float, acceleration: float
) -> None:
    """The check assumes that no joint exceeds its velocity limit between two samples."""
    joints = tuple(
        dataclasses.replace(joint, velocity=velocity, acceleration=acceleration)
        for joint in robot.joints
    )
    plan = Planner(dataclasses.replace(robot, joints=joints)).plan(DETOUR)
    assert not plan.curve.straight
    assert abs(plan.velocities(np.linspace(0.0, plan.duration, 500))).max() <= 1.001 * velocity


def test_verify_accepts_a_free_motion(planner: Planner) -> None:
    plan = planner.plan(arm(HOME, PICK))
    rows = np.hstack((plan.sample(np.arange(0.0, 3.4, 0.1)), np.zeros((34, 1))))
    assert planner.answer(Verify(rows, 0.002)) is None


def test_verify_checks_between_the_rows(planner: Planner) -> None:
    """Both rows are free, and so is the planned path. The straight line is not."""
    rows = np.array([DETOUR.start, (*DETOUR.goal, 0.0)])
    with pytest.raises(MotionCollides) as caught:
        planner.verify(Verify(rows, 0.005, times=[1.0, 3.0]))
    error = caught.value
    assert error.row == 0
    assert error.time is not None
    assert 1.0 < error.time < 3.0
    assert error.distance < 0.005
    assert {error.first, error.second} & {"base_link", "base_plate"}


@pytest.mark.parametrize(
    ("request_", "error"),
    [
        (Verify([(0.0, 0.0, math.nan, 0.0)], 0.001), NotFinite),
        (Verify([(0.0, 0.0, 0.0)], 0.001), BadQuery),
        (Verify([(0.0,) * 4, (1e15, 0.0, 0.0, 0.0)], 0.001), BadQuery),
        (Verify([(0.0, 0.0, 0.0, -1e300)], 0.001), BadQuery),
        (Verify([(0.0,) * 4, (0.0, 1e6, 0.0, 0.0)], 0.001), MotionCollides),
        (Verify([(0.0,) * 4, (1e6, 0.0, 0.0, 0.0)], 0.001, timeout=0.05), PlanTimeout),
        (Verify(np.empty((0, 4)), 0.001), BadQuery),
        (Verify([(0.0, 0.0, 0.0, 0.0)], -0.001), BadQuery),
        (Verify([(0.0, 0.0, 0.0, 0.0)], 0.001, times=[0.0, 1.0]), BadQuery),
    ],
)
def test_verify_rejects(planner: Planner, request_: Verify, error: type[MotionError]) -> None:
    with pytest.raises(error):
        planner.verify(request_)
    planner.verify(Verify([(0.0, 0.0, 0.0, 0.0)], 0.001))


@pytest.mark.parametrize(("velocity", "acceleration"), [(1e-7, 0.5), (1.0, 1e-7)])
@pytest.mark.parametrize("query", [arm(HOME, PICK), via((-0.7, 0.2, 0.0)), DETOUR])
def test_a_motion_that_would_take_a_year(
    robot: Robot, query: Query, velocity: float, acceleration: float
) -> None:
    base, *others = robot.joints
    slow = dataclasses.replace(base, velocity=velocity, acceleration=acceleration)
    planner = Planner(dataclasses.replace(robot, joints=(slow, *others)))
    why = r"would take .* s; the limit is 600 s. joint_1 moves longest, with at most "
    with pytest.raises(TooLong, match=why) as raised:
        planner.plan(query)
    assert raised.value.value > 600.0 == raised.value.limit
    assert raised.value.milliseconds
    long = Planner(robot).plan(query)
    slowed = dataclasses.replace(long, velocity=1e-7 * long.velocity)
    with pytest.raises(TooLong):
        planner.rest(Rest(slowed, 0.0, query.start))
