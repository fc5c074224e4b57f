"""The write guard: refusals, claims, requests, and commands for torque and faults."""

import dataclasses
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from hardware import BadPosition, CommandSent, Firmware, FrameSent, Joint, NotActive
from hardware.arm.write_guard import Claim
from hardware.drivers.arduino.acknowledgements import ANSWER_TIMEOUT
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.frames import Codec
from hardware.drivers.arduino.serial_servo import SerialServo
from hardware.drivers.board_protocol import BoardProtocol
from hardware.drivers.firmware_profile import Ability
from hardware.drivers.wire_format import Frame
from hardware.errors import (
    ArmClaimed,
    PortLost,
    StaleGeneration,
    TooFast,
    TorqueOff,
)
from tests.support.arms.write_guard_rig import HOME, ROBOT, Rig, degrees


def test_a_frame_is_sent_and_reported() -> None:
    rig = Rig()
    assert rig.write(degrees(10))
    assert rig.events == [FrameSent(2.0, b"b100,s090,e090,g000,", degrees(10), 2.0)]
    assert rig.guard.commanded == degrees(10)
    assert rig.board() == (100, 90, 90, 0)


def test_the_same_bytes_are_not_sent_again_but_count_as_commanded() -> None:
    rig = Rig()
    assert rig.write((1e-4, 0, 0, 0)) is False
    assert rig.guard.commanded == (1e-4, 0, 0, 0)
    assert rig.sent == []


@pytest.mark.parametrize(
    "positions", [(2, 0, 0, 0), (math.nan, 0, 0, 0), (0, 0, 0, 0.1), (0, 0, 0), (True, 0, 0, 0)]
)
def test_a_bad_value_is_refused(positions: tuple[float, ...]) -> None:
    rig = Rig()
    with pytest.raises(BadPosition):
        rig.write(positions)
    assert rig.sent == []
    assert rig.guard.commanded == HOME


class Careless(Codec):
    """A wire format that checks nothing."""

    def encode(self, positions: Sequence[float]) -> Frame:
        return self.frame([90] * len(positions))


class CarelessDriver(SerialServo):
    def wire_format(self, joints: Sequence[Joint], firmware: Firmware) -> Careless:
        return Careless(joints)


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("bad", [math.nan, 2.0, -2.0])
def test_a_bad_position_is_refused_even_if_the_wire_format_accepts_it(
    place: int, bad: float
) -> None:
    rig = Rig(driver=CarelessDriver())
    positions = [0.0, 0.0, 0.0, 0.0]
    positions[place] = bad
    with pytest.raises(BadPosition, match=f"joint_{place + 1} = {math.degrees(bad):.2f}"):
        rig.write(tuple(positions))
    assert rig.guard.commanded == HOME


def test_only_active_may_write() -> None:
    rig = Rig()
    rig.active = False
    for positions in (degrees(1), HOME):
        why = "^the arm is not active; configure and activate it first$"
        with pytest.raises(NotActive, match=why):
            rig.write(positions)
    assert rig.sent == []


def test_only_active_is_greeted() -> None:
    rig = Rig(FIRMWARES["armtree"])
    rig.session.receive(rig.link.read(), rig.clock.now())
    rig.active = False
    with pytest.raises(NotActive):
        rig.guard.send_start_commands()
    assert rig.events == []
    rig.active = True
    rig.guard.send_start_commands()
    assert rig.events == [CommandSent(2.0, b"bA01;")]


def test_a_claim_that_was_given_up_is_refused() -> None:
    rig = Rig()
    for _ in range(2):
        rig.guard.release(rig.claim)
    why = "^this motion was stopped; nothing more is sent for it$"
    with pytest.raises(StaleGeneration, match=why):
        rig.write(degrees(1))
    assert rig.sent == []


