"""The one door to the wire: what it refuses, and that a hold goes out exactly once."""

import contextlib
import dataclasses
import math
import threading
from collections.abc import Callable, Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware import (
    FIRMWARES,
    ArmEvent,
    BadPosition,
    Board,
    BoardLink,
    Codec,
    CommandSent,
    Firmware,
    FrameLost,
    FrameSent,
    InterfaceClaimed,
    InterfaceUnknown,
    Joint,
    NotActive,
    PortLost,
    SimulatedClock,
    StaleGeneration,
    TooFast,
    WriteRefused,
    load_robot,
    virtual_board,
)
from hardware.dialogue import ANSWER, Dialogue
from hardware.door import Door
from hardware.driver import Driver
from hardware.events import Observer
from hardware.frames import Frame
from hardware.interfaces import Claim
from hardware.serial_servo import SerialServo

ROBOT = load_robot()
HOME = (0.0, 0.0, 0.0, 0.0)


def degrees(*base: float) -> tuple[float, ...]:
    """Positions in the middle of a servo's degree, so many from home."""
    return (math.radians(base[0] + 0.5), 0.0, 0.0, 0.0)


class Slow(BoardLink):
    """A line on which something may happen before the bytes go."""

    def __init__(self, board: Board, clock: SimulatedClock) -> None:
        super().__init__(board, clock)
        self.written: list[bytes] = []
        self.meanwhile: Callable[[], None] = lambda: None

    def write(self, data: bytes) -> None:
        meanwhile, self.meanwhile = self.meanwhile, lambda: None
        meanwhile()
        super().write(data)
        self.written.append(data)


class Rig:
    """A door in front of an in-process board that has booted."""

    def __init__(self, firmware: Firmware = ROBOT.firmware, driver: Driver = ROBOT.driver) -> None:
        self.robot = dataclasses.replace(ROBOT, firmware=firmware, driver=driver)
        self.clock = SimulatedClock()
        self.link = Slow(virtual_board(self.robot), self.clock)
        self.link.open()
        self.active = True
        self.then: Observer = lambda _: None
        self.events: list[ArmEvent] = []
        self.wait(2.0)
        self.dialogue = Dialogue(self.robot)
        self.door = Door(
            self.robot,
            self.link,
            self.clock,
            lambda: self.active,
            self.tell,
            self.dialogue,
            self.robot.boot_pose,
        )
        self.claim = self.claimed()

    def tell(self, event: ArmEvent) -> None:
        self.events.append(event)
        self.then(event)

    def wait(self, until: float) -> None:
        with (signal := self.clock.signal()):
            while self.clock.now() < until:
                signal.wait(until)

    def claimed(self) -> Claim:
        return self.door.claim("test", self.door.interfaces, self.door.generation)

    def write(self, positions: tuple[float, ...]) -> bool:
        return self.door.write(positions, self.claim, self.clock.now())

    @property
    def sent(self) -> list[str]:
        return [event.data.decode() for event in self.events if isinstance(event, FrameSent)]

    def board(self) -> tuple[float, ...]:
        self.wait(self.clock.now() + 10)
        return self.link.board.state(self.clock.now()).servos


def test_a_frame_goes_out_and_is_told() -> None:
    rig = Rig()
    assert rig.write(degrees(10))
    assert rig.events == [FrameSent(2.0, b"b100,s090,e090,g000,", degrees(10), 2.0)]
    assert rig.door.commanded == degrees(10)
    assert rig.board() == (100, 90, 90, 0)


def test_the_same_bytes_are_not_sent_again_but_count_as_commanded() -> None:
    rig = Rig()
    assert rig.write((1e-4, 0, 0, 0)) is False
    assert rig.door.commanded == (1e-4, 0, 0, 0)
    assert rig.sent == []


@pytest.mark.parametrize(
    "positions", [(2, 0, 0, 0), (math.nan, 0, 0, 0), (0, 0, 0, 0.1), (0, 0, 0), (True, 0, 0, 0)]
)
def test_a_bad_value_is_refused(positions: tuple[float, ...]) -> None:
    rig = Rig()
    with pytest.raises(BadPosition):
        rig.write(positions)
    assert rig.sent == []
    assert rig.door.commanded == HOME


