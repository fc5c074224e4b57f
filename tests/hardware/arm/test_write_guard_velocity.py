"""The write guard keeps the velocity limits of joints, whatever a schedule says."""

import dataclasses
import math
from collections.abc import Sequence

import pytest
from hypothesis import assume, given, settings, strategies as st

from hardware import Robot, Schedule, compile_schedule
from hardware.drivers.arduino.firmware_profile import ARMTREE, STOCK
from hardware.drivers.firmware_profile import Firmware
from hardware.errors import JointTooFast, TooFast
from tests.support.arms.write_guard_rig import HOME, ROBOT, Rig

LIMIT = 1.0  # [rad/s]
POSES = st.tuples(*[st.floats(-1.5, 1.5)] * 3, st.floats(-1.5, 0.0))
FIRMWARES = st.sampled_from([STOCK, ARMTREE])


def schedule(rig: Rig, start: Sequence[float], goal: Sequence[float], speed: float) -> Schedule:
    """A motion whose fastest joint has this speed from its beginning to its end [rad/s]."""
    duration = max(abs(b - a) for a, b in zip(start, goal, strict=True)) / speed

    def sample(times: Sequence[float]) -> list[list[float]]:
        parts = [time / duration for time in times]
        return [[a + (b - a) * part for a, b in zip(start, goal, strict=True)] for part in parts]

    return compile_schedule(rig.robot, start, sample, duration)


def play(rig: Rig, motion: Schedule, lateness: st.DataObject | None = None) -> None:
    """Write a schedule as the streamer does; frames are up to two periods late."""
    period = 1 / rig.robot.firmware.rate
    origin = rig.clock.now()
    for setpoint in motion.setpoints:
        rig.wait(max(origin + setpoint.time, rig.guard.earliest))
        late = rig.clock.now() - origin - setpoint.time
        if late > period:
            origin += late
        if lateness:
            rig.wait(rig.clock.now() + period * lateness.draw(st.sampled_from([0, 0, 0.5, 1, 2])))
        rig.write(setpoint.positions)
    rig.write(motion.end)
    rig.wait(origin + motion.duration)


@pytest.mark.slow
@settings(max_examples=30)
@given(FIRMWARES, st.lists(POSES, min_size=1, max_size=3), st.data())
def test_every_motion_within_the_limits_is_sent_even_if_frames_are_late(
    firmware: Firmware, poses: list[tuple[float, ...]], data: st.DataObject
) -> None:
    rig, sent = Rig(firmware, velocity=LIMIT), 0
    start: tuple[float, ...] = HOME
    for goal in poses:
        assume(goal != start)
        motion = schedule(rig, start, goal, LIMIT)
        play(rig, motion, data)
        sent, start = sent + len(motion.setpoints), goal
        assert len(rig.sent) == sent


@pytest.mark.parametrize("firmware", [STOCK, ARMTREE])
@pytest.mark.parametrize("velocity", [0.3, 0.1, 0.02])
def test_a_slow_joint_may_need_many_periods_for_one_degree(
    firmware: Firmware, velocity: float
) -> None:
    rig, goals = Rig(firmware, velocity=velocity), [(0.2, -0.1, 0.05, 0.0), (0.0, 0.1, 0.0, -0.1)]
    for start, goal in zip([HOME, *goals], goals, strict=False):
        play(rig, schedule(rig, start, goal, velocity))
    assert rig.guard.commanded == goals[-1]
    assert len(rig.sent) > 10


def test_steps_that_change_no_frame_count_for_the_velocity() -> None:
    """Each pair moves the joint by a degree: nearly all of it in the step that is not sent."""
    velocity, degree = 0.1, math.radians(1)
    rig = Rig(ARMTREE, velocity=velocity)
    began = rig.clock.now()

    def move() -> None:
        for number in range(1, 30):
            rig.wait(rig.guard.earliest)
            for position in (number - 0.01, number + 0.01):
                rig.write((position * degree, 0.0, 0.0, 0.0))

    with pytest.raises(JointTooFast) as refused:
        move()
    assert refused.value.value > velocity
    periods = rig.clock.now() - began + 3 / ARMTREE.rate
    assert rig.guard.commanded[0] <= 1.01 * velocity * periods + 2 * degree