def test_a_second_owner_is_an_error_that_names_both() -> None:
    rig = Rig()
    why = "^the arm is claimed by test, so jog cannot command it; stop the arm first$"
    with pytest.raises(ArmClaimed, match=why):
        rig.guard.claim("jog", rig.guard.generation)
    assert rig.write(degrees(1))
    rig.guard.release(rig.claim)
    assert rig.guard.claim("jog", rig.guard.generation) == Claim("jog", 1)


def test_every_end_of_a_claim_counts_one_generation() -> None:
    rig = Rig()
    assert rig.guard.generation == 0
    rig.guard.hold()
    assert rig.guard.generation == 1
    rig.guard.hold()  # a stop without a motion counts too
    assert rig.guard.generation == 2
    claim = rig.claimed()
    assert claim == Claim("test", 2)
    rig.guard.release(claim)
    assert rig.guard.generation == 3
    rig.guard.release(claim)  # has ended already
    assert rig.guard.generation == 3


def test_a_new_claim_never_equals_an_old_one() -> None:
    rig = Rig()
    rig.guard.release(rig.claim)
    new = rig.claimed()
    rig.guard.release(rig.claim)
    with pytest.raises(StaleGeneration):
        rig.write(degrees(1))
    assert rig.guard.write(degrees(1), new, 2.0)


def test_the_session_knows_what_was_sent_and_when() -> None:
    rig = Rig(FIRMWARES["armtree"])
    rig.write(degrees(1))
    assert rig.session.sent == 1
    assert rig.session.next_poll == 2.0 + ANSWER_TIMEOUT / 5


def test_a_motion_decided_on_before_another_one_began_or_ended_is_refused() -> None:
    rig = Rig()
    during = rig.guard.generation
    rig.guard.release(rig.claim)
    why = "^the arm was stopped or moved since this motion was planned$"
    for never in (during, during + 2):
        with pytest.raises(StaleGeneration, match=why):
            rig.guard.claim("test", never)
    rig.guard.claim("test", during + 1)


def test_too_large_a_step_is_refused() -> None:
    rig = Rig()
    with pytest.raises(TooFast, match="turns the servos by 17 degrees in total; the limit is 16"):
        rig.write(degrees(17))
    assert rig.write(degrees(16))


def test_a_frame_before_the_board_has_room_is_refused() -> None:
    rig = Rig()
    assert rig.write(degrees(10))  # moves until 2.073 s
    assert rig.write(degrees(0))  # waits behind it
    busy = 14 * 0.0051 + 4 * 0.00015
    assert rig.guard.earliest == pytest.approx(2.0 + 20 * 10 / 115200 + busy)
    why = "^b100,s090,e090,g000, comes 73.7 ms before the board has room for it$"
    with pytest.raises(TooFast, match=why):
        rig.write(degrees(10))
    rig.wait(math.nextafter(rig.guard.earliest, 0))
    with pytest.raises(TooFast, match=r"comes 0\.0 ms before"):
        rig.write(degrees(10))
    rig.wait(rig.guard.earliest)
    assert rig.write(degrees(10))
    assert rig.link.board.state(100.0).lost == 0


class Asking(BoardProtocol):
    """Asks the board every second, and for the first time at 3 s."""

    next_poll = 3.0

    def poll(self, now: float) -> bytes:
        self.next_poll = now + 1.0
        return b"?"


class AskingAfterFrames(Asking):
    def note_sent(self, frame: Frame, now: float) -> None:
        self.next_poll = now


class Switching(BoardProtocol):
    """Has two commands for the torque, and one that holds. Its line is free at 3 s."""

    free_at = 3.0

    def torque_commands(self, on: bool) -> Sequence[bytes]:
        return {True: [b"on1;", b"on2;"], False: [b"off1;", b"off2;"]}[on]

    def hold_commands(self) -> bytes:
        return b"hold;"


class Holding(Switching):
    def torque_commands(self, on: bool) -> Sequence[bytes]:
        return []


@dataclass(frozen=True)
class DriverOf(SerialServo):
    """A driver whose boards have another protocol."""

    made: Callable[[], BoardProtocol]

    def protocol(  # type: ignore[override]
        self, joints: Sequence[Joint], firmware: Firmware, robot_file: Path
    ) -> BoardProtocol:
        return self.made()


