"""The model of a servo: backlash, and an object that blocks it."""

import math

import pytest

from hardware.drivers.feetech.registers import STS
from hardware.drivers.feetech.virtual.servo import Servo

DEGREE = 4096 / 360  # [ticks]


def moved(servo: Servo, goal: int, now: float, seconds: float = 2.0) -> float:
    """Moves a servo to a goal in small steps of time, and returns the time at the end."""
    servo.put("torque_enable", 1)
    servo.put("goal_position", goal)
    for step in range(round(seconds / 0.02)):
        servo.advance(now + 0.02 * step)
    return now + seconds


def test_backlash_depends_on_the_side_of_the_load_and_is_not_measured() -> None:
    servo = Servo(STS, 1, 1000)
    time = moved(servo, 2000, 0.0)
    below = servo.output
    time = moved(servo, 3000, time)
    moved(servo, 2000, time)
    assert servo.get("position") == 2000
    assert abs(servo.output - below) == pytest.approx(DEGREE, abs=1.5)


def test_gravity_keeps_the_output_on_one_side() -> None:
    servo = Servo(STS, 1, 2000, gravity=0.2)
    time = 0.0
    for goal in (2100, 1900, 2048):
        time = moved(servo, goal, time)
        assert servo.output - servo.position == pytest.approx(-DEGREE / 2)


def test_an_object_blocks_a_servo_from_one_side_and_overloads_it_if_it_pushes_hard() -> None:
    servo = Servo(STS, 1, 2500)
    servo.stops = 2300, math.inf
    time = moved(servo, 2290, 0.0)
    assert servo.position == 2300
    assert servo.get("load") == pytest.approx(-1000 / 6, abs=1)
    time = moved(servo, 2500, moved(servo, 2295, time))
    assert servo.position == pytest.approx(2500, abs=1)
    moved(servo, 2000, time)
    assert (servo.position, servo.get("status")) == (2300, 0x20)
