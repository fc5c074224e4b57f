"""The session with a board: frames that were sent and received, and requests."""

import binascii
import dataclasses
import math
from pathlib import Path

import pytest

from hardware import Robot, load_robot
from hardware.arm.board_session import BoardSession
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.errors import BoardReset, BoardSilent, FrameLost
from tests.support.arms.bus_arms import bus_arm

ARDUINO = load_robot()
OURS = dataclasses.replace(ARDUINO, firmware=FIRMWARES["armtree"])
BANNER = b"armtree 1 AVW? kept b009,s125,e085,g000,\n"


def after_two_frames(robot: Robot) -> BoardSession:
    session = BoardSession(robot.protocol())
    session.receive(BANNER, 1.0)
    for angle in (90, 91):
        session.note_sent(robot.wire_format.frame([angle, 90, 90, 0]), 1.0)
    return session


def test_a_board_that_acknowledges_has_received_what_it_says() -> None:
    session = after_two_frames(OURS)
    assert (session.sent, session.acknowledged) == (2, 0)
    total = 0
    for count, angle in ((1, 90), (2, 91)):
        assert not session.all_acknowledged()
        total = binascii.crc_hqx(bytes([angle, 90, 90, 0]), total)
        session.receive(b"k%04x,00,00,%04x\n" % (count, total), 1.01)
        assert session.acknowledged == count
    assert session.all_acknowledged()


def test_a_board_that_reports_nothing_counts_as_having_received_every_frame() -> None:
    session = BoardSession(ARDUINO.protocol())
    for sent in (1, 2):
        session.note_sent(ARDUINO.wire_format.frame([90, 90, 90, 0]), 1.0)
        assert (session.sent, session.acknowledged) == (sent, sent)
        assert session.all_acknowledged()


def test_a_board_is_greeted_after_it_booted() -> None:
    session = BoardSession(OURS.protocol())
    with pytest.raises(BoardSilent, match=r"^Within 2 s, the board on port arm0 did not report "):
        session.check_booted("arm0", 2.0)
    assert session.start_commands() == b""
    session.receive(BANNER, 1.0)
    session.check_booted("arm0", 2.0)
    assert str(session.boot_frame) == "b009,s125,e085,g000,"
    assert session.start_commands() == b"bA01;"
    with pytest.raises(BoardReset):
        session.receive(BANNER, 1.0)


def test_only_bytes_that_change_what_a_thread_may_wait_for_are_reported_as_a_change() -> None:
    session = BoardSession(OURS.protocol())
    assert not session.receive(BANNER[:-1], 1.0)
    assert session.receive(BANNER[-1:], 1.0)
    assert not session.receive(b"?", 1.0)


def test_a_request_is_due_no_earlier_than_the_protocol_says(tmp_path: Path) -> None:
    session = BoardSession(load_robot(bus_arm(tmp_path)).protocol())
    assert session.next_poll == session.free_at == -math.inf
    assert session.poll(1.0)
    due = session.next_poll
    assert due == session.free_at > 1.0  # the line is kept free for the answers
    assert session.poll(math.nextafter(due, 0)) == b""
    assert session.next_poll == due
    assert session.poll(due)
    assert session.next_poll > due


def test_commands_of_the_torque_are_those_of_the_protocol(tmp_path: Path) -> None:
    protocol = load_robot(bus_arm(tmp_path)).protocol()
    session = BoardSession(protocol)
    on, off = protocol.torque_commands(True), protocol.torque_commands(False)
    assert on != off
    assert (session.torque_commands(True), session.torque_commands(False)) == (on, off)


def test_after_all_answers_the_next_request_is_due_later_than_they_came(tmp_path: Path) -> None:
    robot = load_robot(bus_arm(tmp_path))
    session, bus = BoardSession(robot.protocol()), robot.model()
    assert bus
    bus.open(0.0)
    for time in (1.0, 3.0, 5.0):  # the two halves of the memory, and the first one again
        assert not session.boot_frame
        bus.receive(session.poll(time - 0.5), time - 0.5)
        session.receive(bus.read_output(time), time)
    assert session.boot_frame
    assert session.free_at < 5.0 < session.next_poll < 6.0


def test_each_poll_is_at_the_time_it_was_called() -> None:
    """A late poll delays the next one, so that a busy host does not use up the board's time."""
    session = after_two_frames(OURS)
    for late in (2.0, 3.0, 4.0, 5.0):
        assert session.poll(late) == b""
        assert late < session.next_poll < late + 1.0
    with pytest.raises(FrameLost):
        session.poll(6.0)


def test_a_late_answer_does_not_keep_the_next_frame_from_the_line(tmp_path: Path) -> None:
    """The streamer has found the line free, and is about to write."""
    robot = load_robot(bus_arm(tmp_path))
    session, bus = BoardSession(robot.protocol()), robot.model()
    assert bus
    bus.open(0.0)
    for time in (1.0, 1.5, 2.0):
        bus.receive(session.poll(time), time)
        session.receive(bus.read_output(time + 0.015), time + 0.015)
    bus.receive(session.poll(3.0), 3.0)
    answers = bus.read_output(3.05)
    assert session.free_at < 3.05
    session.receive(answers[: len(answers) // 2], 3.05)
    assert session.free_at < 3.05
