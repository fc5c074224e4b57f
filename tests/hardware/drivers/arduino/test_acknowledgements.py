"""Acknowledgements of frames."""

import binascii
import dataclasses
import math
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from hardware import load_robot
from hardware.drivers.arduino.acknowledgements import ANSWER_TIMEOUT, Acknowledgements
from hardware.drivers.arduino.firmware_profile import FIRMWARES, ArduinoFirmware
from hardware.drivers.arduino.frames import Codec
from hardware.errors import BoardReset, BoardSilent, FrameLost, WrongFirmware

OURS = FIRMWARES["armtree"]
OTHER = dataclasses.replace(OURS, name="other", banner=b"other 1 ")
CODEC = Codec(load_robot().actuated)
LINE = b"armtree 1 AVW? kept b009,s125,e085,g000,\n"


def ack(frames: int, total: int, refused: int = 0, lost: int = 0) -> bytes:
    return b"k%04x,%02x,%02x,%04x\n" % (frames % 0x10000, refused, lost, total)


def acknowledgements(firmware: ArduinoFirmware = OURS) -> Acknowledgements:
    return Acknowledgements(CODEC, firmware, FIRMWARES.values(), Path("/robot.toml"))


def booted() -> Acknowledgements:
    acks = acknowledgements()
    acks.receive(LINE, 1.0)
    return acks


@given(st.integers(0, len(LINE)), st.binary(max_size=40))
def test_a_banner_in_pieces_after_noise_is_recognised(cut: int, noise: bytes) -> None:
    acks = acknowledgements()
    acks.receive(noise + b"\n", 1.0)
    acks.receive(LINE[:cut], 1.0)
    acks.receive(LINE[cut:], 1.0)
    assert str(acks.boot_frame) == "b009,s125,e085,g000,"
    assert acks.start_commands() == b"bA01;"


@pytest.mark.parametrize("line", [LINE[:-2], LINE.replace(b"g000", b"g0x0"), b"READY\n", b"\n"])
def test_other_lines_are_not_taken_for_a_banner(line: bytes) -> None:
    acks = acknowledgements()
    acks.receive(line, 1.0)
    assert acks.boot_frame is None
    assert acks.start_commands() == b""


@pytest.mark.parametrize("received", [b"", LINE[:-1], LINE.replace(b"g000", b"g0x0")])
def test_a_board_that_did_not_report_that_it_booted_is_an_error(received: bytes) -> None:
    acks = acknowledgements()
    acks.receive(received, 1.0)
    why = (
        "^Within 2.5 s, the board on port /dev/ttyACM0 did not report that it runs the firmware "
        "armtree. Flash the board, or name its firmware in the robot file; opening the port must "
        "reset the board$"
    )
    with pytest.raises(BoardSilent, match=why):
        acks.check_booted("/dev/ttyACM0", 2.5)
    booted().check_booted("/dev/ttyACM0", 2.5)


def test_firmware_without_a_banner_needs_to_report_nothing() -> None:
    acknowledgements(FIRMWARES["stock"]).check_booted("/dev/ttyACM0", 2.5)


def test_a_line_without_an_end_is_not_kept() -> None:
    acks = acknowledgements()
    for _ in range(1000):
        acks.receive(b"x" * 1000, 1.0)
    assert len(acks._unfinished) <= 1000


@given(st.lists(st.tuples(*[st.integers(0, 180)] * 4), max_size=50), st.data())
def test_acknowledgements_count_received_frames(
    frames: list[tuple[int, ...]], data: st.DataObject
) -> None:
    """The board may drop lines; the next one has the newest state."""
    acks, total = booted(), 0
    for number, servos in enumerate(frames, 1):
        acks.note_sent(CODEC.frame(servos), 0.0)
        assert acks.acknowledged != number
        total = binascii.crc_hqx(bytes(servos), total)
        if number == len(frames) or data.draw(st.booleans()):
            acks.receive(ack(number, total), 1.0)
            assert acks.acknowledged == number
    assert acks.next_poll == math.inf


@pytest.mark.slow
def test_the_count_wraps() -> None:
    acks, total = booted(), 0
    for number in range(1, 0x10000 + 3):
        acks.note_sent(CODEC.frame([number % 181, 90, 90, 0]), 0.0)
        total = binascii.crc_hqx(bytes([number % 181, 90, 90, 0]), total)
        acks.receive(ack(number, total), 1.0)
    assert acks.acknowledged == 0x10000 + 2


def test_a_frame_that_was_lost_changed_or_not_sent_is_an_error() -> None:
    first, second = [10, 90, 90, 0], [11, 90, 90, 0]
    lost = booted()
    lost.note_sent(CODEC.frame(first), 0.0)
    lost.note_sent(CODEC.frame(second), 0.0)
    with pytest.raises(FrameLost, match="refused 20 bytes and lost 1"):
        lost.receive(ack(1, binascii.crc_hqx(bytes(second), 0), 20, 1), 1.0)
    changed = booted()
    changed.note_sent(CODEC.frame(first), 0.0)
    with pytest.raises(FrameLost, match="differ from the sent ones"):
        changed.receive(ack(1, binascii.crc_hqx(bytes(second), 0)), 1.0)
    foreign = booted()
    with pytest.raises(FrameLost):
        foreign.receive(ack(1, binascii.crc_hqx(bytes(first), 0)), 1.0)