@pytest.mark.parametrize("active", [True, False])
def test_a_request_is_sent_in_any_state_when_it_is_due(active: bool) -> None:
    rig = Rig(driver=DriverOf(Asking))
    rig.active = active
    for time in (2.0, 2.999, 3.0, 3.0, 3.5, 4.5, 5.0, 5.5):
        rig.wait(time)
        rig.guard.poll()
    assert rig.events == [CommandSent(time, b"?", request=True) for time in (3.0, 4.5, 5.5)]
    assert rig.link.written == [b"?"] * 3


def test_no_request_is_sent_by_a_closed_guard() -> None:
    rig = Rig(driver=DriverOf(Asking))
    rig.wait(3.0)
    rig.guard.close()
    rig.guard.poll()
    assert rig.link.written == []


def test_after_a_failed_request_nothing_follows() -> None:
    rig = Rig(driver=DriverOf(Asking))
    rig.wait(3.0)
    rig.link.unplug()
    with pytest.raises(PortLost):
        rig.guard.poll()
    rig.link.open()
    rig.wait(4.0)
    rig.guard.poll()
    with pytest.raises(NotActive):
        rig.write(degrees(1))
    assert rig.events == []


def test_a_request_that_is_due_while_a_frame_goes_out_follows_it() -> None:
    rig = Rig(driver=DriverOf(Asking))
    rig.wait(3.0)
    poll = threading.Thread(target=rig.guard.poll)

    def meanwhile() -> None:
        poll.start()
        poll.join(0.02)

    rig.link.meanwhile = meanwhile
    rig.write(degrees(1))
    poll.join()
    assert rig.link.written == [b"b091,s090,e090,g000,", b"?"]


def test_a_request_that_a_frame_makes_due_goes_out_with_it() -> None:
    rig = Rig(driver=DriverOf(AskingAfterFrames))
    rig.write(degrees(1))
    frame = b"b091,s090,e090,g000,"
    assert rig.link.written == [frame + b"?"]
    assert rig.events == [
        FrameSent(2.0, frame, degrees(1), 2.0),
        CommandSent(2.0, b"?", request=True),
    ]


def test_servos_with_a_switch_for_their_torque_hold_only_after_it_was_switched_on() -> None:
    rig = Rig(dataclasses.replace(ROBOT.firmware, abilities=frozenset({Ability.TORQUE})))
    with pytest.raises(TorqueOff):
        rig.write(degrees(1))
    rig.guard.torque = True
    assert rig.write(degrees(1))


def test_after_the_torque_was_released_no_hold_and_no_frame_is_sent() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.guard.release_torque()
    assert rig.guard.torque is False
    rig.guard.hold()
    rig.claim = rig.claimed()
    with pytest.raises(TorqueOff):
        rig.write(degrees(2))
    assert rig.sent == ["b091,s090,e090,g000,"]


def test_a_torque_command_is_sent_as_soon_as_the_line_is_free() -> None:
    rig = Rig(driver=DriverOf(Switching))
    assert not rig.guard.send_torque_command(b"on1;")
    assert rig.events == []
    rig.wait(3.0)
    assert rig.guard.send_torque_command(b"on1;")
    assert rig.events == [CommandSent(3.0, b"on1;")]


@pytest.mark.parametrize(
    ("protocol", "torque_off", "commands"),
    [
        (Switching, True, b"off1;off2;"),
        (Switching, False, b"hold;"),
        (Holding, True, b"hold;"),
    ],
)
def test_a_fault_releases_the_joints_or_holds_them(
    protocol: type[BoardProtocol], torque_off: bool, commands: bytes
) -> None:
    rig = Rig(driver=DriverOf(protocol))
    rig.guard.close()
    rig.guard.send_fault_commands(torque_off)
    assert rig.link.written == [commands]
    assert rig.events == [CommandSent(2.0, commands)]
