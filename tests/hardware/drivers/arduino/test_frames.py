"""The wire format, byte for byte."""

import csv
import dataclasses
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from hardware import BadPosition, Frame, Joint, check_position, load_robot
from hardware.drivers.arduino.frames import Codec, WireField
from tests.support.paths import DATA

ROBOT = load_robot()
CODEC = Codec(ROBOT.actuated)
J1 = ROBOT.joint("joint_1")
HOME = (0.0, 0.0, 0.0, 0.0)
WITHIN = st.tuples(*(st.floats(joint.lower, joint.upper) for joint in ROBOT.actuated))


def golden() -> list[tuple[tuple[float, ...], str]]:
    with (DATA / "golden_frames.csv").open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    return [(tuple(map(float, row[:4])), row[4]) for row in rows]


def in_bounds(positions: tuple[float, ...]) -> bool:
    joints = zip(ROBOT.actuated, positions, strict=True)
    return all(joint.lower <= q <= joint.upper for joint, q in joints)


def test_the_golden_table_is_whole() -> None:
    outside = [i for i, (positions, _) in enumerate(golden(), 1) if not in_bounds(positions)]
    assert len(golden()) == 51
    assert outside == [14, 15, 20, *range(44, 52)]


@pytest.mark.parametrize(("positions", "frame"), golden())
def test_golden_frames(positions: tuple[float, ...], frame: str) -> None:
    if in_bounds(positions):
        assert CODEC.encode(positions).data.decode() == frame
    else:
        with pytest.raises(BadPosition, match="outside its limits"):
            CODEC.encode(positions)


def test_whole_degrees_are_truncated_in_the_published_order() -> None:
    assert str(CODEC.encode((math.radians(30), math.radians(60), 0, 0))) == "b119,s031,e090,g000,"
    published = [int(((math.radians(k) + math.pi / 2) * 180) / math.pi) for k in range(-90, 91)]
    ours = [CODEC.encode((math.radians(k), 0, 0, 0)).servos[0] for k in range(-90, 91)]
    assert ours == published
    assert sum(angle != k for k, angle in enumerate(ours)) == 35


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, True, "0", None, [0.0]])
@pytest.mark.parametrize("place", range(4))
def test_a_value_that_is_not_a_finite_number_is_refused(bad: object, place: int) -> None:
    positions: list[object] = [0.0, 0.0, 0.0, 0.0]
    positions[place] = bad
    with pytest.raises(BadPosition, match=f"joint_{place + 1} = "):
        CODEC.encode(positions)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [np.float32, np.float16, np.int64, Fraction])
def test_every_kind_of_number_travels_as_the_float_it_is(kind: Callable[[float], Any]) -> None:
    position = kind(-1)
    check_position(ROBOT.joint("joint_1"), position)
    assert CODEC.encode((position, 0, 0, 0)) == CODEC.encode((-1.0, 0, 0, 0))


def test_a_whole_number_beyond_all_floats_is_refused() -> None:
    with pytest.raises(BadPosition, match="joint_1 = 1000"):
        CODEC.encode((10**400, 0, 0, 0))


@pytest.mark.parametrize("count", [3, 5])
def test_a_frame_has_one_angle_per_servo(count: int) -> None:
    with pytest.raises(ValueError, match=r"argument 2 is (shorter|longer)"):
        CODEC.frame([90] * count)
    with pytest.raises(ValueError, match=r"argument 2 is (shorter|longer)"):
        CODEC.decode(Frame((90,) * count, b""))


@pytest.mark.parametrize("count", [0, 3, 5])
def test_missing_and_surplus_values_are_refused(count: int) -> None:
    with pytest.raises(BadPosition, match=f"{count} values for 4 joints: joint_1, joint_2"):
        CODEC.encode([0.0] * count)


def test_limits_themselves_are_allowed_and_the_next_float_is_not() -> None:
    joint = ROBOT.joint("joint_1")
    for limit, away in ((joint.lower, -math.inf), (joint.upper, math.inf)):
        check_position(joint, limit)
        with pytest.raises(BadPosition):
            check_position(joint, math.nextafter(limit, away))


@given(WITHIN)
def test_every_frame_is_twenty_bytes_of_angles_from_0_to_180(positions: tuple[float, ...]) -> None:
    frame = CODEC.encode(positions)
    assert len(frame.data) == 20
    assert all(0 <= angle <= 180 for angle in frame.servos)
    assert CODEC.parse(frame.data) == frame


@given(WITHIN, WITHIN)
def test_a_servo_never_turns_against_its_joint(
    low: tuple[float, ...], high: tuple[float, ...]
) -> None:
    before = CODEC.encode([min(pair) for pair in zip(low, high, strict=True)]).servos
    after = CODEC.encode([max(pair) for pair in zip(low, high, strict=True)]).servos
    assert before[0] <= after[0]
    assert before[1] >= after[1]  # the shoulder is reversed
    assert before[2] <= after[2]
    assert before[3] >= after[3]  # and so is the gripper's sign


def test_decoding_hits_the_bin_of_every_servo_angle() -> None:
    for angle in range(181):
        frame = CODEC.frame([angle] * 4)
        assert CODEC.encode(CODEC.decode(frame)) == frame


@pytest.mark.parametrize(
    "data",
    [b"", b"b090,s090,e090,g000", b"b090,s090,e090,g000,\n", b"b90,s090,e090,g000,",
     b"s090,b090,e090,g000,", b"b0x0,s090,e090,g000,", b"b00-1,s090,e090,g000,",
     b"b181,s090,e090,g000,", b"b090,s090,e090,g999,"],
)  # fmt: skip
def test_bytes_that_are_no_frame_are_an_error(data: bytes) -> None:
    with pytest.raises(ValueError, match="is not a frame such as b000,s000,e000,g000,"):
        CODEC.parse(data)


def test_a_robot_of_other_letters_has_frames_of_its_own() -> None:
    def lettered(joint: Joint, letter: str) -> Joint:
        assert isinstance(joint.wire, WireField)
        return dataclasses.replace(joint, wire=dataclasses.replace(joint.wire, letter=letter))

    joints = [lettered(ROBOT.joint("joint_1"), "x"), lettered(ROBOT.joint("joint_4"), "q")]
    codec = Codec(joints)
    assert codec.letters == "xq"
    frame = codec.encode((0.0, -0.7))
    assert str(frame) == "x090,q080,"
    assert codec.parse(b"x090,q080,") == frame
    with pytest.raises(ValueError, match="is not a frame such as x000,q000,"):
        codec.parse(b"b090,g080,")


@pytest.mark.parametrize(
    ("value", "limit"), [(2, J1.upper), (-2.0, J1.lower), (math.nan, None), ("x", None)]
)
def test_a_bad_position_is_an_error_with_its_joint_and_limit(
    value: object, limit: float | None
) -> None:
    with pytest.raises(BadPosition) as caught:
        check_position(J1, value)
    assert (caught.value.joint, caught.value.limit) == ("joint_1", limit)
    assert caught.value.value is value
