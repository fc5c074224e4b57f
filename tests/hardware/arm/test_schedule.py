"""Schedules: only changed frames, spaced for the board, and never more than fit its buffer."""

import dataclasses
import math
import random
from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given, settings, strategies as st

from hardware import (
    MAX_DURATION,
    BadPosition,
    Robot,
    Schedule,
    compile_schedule,
    load_robot,
    servo_path,
)
from hardware.arm.schedule import Sampler
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.frames import Codec
from hardware.drivers.arduino.virtual.board import Board
from hardware.errors import ScheduleTooLong, TooFast

STOCK = load_robot()
OURS = dataclasses.replace(STOCK, firmware=FIRMWARES["armtree"])
CODEC = Codec(STOCK.actuated)
HOME = (0.0, 0.0, 0.0, 0.0)
PICK = (-1.4, -0.6, -0.07, -0.7)


def line(start: Sequence[float], goal: Sequence[float], duration: float) -> Sampler:
    """Straight from start to goal at constant speed."""

    def sample(times: Sequence[float]) -> list[list[float]]:
        parts = [min(1.0, time / duration) if duration else 1.0 for time in times]
        return [[a + (b - a) * part for a, b in zip(start, goal, strict=True)] for part in parts]

    return sample


def straight(robot: Robot, goal: Sequence[float], duration: float) -> Schedule:
    return compile_schedule(robot, HOME, line(HOME, goal, duration), duration)


def check(robot: Robot, start: Sequence[float], schedule: Schedule) -> None:
    """Every frame is new, within the step, and waits for the frame before the last."""
    held, firmware = CODEC.encode(start).servos, robot.firmware
    wire, done = 20 * 10 / robot.serial.baud, [-math.inf, -math.inf]
    for setpoint in schedule.setpoints:
        servos = setpoint.frame.servos
        assert CODEC.encode(setpoint.positions) == setpoint.frame
        assert servos != held
        assert sum(abs(b - a) for a, b in zip(held, servos, strict=True)) <= firmware.max_step
        assert setpoint.time >= done[-2]
        begins = max(setpoint.time + wire, done[-1])
        done.append(begins + firmware.service_time(held, servos))
        held = servos
    assert held == CODEC.encode(schedule.end).servos
    if schedule.setpoints:
        assert schedule.duration >= done[-1]


@pytest.mark.parametrize("robot", [STOCK, OURS], ids=["stock", "armtree"])
@pytest.mark.parametrize("duration", [0.05, 1.0, 4.0])
def test_a_straight_motion(robot: Robot, duration: float) -> None:
    schedule = straight(robot, PICK, duration)
    check(robot, HOME, schedule)
    assert schedule.end == PICK
    assert str(schedule.setpoints[-1].frame) == "b009,s125,e085,g080,"


def test_a_slow_motion_keeps_its_grid() -> None:
    schedule = straight(STOCK, (-0.5, 0, 0, 0), 4.0)
    steps = [setpoint.time * STOCK.firmware.rate for setpoint in schedule.setpoints]
    assert steps == pytest.approx([round(step) for step in steps])
    assert max(setpoint.delay for setpoint in schedule.setpoints) == pytest.approx(0.0)
    assert schedule.duration == pytest.approx(4.0)
    assert schedule.slowed == 0.0


def test_equal_frames_are_left_out() -> None:
    schedule = straight(STOCK, (math.radians(2.5), 0, 0, 0), 3.0)
    assert [str(setpoint.frame)[:4] for setpoint in schedule.setpoints] == ["b091", "b092"]


def test_a_fast_motion_is_slowed_and_the_schedule_has_the_delay() -> None:
    schedule = straight(STOCK, PICK, 0.1)
    check(STOCK, HOME, schedule)
    assert schedule.slowed == pytest.approx(schedule.duration - 0.1)
    assert schedule.slowed > 0.5
    delays = [setpoint.delay for setpoint in schedule.setpoints]
    assert delays == sorted(delays)  # the delay only grows
    assert delays[0] == 0.0
    last = schedule.setpoints[-1]
    assert last.time - last.delay == pytest.approx(0.1 * (1 - 1 / len(schedule.setpoints)))


