"""What our firmware says at boot, and what the arm makes of it."""

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware import (
    FIRMWARES,
    Arm,
    BoardLink,
    Codec,
    SimulatedClock,
    State,
    load_robot,
    virtual_board,
)
from hardware.banner import Banner
from tests.hardware_rigs import motion

ROBOT = dataclasses.replace(load_robot(), firmware=FIRMWARES["armtree"])
CODEC = Codec(ROBOT.actuated)
LINE = b"armtree 1 AVW? kept b009,s125,e085,g000,\n"


@given(st.integers(0, len(LINE)), st.binary(max_size=40))
def test_a_line_in_pieces_after_noise_is_heard(cut: int, noise: bytes) -> None:
    banner = Banner(ROBOT.firmware, CODEC)
    banner.hear(noise + b"\n")
    banner.hear(LINE[:cut])
    banner.hear(LINE[cut:])
    assert banner.frame is not None
    assert str(banner.frame) == "b009,s125,e085,g000,"


@pytest.mark.parametrize("line", [LINE[:-2], LINE.replace(b"g000", b"g0x0"), b"READY\n", b"\n"])
def test_what_is_no_banner_is_none(line: bytes) -> None:
    banner = Banner(ROBOT.firmware, CODEC)
    banner.hear(line)
    assert banner.frame is None


def test_what_never_ends_is_not_kept() -> None:
    banner = Banner(ROBOT.firmware, CODEC)
    for _ in range(1000):
        banner.hear(b"x" * 1000)
    assert len(banner._unfinished) <= 1000


def test_the_arm_begins_where_the_board_says_it_stands() -> None:
    clock = SimulatedClock()
    link = BoardLink(virtual_board(ROBOT), clock)
    with clock.working(), Arm(ROBOT, link, clock) as arm:
        arm.configure()
        arm.activate()
        assert 1.0 < clock.now() < 1.01  # it waits for the boot and the line, and no longer
        assert arm.commanded == ROBOT.boot_pose
        done = clock.signal()
        goal = (-1.4, -0.6, -0.07, 0.0)
        playback = arm.play(
            motion(arm.commanded, goal, 4.0, ROBOT), lambda: None, "test", arm.generation
        )
        with done:
            done.wait(clock.now() + 6.0)
        assert playback.written
        arm.deactivate()
        arm.activate()
        assert arm.state is State.ACTIVE
        assert str(CODEC.encode(arm.commanded)) == "b009,s125,e085,g000,"
        assert link.board.state(clock.now()).servos == (9, 125, 85, 0)


def test_a_silent_board_is_told_and_taken_for_a_reset_one(caplog: pytest.LogCaptureFixture) -> None:
    clock = SimulatedClock()
    stock = dataclasses.replace(ROBOT, firmware=FIRMWARES["stock"])
    link = BoardLink(virtual_board(stock), clock)
    with clock.working(), Arm(ROBOT, link, clock) as arm:
        arm.configure()
        arm.activate()
        assert arm.commanded == ROBOT.boot_pose
    assert "did not say where it stands" in caplog.text
