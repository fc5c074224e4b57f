"""Joints as values: what they follow, and which positions they accept."""

import dataclasses
import math

import numpy as np
import pytest

from hardware import BadPosition, Mimic, check_position, load_robot
from hardware.joints import check_positions, joint_words, rounded

ROBOT = load_robot()
CONTINUOUS = dataclasses.replace(ROBOT.joint("joint_1"), lower=-math.inf, upper=math.inf)


def test_a_mimic_joint_follows_by_multiplier_and_offset() -> None:
    assert Mimic("a", -2.0, 0.5).value(1.5) == -2.5


def test_only_a_joint_without_both_limits_that_turns_is_continuous() -> None:
    assert CONTINUOUS.continuous
    assert not dataclasses.replace(CONTINUOUS, upper=1.0).continuous
    assert not dataclasses.replace(CONTINUOUS, lower=-1.0).continuous
    assert not dataclasses.replace(CONTINUOUS, unit="m").continuous
    assert dataclasses.replace(CONTINUOUS, unit="rad").continuous
    assert ROBOT.joint("joint_1").unit == "rad"


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_joint_without_limits_takes_finite_numbers_only(bad: float) -> None:
    check_position(CONTINUOUS, 1e300)
    with pytest.raises(BadPosition, match=f"^joint_1 = {bad} is not a finite number$"):
        check_position(CONTINUOUS, bad)


def test_a_coarse_number_is_not_rounded_into_the_limits() -> None:
    joint = ROBOT.joint("joint_1")
    above = np.float32(joint.upper)
    assert float(above) > joint.upper  # although numpy considers the two equal
    with pytest.raises(BadPosition, match="outside its limits"):
        check_position(joint, above)


def test_a_refusal_names_value_and_limits() -> None:
    why = r"joint_1 = -90.527 deg is outside its limits, -90 deg to 90 deg"
    with pytest.raises(BadPosition, match=why):
        check_position(ROBOT.joint("joint_1"), np.float64(-1.58))


def test_a_value_just_beyond_a_limit_is_named_with_enough_digits() -> None:
    joint = ROBOT.joint("joint_1")
    why = "joint_1 = 90.00000000001 deg is outside its limits, -90 deg to 90 deg"
    with pytest.raises(BadPosition) as caught:
        check_position(joint, math.nextafter(joint.upper, math.inf))
    assert str(caught.value) == why


@pytest.mark.parametrize(
    ("position", "unit", "words"),
    [(math.radians(12.34), "rad", "12.3 deg"), (0.01236, "m", "12.4 mm"),
     (math.radians(-0.04), "rad", "0.0 deg"), (-4e-5, "m", "0.0 mm")],
)  # fmt: skip
def test_a_rounded_position_has_the_unit_of_its_joint_and_no_minus_zero(
    position: float, unit: str, words: str
) -> None:
    assert rounded(position, unit) == words


def test_a_rounded_position_is_in_degrees_unless_it_has_a_unit() -> None:
    assert rounded(math.radians(-90)) == "-90.0 deg"


def test_positions_by_joint_have_the_unit_of_each_joint() -> None:
    positions = {"joint_1": math.radians(70), "slide": 0.01236}
    assert joint_words(positions, {"slide": "m"}) == "joint_1 70.0 deg, slide 12.4 mm"


def test_too_few_or_too_many_positions_are_refused_by_the_names_of_the_joints() -> None:
    joints = ROBOT.actuated[:2]
    assert check_positions(joints, [0, 0.5]) == (0.0, 0.5)
    for positions in ([0.0], [0.0, 0.0, 0.0]):
        why = f"^{len(positions)} values for 2 joints: joint_1, joint_2$"
        with pytest.raises(BadPosition, match=why):
            check_positions(joints, positions)