class Careless(Codec):
    """A wire format that checks nothing."""

    def encode(self, positions: Sequence[float]) -> Frame:
        return self.frame([90] * len(positions))


class CarelessDriver(SerialServo):
    def wire_format(self, joints: Sequence[Joint]) -> Careless:
        return Careless(joints)


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("bad", [math.nan, 2.0, -2.0])
def test_a_bad_value_is_refused_even_where_the_wire_format_takes_it(place: int, bad: float) -> None:
    rig = Rig(driver=CarelessDriver())
    positions = [0.0, 0.0, 0.0, 0.0]
    positions[place] = bad
    with pytest.raises(BadPosition, match=f"joint_{place + 1} = {bad} "):
        rig.write(tuple(positions))
    assert rig.door.commanded == HOME


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
    rig.dialogue.hear(rig.link.read())
    rig.active = False
    with pytest.raises(NotActive):
        rig.door.greet()
    assert rig.events == []
    rig.active = True
    rig.door.greet()
    assert rig.events == [CommandSent(2.0, b"bA01;")]


def test_a_claim_that_was_given_up_is_refused() -> None:
    rig = Rig()
    for _ in range(2):
        rig.door.give_up(rig.claim)
    with pytest.raises(StaleGeneration):
        rig.write(degrees(1))
    assert rig.sent == []


def test_two_owners_of_one_joint_are_an_error_that_names_both() -> None:
    rig = Rig()
    why = "joint_1/position is claimed by test, so jog cannot command it; stop the arm first"
    with pytest.raises(InterfaceClaimed, match=why):
        rig.door.claim("jog", ["joint_1/position"], rig.door.generation)
    assert rig.write(degrees(1))
    rig.door.give_up(rig.claim)
    rig.door.claim("jog", ["joint_1/position"], rig.door.generation)


def test_a_joint_that_has_no_servo_cannot_be_claimed() -> None:
    rig = Rig()
    with pytest.raises(InterfaceUnknown, match="no command interface joint_5/position; there are"):
        rig.door.claim("jog", ["joint_5/position"], rig.door.generation)


def test_who_claims_one_joint_moves_that_one() -> None:
    rig = Rig()
    rig.write(degrees(10))
    rig.door.give_up(rig.claim)
    jog = rig.door.claim("jog", ["joint_2/position"], rig.door.generation)
    other = rig.door.claim("other", ["joint_4/position"], rig.door.generation)
    assert rig.door.write([math.radians(-4.5)], jog, 2.0)
    with pytest.raises(BadPosition, match="2 values for 1: joint_2/position"):
        rig.door.write([0.0, 0.0], jog, 2.0)
    rig.wait(rig.door.earliest)
    assert rig.door.write([-0.1], other, 2.0)
    assert rig.sent[1:] == ["b100,s095,e090,g000,", "b100,s095,e090,g011,"]
    rig.door.hold()
    for claim in (jog, other):
        with pytest.raises(StaleGeneration):
            rig.door.write([0.0], claim, 2.0)


def test_a_claim_takes_one_value_per_interface() -> None:
    rig = Rig()
    rig.door.give_up(rig.claim)
    jog = rig.door.claim("jog", rig.door.interfaces[:2], rig.door.generation)
    why = "^3 values for 2: joint_1/position, joint_2/position$"
    with pytest.raises(BadPosition, match=why):
        rig.door.write([0.0, 0.0, 0.0], jog, 2.0)


def test_the_dialogue_is_told_what_went_out_and_when() -> None:
    rig = Rig(FIRMWARES["armtree"])
    rig.write(degrees(1))
    assert rig.dialogue.sent == 1
    rig.dialogue.check(math.nextafter(2.0 + ANSWER, 0))
    with pytest.raises(FrameLost):
        rig.dialogue.check(2.0 + ANSWER)


def test_a_motion_decided_on_before_another_one_began_or_ended_is_refused() -> None:
    rig = Rig()
    during = rig.door.generation
    rig.door.give_up(rig.claim)
    with pytest.raises(StaleGeneration):
        rig.door.claim("test", rig.door.interfaces, during)


def test_too_large_a_step_is_refused() -> None:
    rig = Rig()
    with pytest.raises(TooFast, match="turns the servos by 17 degrees in sum; the most is 16"):
        rig.write(degrees(17))
    assert rig.write(degrees(16))