@pytest.mark.parametrize("duration", [0.0, 3.0])
def test_a_motion_to_the_present_pose_has_no_frames(duration: float) -> None:
    goal = (1e-4, 0.0, 0.0, -1e-4)  # encodes to the frame of the present pose
    schedule = compile_schedule(STOCK, HOME, line(HOME, goal, duration), duration)
    assert schedule.setpoints == ()
    assert schedule.duration == schedule.slowed == 0.0


def test_a_motion_of_no_duration_has_no_frames() -> None:
    assert straight(STOCK, PICK, 0.0) == Schedule((), HOME, 0.0, 0.0)


def test_a_sample_outside_the_limits_is_refused() -> None:
    with pytest.raises(BadPosition, match="joint_4"):
        straight(STOCK, (0, 0, 0, 0.1), 1.0)
    with pytest.raises(BadPosition, match="not a finite number"):
        straight(STOCK, (math.nan, 0, 0, 0), 1.0)


@pytest.mark.parametrize("robot", [STOCK, OURS], ids=["stock", "armtree"])
@pytest.mark.parametrize(
    ("jump", "between"),
    [(0.0, "0.000 and 0.020"), (0.51, "0.500 and 0.520"), (0.99, "0.980 and 1.")],
)
def test_a_motion_that_jumps_is_refused(robot: Robot, jump: float, between: str) -> None:
    """At the first jump, even from the present pose."""

    def sample(times: Sequence[float]) -> list[tuple[float, ...]]:
        return [PICK if time >= jump else HOME for time in times]

    robot = dataclasses.replace(robot, firmware=dataclasses.replace(robot.firmware, rate=50.0))
    why = f"^the motion jumps between {between}.* by more than 16 degrees in total within 1 ms"
    with pytest.raises(TooFast, match=why) as raised:
        compile_schedule(robot, HOME, sample, 1.0)
    assert raised.value.code == "hw.too_fast"


@pytest.mark.slow
def test_a_motion_of_a_year_is_refused_before_it_is_sampled() -> None:
    sampled = []

    def sample(times: Sequence[float]) -> list[tuple[float, ...]]:
        sampled.append(len(times))
        return [HOME for _ in times]

    year = 365 * 86_400.0
    for duration in (year, math.inf, math.nan, math.nextafter(MAX_DURATION, math.inf)):
        with pytest.raises(ScheduleTooLong, match=r"would take .* s; the limit is 600 s") as raised:
            compile_schedule(OURS, HOME, sample, duration)
        assert (raised.value.code, raised.value.limit) == ("hw.too_long", 600.0)
    assert not sampled
    compile_schedule(OURS, HOME, sample, MAX_DURATION)


def test_the_same_motion_gives_the_same_schedule() -> None:
    assert straight(STOCK, PICK, 1.7) == straight(STOCK, PICK, 1.7)


def test_a_stock_board_passes_every_corner() -> None:
    schedule = straight(STOCK, (-0.05, 0.05, 0, 0), 0.1)
    assert [str(setpoint.frame) for setpoint in schedule.setpoints] == ["b087,s088,e090,g000,"]
    corners = [CODEC.encode(row).servos for row in servo_path(STOCK, HOME, schedule)[1]]
    assert corners == [(90, 90, 90, 0), (87, 90, 90, 0), (87, 88, 90, 0)]
    ends = [CODEC.encode(row).servos for row in servo_path(OURS, HOME, schedule)[1]]
    assert ends == [(90, 90, 90, 0), (87, 88, 90, 0)]


# How long after a stop the board may still turn [s]; ARCHITECTURE.md promises it.
STOP_TIME = {"stock": 0.25, "armtree": 0.05}