def test_the_first_line_may_be_an_acknowledgement() -> None:
    acks = acknowledgements()
    acks.note_sent(CODEC.frame([10, 90, 90, 0]), 0.0)
    acks.receive(ack(1, binascii.crc_hqx(bytes([10, 90, 90, 0]), 0)), 1.0)
    assert acks.acknowledged == 1


def watched(acks: Acknowledgements, until: float) -> None:
    """Polls whenever it is due, until a time [s]."""
    while acks.next_poll <= until:
        assert acks.poll(acks.next_poll) == b""


@pytest.mark.parametrize("times", [1, 2])
def test_a_frame_without_an_answer_is_an_error_after_the_timeout(times: int) -> None:
    """The answer to an earlier frame is not an answer to the next one."""
    acks, total = booted(), 0
    for time in range(1, times):
        acks.note_sent(CODEC.frame([10, 90, 90, 0]), time)
        watched(acks, time + ANSWER_TIMEOUT - 0.01)
        total = binascii.crc_hqx(bytes([10, 90, 90, 0]), total)
        acks.receive(ack(time, total), 1.0)
        assert acks.next_poll == math.inf
    acks.note_sent(CODEC.frame([11, 90, 90, 0]), times)
    acks.note_sent(CODEC.frame([12, 90, 90, 0]), times + 0.2)
    watched(acks, times + ANSWER_TIMEOUT - 0.001)
    why = rf"^the board acknowledged {times - 1} of {times + 1} frames, and then nothing for 0.25 s"
    with pytest.raises(FrameLost, match=why + r"\. Check the cable"):
        watched(acks, times + ANSWER_TIMEOUT + 1e-9)


def test_a_board_that_answers_one_of_two_frames_has_its_time_for_the_other() -> None:
    acks = booted()
    acks.note_sent(CODEC.frame([10, 90, 90, 0]), 1.0)
    acks.note_sent(CODEC.frame([11, 90, 90, 0]), 1.2)
    watched(acks, 1.24)
    acks.receive(ack(1, binascii.crc_hqx(bytes([10, 90, 90, 0]), 0)), 1.0)
    watched(acks, 1.24 + ANSWER_TIMEOUT)
    with pytest.raises(FrameLost, match="acknowledged 1 of 2 frames"):
        watched(acks, 1.24 + ANSWER_TIMEOUT + 0.05)


def test_a_repeated_acknowledgement_is_no_answer() -> None:
    acks = booted()
    acks.note_sent(CODEC.frame([10, 90, 90, 0]), 1.0)
    watched(acks, 1.0 + ANSWER_TIMEOUT - 0.01)
    acks.receive(ack(0, 0), 1.0)
    with pytest.raises(FrameLost):
        watched(acks, 1.0 + ANSWER_TIMEOUT + 1e-9)


def test_a_stall_of_the_host_counts_as_one_poll() -> None:
    """Even a long one: the answers of the board are not read yet."""
    acks = booted()
    acks.note_sent(CODEC.frame([10, 90, 90, 0]), 1.0)
    for stall in (10.0, 20.0, 30.0, 40.0):
        acks.poll(stall)
    assert acks.next_poll == pytest.approx(40.0 + ANSWER_TIMEOUT / 5)
    acks.receive(ack(1, binascii.crc_hqx(bytes([10, 90, 90, 0]), 0)), 1.0)
    assert acks.next_poll == math.inf


def test_a_second_start_is_a_reset() -> None:
    with pytest.raises(BoardReset, match=r"it sent 'armtree 1 AVW. kept b009,s125,e085,g000,'"):
        booted().receive(LINE, 1.0)


def test_a_start_after_noise_is_a_reset() -> None:
    with pytest.raises(BoardReset, match="it sent '\ufffdarmtree 1 AVW"):
        booted().receive(b"\xff" + LINE, 1.0)


def test_a_board_without_acknowledgements_counts_as_having_received_everything() -> None:
    acks = acknowledgements(FIRMWARES["stock"])
    acks.receive(LINE[1:] + ack(3, 7), 1.0)
    acks.note_sent(CODEC.frame([10, 90, 90, 0]), 0.0)
    assert (acks.boot_frame, acks.acknowledged, acks.next_poll) == (None, None, math.inf)


@pytest.mark.parametrize("noise", [b"", b"\n", b"xx"])
def test_the_banner_of_another_firmware_is_an_error(noise: bytes) -> None:
    for firmware in (FIRMWARES["stock"], OTHER):
        acks = acknowledgements(firmware)
        acks.receive(noise + LINE[:-1], 1.0)
        why = f"^The board runs armtree, but the robot file names {firmware.name}. Write "
        with pytest.raises(WrongFirmware, match=why + 'firmware = "armtree" under .serial. in /'):
            acks.receive(LINE[-1:], 1.0)


def test_no_poll_is_due_while_every_frame_is_acknowledged() -> None:
    acks = booted()
    assert acks.next_poll == math.inf
    acks.note_sent(CODEC.frame([10, 90, 90, 0]), 1.0)
    acks.note_sent(CODEC.frame([11, 90, 90, 0]), 1.01)
    assert acks.next_poll == pytest.approx(1.0 + ANSWER_TIMEOUT / 5)
    total = binascii.crc_hqx(bytes([10, 90, 90, 0]), 0)
    acks.receive(ack(2, binascii.crc_hqx(bytes([11, 90, 90, 0]), total)), 1.0)
    assert acks.next_poll == math.inf