def test_a_frame_before_the_board_has_room_is_refused() -> None:
    rig = Rig()
    assert rig.write(degrees(10))  # moves until 2.073 s
    assert rig.write(degrees(0))  # waits behind it
    busy = 14 * 0.0051 + 4 * 0.00015
    assert rig.door.earliest == pytest.approx(2.0 + 20 * 10 / 115200 + busy)
    why = "^b100,s090,e090,g000, comes 73.7 ms before the board has room for it$"
    with pytest.raises(TooFast, match=why):
        rig.write(degrees(10))
    rig.wait(math.nextafter(rig.door.earliest, 0))
    with pytest.raises(TooFast, match=r"comes 0\.0 ms before"):
        rig.write(degrees(10))
    rig.wait(rig.door.earliest)
    assert rig.write(degrees(10))
    assert rig.link.board.state(100.0).lost == 0


def test_a_hold_repeats_the_last_frame_exactly_once() -> None:
    rig = Rig()
    rig.write(degrees(1))
    for _ in range(3):
        rig.door.hold()
    assert rig.sent == ["b091,s090,e090,g000,"] * 2
    assert isinstance(rig.events[-1], FrameSent)
    assert rig.events[-1].scheduled is None


def test_after_a_hold_the_old_motion_is_over_and_a_new_one_may_begin() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.door.hold()
    with pytest.raises(StaleGeneration):
        rig.write(degrees(2))
    rig.claim = rig.claimed()
    rig.wait(rig.door.earliest)
    rig.write(degrees(2))
    rig.door.hold()
    assert len(rig.sent) == 4


def test_a_hold_writes_nothing_where_no_frame_has_left() -> None:
    rig = Rig()
    rig.write(HOME)
    rig.door.hold()
    assert rig.sent == []


def test_a_hold_writes_nothing_where_the_arm_is_not_active() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.active = False
    with pytest.raises(NotActive):
        rig.door.hold()
    assert len(rig.sent) == 1


def test_a_hold_finds_room_while_two_frames_are_under_way() -> None:
    rig = Rig()
    rig.write(degrees(16))
    rig.write(degrees(0))
    rig.door.hold()
    assert rig.board() == (90, 90, 90, 0)
    assert rig.link.board.state(100.0).lost == 0


def test_after_a_failed_write_nothing_follows() -> None:
    """What the board got is unknown, so not even a hold may go out."""
    rig = Rig()
    rig.write(degrees(1))
    rig.link.unplug()
    with pytest.raises(PortLost):
        rig.write(degrees(2))
    rig.link.open()  # as if it came back
    for _ in range(2):
        with pytest.raises(NotActive):
            rig.write(degrees(3))
        with pytest.raises(NotActive):
            rig.door.hold()
    assert rig.sent == ["b091,s090,e090,g000,"]
    assert rig.door.commanded == degrees(1)


def test_a_failed_hold_is_not_repeated() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.link.unplug()
    with pytest.raises(PortLost):
        rig.door.hold()
    rig.link.open()
    rig.door.hold()
    assert len(rig.sent) == 1


def test_a_closed_door_stays_closed() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.door.close()
    rig.door.close()
    with pytest.raises(NotActive):
        rig.write(degrees(2))
    with pytest.raises(NotActive):
        rig.door.hold()
    assert len(rig.sent) == 1


def test_who_is_told_of_a_frame_may_hold_at_once() -> None:
    rig = Rig()
    rig.then = lambda _: rig.door.hold()
    told = threading.Thread(target=lambda: rig.write(degrees(1)), daemon=True)
    told.start()
    told.join(5)
    assert not told.is_alive()
    assert len(rig.events) == 2


@pytest.mark.parametrize(
    "act",
    [Rig.claimed, lambda rig: rig.door.give_up(rig.claim), lambda rig: rig.door.greet(),
     lambda rig: rig.door.close(), lambda rig: rig.door.hold(), lambda rig: rig.write(degrees(1))],
    ids=["claim", "give up", "greet", "close", "hold", "write"],
)  # fmt: skip
def test_while_a_frame_goes_out_everybody_else_waits(act: Callable[[Rig], object]) -> None:
    rig = Rig()
    began: list[threading.Thread] = []
    finished: list[bool] = []

    def other() -> None:
        with contextlib.suppress(WriteRefused):
            act(rig)

    def meanwhile() -> None:
        began.append(threading.Thread(target=other))
        began[0].start()
        began[0].join(0.02)
        finished.append(not began[0].is_alive())

    rig.link.meanwhile = meanwhile
    rig.write(degrees(1))
    began[0].join()
    assert finished == [False]