def wander(seed: int, speed: float) -> tuple[tuple[float, ...], Sampler, float]:
    """A motion through random places, each joint at no more than `speed` [rad/s]."""
    draw = random.Random(seed)
    places = [
        tuple(draw.uniform(joint.lower, joint.upper) for joint in STOCK.actuated)
        for _ in range(draw.randint(2, 4))
    ]
    times = [0.0]
    for a, b in pairwise(places):
        farthest = max(abs(q - p) for p, q in zip(a, b, strict=True))
        times.append(times[-1] + farthest / speed)

    def sample(at: Sequence[float]) -> list[list[float]]:
        rows = []
        for time in at:
            leg = max(k for k in range(len(times) - 1) if times[k] <= time)
            part = min(1.0, (time - times[leg]) / (times[leg + 1] - times[leg]))
            ends = zip(places[leg], places[leg + 1], strict=True)
            rows.append([a + (b - a) * part for a, b in ends])
        return rows

    return places[0], sample, times[-1]


def replay(robot: Robot, start: Sequence[float], schedule: Schedule, stop: float) -> Board:
    """Plays a schedule to the board, with a hold at a part of it; returns the board, settled."""
    boot = CODEC.encode(start).servos
    firmware = dataclasses.replace(robot.firmware, boot_time=0.0)
    board = Board(CODEC.letters, boot, firmware, robot.serial.baud)
    count = math.ceil(stop * len(schedule.setpoints))
    for setpoint in schedule.setpoints[:count]:
        board.receive(setpoint.frame.data, setpoint.time)
    if 0 < count < len(schedule.setpoints):
        last, after = schedule.setpoints[count - 1], schedule.setpoints[count]
        draw = random.Random(count)
        board.receive(last.frame.data, draw.uniform(last.time, after.time))
    board.advance(schedule.duration + 100)
    return board


@pytest.mark.slow
@settings(max_examples=120, deadline=None)
@given(
    st.sampled_from([STOCK, OURS]),
    st.integers(0, 2**32),
    st.sampled_from([0.3, 1.0, 3.0, 10.0]),
    st.floats(0, 1),
)
def test_no_motion_and_no_stop_overruns_the_board(
    robot: Robot, seed: int, speed: float, stop: float
) -> None:
    start, sample, duration = wander(seed, speed)
    schedule = compile_schedule(robot, start, sample, duration)
    check(robot, start, schedule)
    for part in (stop, 1.0):
        board = replay(robot, start, schedule, part)
        state = board.state(schedule.duration + 200)
        count = math.ceil(part * len(schedule.setpoints))
        held = schedule.setpoints[count - 1].frame if count else CODEC.encode(start)
        assert state.lost == state.refused == 0
        assert state.servos == held.servos


@pytest.mark.slow
@settings(max_examples=120, deadline=None)
@given(
    st.sampled_from([STOCK, OURS]),
    st.integers(0, 2**32),
    st.sampled_from([0.3, 1.0, 3.0, 10.0]),
    st.floats(0, 1),
)
def test_after_a_stop_the_board_turns_no_more_than_two_frames(
    robot: Robot, seed: int, speed: float, part: float
) -> None:
    """One frame may be executing and one may wait behind it."""
    start, sample, duration = wander(seed, speed)
    schedule = compile_schedule(robot, start, sample, duration)
    if not schedule.setpoints:
        return
    firmware = dataclasses.replace(robot.firmware, boot_time=0.0)
    board = Board(CODEC.letters, CODEC.encode(start).servos, firmware, robot.serial.baud)
    stop = part * schedule.duration
    sent = [setpoint for setpoint in schedule.setpoints if setpoint.time <= stop]
    for setpoint in sent:
        board.receive(setpoint.frame.data, setpoint.time)
    if sent:
        board.receive(sent[-1].frame.data, stop)
    before = board.state(stop).servos
    soon = board.state(stop + STOP_TIME[firmware.name]).servos
    travel = sum(abs(b - a) for a, b in zip(before, soon, strict=True))
    assert travel <= 2 * firmware.max_step
    assert board.state(stop + 10).servos == soon