def with_limits(lower: float, upper: float) -> Robot:
    """The robot with other limits of joint_1 [rad]."""
    first, *others = ROBOT.joints
    return dataclasses.replace(
        ROBOT, joints=(dataclasses.replace(first, lower=lower, upper=upper), *others)
    )


@pytest.mark.parametrize(
    ("lower", "upper", "unit"),
    [(-math.pi / 2, math.pi / 2, math.radians(1)), (-math.inf, math.inf, 1 / 57)],
    ids=["limited", "continuous"],
)
def test_a_resting_joint_may_step_by_one_servo_unit_and_three_periods(
    lower: float, upper: float, unit: float
) -> None:
    velocity = 0.1
    rig = Rig(ARMTREE, velocity=velocity, robot=with_limits(lower, upper))
    most = unit + 3 * 1.01 * velocity / ARMTREE.rate
    with pytest.raises(JointTooFast):
        rig.write((1.001 * most, 0.0, 0.0, 0.0))
    assert rig.write((0.999 * most, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("degrees", [0.5, 1.9])
def test_a_joint_with_a_range_below_two_servo_units_moves_to_its_end(degrees: float) -> None:
    upper = math.radians(degrees)
    rig = Rig(ARMTREE, velocity=0.01, robot=with_limits(0.0, upper))
    rig.write((upper, 0.0, 0.0, 0.0))
    assert rig.guard.commanded[0] == upper


@settings(max_examples=50)
@given(POSES, st.floats(1.5, 20.0))
def test_a_motion_beyond_a_limit_is_refused(goal: tuple[float, ...], factor: float) -> None:
    rig = Rig(ARMTREE, velocity=LIMIT)
    assume(max(map(abs, goal)) > 8 * factor * LIMIT / ARMTREE.rate)
    motion = schedule(rig, HOME, goal, factor * LIMIT)
    assume(motion.slowed < 0.01)  # the board does not slow it down
    with pytest.raises((JointTooFast, TooFast)) as refused:
        play(rig, motion)
    if isinstance(refused.value, JointTooFast):
        assert refused.value.value > LIMIT
    travel = max(abs(q) for q in rig.guard.commanded)
    periods = rig.clock.now() - 2.0 + 3 / ARMTREE.rate
    assert travel <= 1.01 * LIMIT * periods + math.radians(1)


def test_the_refusal_names_joint_velocity_and_limit_in_degrees() -> None:
    rig = Rig(ARMTREE, velocity=LIMIT)
    start = (0.0, -0.04, 0.0, 0.0)
    rig.write(start)
    rig.wait(rig.clock.now() + 1.0)
    why = r"^joint_2 would move at 286\.5 deg/s; its limit is 57\.3 deg/s$"
    with pytest.raises(JointTooFast, match=why) as refused:
        rig.write((0.05, -0.14, 0.0, 0.0))
    error = refused.value
    assert (error.joint, error.limit) == ("joint_2", LIMIT)
    assert error.value == pytest.approx(5.0)
    assert len(rig.sent) == 1
    assert rig.guard.commanded == start


def test_positions_that_come_all_at_once_are_refused_when_the_joint_is_too_far_behind() -> None:
    rig = Rig(ARMTREE, velocity=LIMIT)
    step = LIMIT / ARMTREE.rate
    for number in range(1, 4):
        rig.wait(rig.guard.earliest)
        rig.write((number * step, 0.0, 0.0, 0.0))
    began = rig.clock.now()
    with pytest.raises(JointTooFast, match=r"joint_1 would move at \d+\.?\d* deg/s"):
        rig.write((5 * step, 0.0, 0.0, 0.0))
    rig.wait(began + 1 / ARMTREE.rate)
    rig.write((4 * step, 0.0, 0.0, 0.0))
    assert rig.guard.commanded[0] == pytest.approx(math.radians(4 * math.degrees(step)))
