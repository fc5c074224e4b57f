"""The write guard: holds, failed writes, slow ones, and many threads at it."""

import contextlib
import threading
from collections.abc import Callable

import pytest
from hypothesis import given, strategies as st

from hardware import ArmEvent, FrameSent, NotActive, RealClock
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.errors import (
    DriverFailed,
    PortLost,
    PortStalled,
    StaleGeneration,
    TorqueOff,
    WriteRefused,
)
from hardware.link.timed_link import TimedLink
from tests.support.arms.write_guard_rig import HOME, Rig, degrees


def test_a_hold_repeats_the_last_frame_exactly_once() -> None:
    rig = Rig()
    rig.write(degrees(1))
    for _ in range(3):
        rig.guard.hold()
    assert rig.sent == ["b091,s090,e090,g000,"] * 2
    assert rig.events[-1] == FrameSent(2.0, b"b091,s090,e090,g000,", degrees(1), None)


def test_after_a_hold_the_old_motion_is_over_and_a_new_one_may_begin() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.guard.hold()
    with pytest.raises(StaleGeneration):
        rig.write(degrees(2))
    rig.claim = rig.claimed()
    rig.wait(rig.guard.earliest)
    rig.write(degrees(2))
    rig.guard.hold()
    assert len(rig.sent) == 4


def test_a_hold_for_a_motion_that_is_over_leaves_the_next_one_alone() -> None:
    rig = Rig()
    rig.write(degrees(1))
    over = rig.claim
    rig.guard.hold()
    rig.claim = rig.claimed()
    rig.wait(rig.guard.earliest)
    rig.write(degrees(2))
    with pytest.raises(StaleGeneration):
        rig.guard.hold(over)
    rig.wait(rig.guard.earliest)
    rig.write(degrees(3))
    rig.guard.hold(rig.claim)
    assert [frame[:4] for frame in rig.sent] == ["b091", "b091", "b092", "b093", "b093"]


def test_a_hold_writes_nothing_if_no_frame_was_sent() -> None:
    rig = Rig()
    rig.write(HOME)
    rig.guard.hold()
    assert rig.sent == []


def test_a_hold_writes_nothing_if_the_arm_is_not_active() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.active = False
    with pytest.raises(NotActive):
        rig.guard.hold()
    assert len(rig.sent) == 1


def test_a_hold_finds_room_while_two_frames_are_under_way() -> None:
    rig = Rig()
    rig.write(degrees(16))
    rig.write(degrees(0))
    rig.guard.hold()
    assert rig.board() == (90, 90, 90, 0)
    assert rig.link.board.state(100.0).lost == 0


def test_after_a_failed_write_nothing_follows() -> None:
    """It is unknown what the board received, so not even a hold may be sent."""
    rig = Rig()
    rig.write(degrees(1))
    rig.link.unplug()
    with pytest.raises(PortLost):
        rig.write(degrees(2))
    rig.link.open()  # as if it came back
    with pytest.raises(NotActive):
        rig.guard.hold()
    for _ in range(2):
        with pytest.raises(NotActive):
            rig.write(degrees(3))
        rig.guard.hold()  # the hold that was due is dropped
    assert rig.sent == ["b091,s090,e090,g000,"]
    assert rig.guard.commanded == degrees(1)


def test_a_failed_hold_is_not_repeated() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.link.unplug()
    with pytest.raises(PortLost):
        rig.guard.hold()
    rig.link.open()
    rig.guard.hold()
    assert len(rig.sent) == 1


def test_a_hold_within_a_hold_writes_one_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """As when a signal handler stops an arm that is being stopped."""
    rig = Rig()
    rig.write(degrees(1))
    check = rig.guard._check_active

    def interrupted() -> None:
        monkeypatch.setattr(rig.guard, "_check_active", check)
        rig.guard.hold()
        check()

    monkeypatch.setattr(rig.guard, "_check_active", interrupted)
    rig.guard.hold()
    assert rig.sent == ["b091,s090,e090,g000,"] * 2


def test_a_closed_guard_stays_closed() -> None:
    rig = Rig()
    rig.write(degrees(1))
    rig.guard.close()
    rig.guard.close()
    with pytest.raises(NotActive):
        rig.write(degrees(2))
    with pytest.raises(NotActive):
        rig.guard.hold()
    assert len(rig.sent) == 1


def test_an_observer_of_a_frame_may_hold_at_once() -> None:
    rig = Rig()
    rig.then = lambda _: rig.guard.hold()
    reported = threading.Thread(target=lambda: rig.write(degrees(1)), daemon=True)
    reported.start()
    reported.join(5)
    assert not reported.is_alive()
    assert len(rig.events) == 2