def test_the_time_that_a_write_waits_is_the_boards_too() -> None:
    rig = Rig()
    rig.link.meanwhile = lambda: rig.wait(2.15)
    rig.write(degrees(16))
    rig.write(degrees(0))
    busy = 20 * 0.0051 + 4 * 0.00015
    assert rig.door.earliest == pytest.approx(2.15 + 20 * 10 / 115200 + busy)


@given(st.lists(st.tuples(st.integers(-4, 4), st.floats(0.0, 0.19), st.floats(0.0, 0.2))))
def test_slow_writes_overrun_no_board(frames: list[tuple[int, float, float]]) -> None:
    """Each frame is written as early as it may, and its write waits before it goes through."""
    rig, angle = Rig(), 0
    for step, waits, pause in frames:
        rig.wait(max(rig.clock.now() + pause, rig.door.earliest))
        until = rig.clock.now() + waits
        rig.link.meanwhile = lambda until=until: rig.wait(until)  # type: ignore[misc]
        angle += 4 * step
        if abs(angle) < 80:
            rig.write(degrees(angle))
        else:
            angle -= 4 * step
    rig.door.hold()
    rig.board()
    assert rig.link.board.state(rig.clock.now()).lost == 0


@pytest.mark.parametrize("act", [Rig.write, lambda rig, _: rig.door.greet()])
def test_after_whatever_a_driver_raises_nothing_follows(
    act: Callable[[Rig, tuple[float, ...]], object],
) -> None:
    rig = Rig(FIRMWARES["armtree"])
    rig.dialogue.hear(rig.link.read())
    rig.write(degrees(1))

    def fail() -> None:
        raise OSError("a driver that is not ours")

    rig.link.meanwhile = fail
    with pytest.raises(OSError, match="not ours"):
        act(rig, degrees(2))
    with pytest.raises(NotActive):
        rig.door.hold()


# Whoever is told -----------------------------------------------------------------------------


def test_who_is_told_may_wait_for_somebody_who_stops_the_arm() -> None:
    """The observer wants a lock, and who has that lock wants the door."""
    rig, theirs = Rig(), threading.Lock()
    entered = threading.Event()

    def observe(_: ArmEvent) -> None:
        entered.set()
        with theirs:
            pass

    rig.then = observe
    with theirs:
        told = threading.Thread(target=rig.write, args=(degrees(1),), daemon=True)
        told.start()
        assert entered.wait(5)
        stop = threading.Thread(target=rig.door.hold, daemon=True)
        stop.start()
        stop.join(5)
        assert not stop.is_alive()
        assert len(rig.link.written) == 2
    told.join(5)
    assert not told.is_alive()
    scheduled = [e.scheduled for e in rig.events if isinstance(e, FrameSent)]
    assert scheduled == [2.0, None]  # in the order in which they were written


def test_a_closed_door_has_told_all() -> None:
    rig, entered, leave = Rig(), threading.Event(), threading.Event()
    done: list[bool] = []

    def observe(_: ArmEvent) -> None:
        entered.set()
        leave.wait(5)
        done.append(True)

    rig.then = observe
    told = threading.Thread(target=rig.write, args=(degrees(1),))
    told.start()
    assert entered.wait(5)
    close = threading.Thread(target=rig.door.close)
    close.start()
    close.join(0.02)
    assert close.is_alive()
    leave.set()
    close.join(5)
    assert done == [True]
    told.join()


def test_who_is_told_and_fails_does_not_keep_the_next_from_being_told() -> None:
    rig = Rig()

    def fail(_: ArmEvent) -> None:
        rig.then = lambda _: None
        raise RuntimeError("a bug of the one who watches")

    rig.then = fail
    with pytest.raises(RuntimeError):
        rig.write(degrees(1))
    rig.door.hold()
    assert len(rig.events) == 2


def test_many_holds_at_once_write_one_frame() -> None:
    for _ in range(50):
        rig = Rig()
        rig.write(degrees(1))
        threads = [threading.Thread(target=rig.door.hold) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(rig.sent) == 2