@pytest.mark.parametrize(
    "act",
    [Rig.claimed, lambda rig: rig.guard.release(rig.claim),
     lambda rig: rig.guard.send_start_commands(), lambda rig: rig.guard.close(),
     lambda rig: rig.guard.hold(), lambda rig: rig.write(degrees(1))],
    ids=["claim", "release", "enable", "close", "hold", "write"],
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


@pytest.mark.parametrize(
    "act",
    [Rig.claimed, lambda rig: rig.guard.release(rig.claim),
     lambda rig: rig.guard.send_start_commands(), lambda rig: rig.guard.hold(),
     lambda rig: rig.write(degrees(1))],
    ids=["claim", "release", "enable", "hold", "write"],
)  # fmt: skip
def test_no_thread_waits_forever_for_a_write_that_does_not_return(
    act: Callable[[Rig], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    wait = "hardware.link.timed_link._WAIT"
    monkeypatch.setattr(wait, 0.1)  # until the write begins, which a busy machine delays
    rig, entered, leave = Rig(), threading.Event(), threading.Event()
    rig.guard._link = timed = TimedLink(rig.link, RealClock())
    timed.open()
    ends: list[Exception] = []

    def stick() -> None:
        monkeypatch.setattr(wait, 0.002)
        entered.set()
        leave.wait(5)

    def write() -> None:
        try:
            rig.write(degrees(1))
        except PortStalled as error:
            ends.append(error)

    rig.link.meanwhile = stick
    stuck = threading.Thread(target=write)
    stuck.start()
    assert entered.wait(5)
    with contextlib.suppress(WriteRefused):
        act(rig)
    rig.guard.close()
    stuck.join(5)
    (stalled,) = ends
    why = "A write to the port does not return: the port board accepts no more bytes"
    assert str(stalled).startswith(why)
    with pytest.raises(NotActive):
        rig.write(degrees(2))
    leave.set()
    timed.close()
    assert rig.sent == []


def test_the_time_that_a_write_waits_is_the_boards_too() -> None:
    rig = Rig()
    rig.link.meanwhile = lambda: rig.wait(2.15)
    rig.write(degrees(16))
    rig.write(degrees(0))
    busy = 20 * 0.0051 + 4 * 0.00015
    done = 2.15 + 20 * 10 / 115200 + busy
    assert rig.guard.earliest == pytest.approx(done)
    assert rig.guard.done == pytest.approx(done + busy)


@given(st.lists(st.tuples(st.integers(-4, 4), st.floats(0.0, 0.19), st.floats(0.0, 0.2))))
def test_slow_writes_overrun_no_board(frames: list[tuple[int, float, float]]) -> None:
    """Each frame is written as early as allowed, and its write is delayed."""
    rig, angle = Rig(), 0
    for step, waits, pause in frames:
        rig.wait(max(rig.clock.now() + pause, rig.guard.earliest))
        until = rig.clock.now() + waits
        rig.link.meanwhile = lambda until=until: rig.wait(until)  # type: ignore[misc]
        angle += 4 * step
        if abs(angle) < 80:
            rig.write(degrees(angle))
        else:
            angle -= 4 * step
    rig.guard.hold()
    rig.board()
    assert rig.link.board.state(rig.clock.now()).lost == 0


@pytest.mark.parametrize("error", [OSError("not ours"), NotActive("not by us"), SystemExit()])
@pytest.mark.parametrize("act", [Rig.write, lambda rig, _: rig.guard.send_start_commands()])
def test_after_whatever_a_driver_raises_nothing_follows(
    act: Callable[[Rig, tuple[float, ...]], object], error: BaseException
) -> None:
    rig = Rig(FIRMWARES["armtree"])
    rig.session.receive(rig.link.read(), rig.clock.now())
    rig.write(degrees(1))

    def fail() -> None:
        raise error

    rig.link.meanwhile = fail
    with pytest.raises((DriverFailed, SystemExit)) as raised:
        act(rig, degrees(2))
    assert error in (raised.value, raised.value.__cause__)
    assert repr(error) in repr(raised.value)
    with pytest.raises(NotActive):
        rig.guard.hold()


def test_a_closed_guard_has_reported_everything() -> None:
    rig, entered, leave = Rig(), threading.Event(), threading.Event()
    done: list[bool] = []

    def observe(_: ArmEvent) -> None:
        entered.set()
        leave.wait(5)
        done.append(True)

    rig.then = observe
    reported = threading.Thread(target=rig.write, args=(degrees(1),))
    reported.start()
    assert entered.wait(5)
    close = threading.Thread(target=rig.guard.close)
    close.start()
    close.join(0.02)
    assert close.is_alive()
    leave.set()
    close.join(5)
    assert done == [True]
    reported.join()


def test_many_holds_at_once_write_one_frame() -> None:
    for _ in range(50):
        rig = Rig()
        rig.write(degrees(1))
        threads = [threading.Thread(target=rig.guard.hold) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(rig.sent) == 2


def test_a_gripper_is_loosened_only_if_the_board_has_room_and_no_motion_has_begun() -> None:
    rig = Rig()
    step = 0
    while rig.guard.earliest <= rig.clock.now():
        rig.write(degrees(2 + step))
        step = 1 - step
    assert not rig.guard.loosen(degrees(1), rig.claim)
    rig.wait(rig.guard.earliest)
    assert not rig.guard.loosen(degrees(1))
    assert rig.guard.loosen(degrees(1), rig.claim)
    assert rig.guard.commanded == degrees(1)
    rig.guard.hold()
    planned = rig.guard.generation
    rig.wait(rig.guard.earliest)
    assert rig.guard.loosen(degrees(0))
    assert rig.guard.generation > planned
    assert rig.sent[-1][:4] == "b090"
    assert rig.events[-1] == FrameSent(rig.clock.now(), rig.link.written[-1], degrees(0), None)


def test_nothing_is_loosened_without_torque() -> None:
    rig = Rig()
    rig.guard.torque = False
    with pytest.raises(TorqueOff):
        rig.guard.loosen(degrees(1), rig.claim)
    rig.guard.hold()
    assert not rig.guard.loosen(degrees(1))
    assert rig.sent == []
