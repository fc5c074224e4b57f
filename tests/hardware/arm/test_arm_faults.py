"""Faults of the link and from other threads, in simulated time."""

import contextlib
import gc
import subprocess
import sys
import threading
import weakref
from collections.abc import Iterator

import pytest

from hardware import (
    ActivationStopped,
    Arm,
    ArmEvent,
    HardwareError,
    PlaybackState,
    State,
    StateChanged,
    TransitionRefused,
)
from hardware.arm.connection import Connection
from hardware.arm.write_guard import WriteGuard
from hardware.errors import LinkError, PortBusy, PortLost, PortStalled
from tests.support.arms.hardware_rigs import (
    HOME,
    PICK,
    ROBOT,
    Rig,
    left,
    motion,
    nothing,
    settled,
    threads,
)
from tests.support.paths import ROOT


@pytest.fixture
def rig() -> Iterator[Rig]:
    with Rig.alone() as rig:
        yield rig


@pytest.mark.parametrize("moving", [True, False])
def test_a_port_that_is_lost_takes_the_arm_out_of_active(rig: Rig, moving: bool) -> None:
    rig.start()
    playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    if not moving:
        rig.until(lambda: playback.state is PlaybackState.DONE)
    rig.wait(0.45)  # between two frames
    written = len(rig.frames)
    rig.link.unplug()
    settled(rig, State.UNCONFIGURED)
    if moving:
        assert playback.state is PlaybackState.FAILED
        assert isinstance(playback.error, PortLost)
    assert [type(error) for error in rig.faults] == [PortLost]
    rig.arm.stop()
    rig.wait(5)
    assert len(rig.frames) == written
    rig.start()  # by a person
    assert rig.arm.commanded == HOME


@pytest.mark.parametrize("cause", [PortStalled, PortLost])
def test_a_fault_ends_the_motion_with_that_fault_named(rig: Rig, cause: type[PortLost]) -> None:
    rig.start()
    playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.wait(1.0)
    error = cause("board", "it")
    rig.arm.fault(error)
    rig.arm.fault(HardwareError("what follows from it"))
    assert playback.state is PlaybackState.FAILED
    assert playback.error is error
    assert rig.faults == [error]
    assert rig.arm.state is State.UNCONFIGURED
    written = len(rig.frames)
    rig.wait(5)
    assert len(rig.frames) == written


def test_a_frame_that_comes_to_a_closed_guard_does_not_hide_why_it_is_closed(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.start()
    playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.wait(1.0)
    close = WriteGuard.close

    def close_before_the_next_frame(guard: WriteGuard) -> None:
        monkeypatch.setattr(WriteGuard, "close", close)
        close(guard)
        rig.until(lambda: playback.state is not PlaybackState.PLAYING)

    monkeypatch.setattr(WriteGuard, "close", close_before_the_next_frame)
    error = PortLost("board", "it")
    rig.arm.fault(error)
    assert (playback.state, playback.error) == (PlaybackState.FAILED, error)


def test_a_hold_that_cannot_be_written_is_a_fault(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.start()
    playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.wait(1.0)
    stuck = PortStalled("board", "Something went wrong")

    def refuse(data: bytes) -> None:
        raise stuck

    monkeypatch.setattr(rig.link, "write", refuse)
    rig.arm.stop()
    assert rig.arm.state is State.UNCONFIGURED
    assert (playback.state, playback.error) == (PlaybackState.FAILED, stuck)
    assert rig.faults == [stuck]


def test_a_port_lost_during_the_boot_is_not_active(rig: Rig) -> None:
    rig.arm.configure()

    def unplug() -> None:
        rig.wait(1.0)
        rig.link.unplug()

    rig.clock.spawn(unplug, "hand")
    with pytest.raises(PortLost):
        rig.arm.activate()
    assert rig.arm.state is State.UNCONFIGURED
    assert rig.clock.now() == 1.0
    assert [type(error) for error in rig.faults] == [PortLost]


@pytest.mark.parametrize("fault", [HardwareError("whatever"), None])
def test_after_a_fault_nothing_more_leaves_but_the_hold_of_a_stop_does(
    rig: Rig, fault: HardwareError | None
) -> None:
    rig.start()
    rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.until(lambda: len(rig.frames) == 5)
    before = rig.link.board.state(rig.clock.now()).servos
    if fault:
        rig.arm.fault(fault)  # while the fifth frame is on its way
    else:
        rig.arm.deactivate()
    rig.wait(1.0)
    after = rig.link.board.state(rig.clock.now()).servos
    assert (after == before) is bool(fault)
    assert len(rig.frames) == (5 if fault else 6)


@pytest.mark.parametrize(("times", "ended"), [(1, State.UNCONFIGURED), (2, State.FINALIZED)])
def test_an_interrupt_while_the_board_boots_closes_the_port_and_is_raised(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, times: int, ended: State
) -> None:
    """At Ctrl-C, and at a second one during the first."""
    rig.arm.configure()
    interrupts, close = iter(range(times)), rig.link.close

    def interrupt(*_: object, **__: object) -> None:
        for _interrupt in interrupts:
            raise KeyboardInterrupt
        close()

    with monkeypatch.context() as patch:
        patch.setattr(Connection, "start", interrupt)
        patch.setattr(rig.link, "close", interrupt)
        with pytest.raises(KeyboardInterrupt):
            rig.arm.activate()
        assert rig.arm.state is ended
        assert rig.link.read() == b""  # closed
    rig.arm.stop()
    assert rig.arm.state is ended


class LostWhenActive(Rig):
    """Loses its port while it becomes active."""

    def __init__(self) -> None:
        super().__init__()
        self.arm = Arm(ROBOT, self.link, self.clock, self.see)

    def see(self, event: ArmEvent) -> None:
        self.events.append(event)
        if isinstance(event, StateChanged) and event.goal is State.ACTIVE:
            thread = threading.Thread(target=lambda: self.arm.fault(PortLost("board", "gone")))
            thread.start()
            thread.join()


def test_a_port_lost_in_the_moment_of_becoming_active_is_not_active() -> None:
    rig = LostWhenActive()
    rig.arm.configure()
    with pytest.raises(PortLost, match="gone"):
        rig.arm.activate()
    assert rig.arm.state is State.UNCONFIGURED
    assert len(rig.faults) == 1


def test_a_fault_outside_active_changes_no_state(rig: Rig) -> None:
    rig.arm.configure()
    rig.arm.fault(HardwareError("whatever"))
    settled(rig, State.INACTIVE)
    rig.arm.activate()
    settled(rig, State.ACTIVE)


def test_shutdown_waits_for_the_fault_that_another_thread_is_at() -> None:
    """The owner is woken by the end of a playback while the fault is still being processed."""
    rig, entered, leave = Rig(), threading.Event(), threading.Event()

    def see(event: ArmEvent) -> None:
        if isinstance(event, StateChanged) and event.goal is State.ERRORPROCESSING:
            entered.set()
            leave.wait(5)

    arm = Arm(ROBOT, rig.link, rig.clock, see)
    arm.configure()
    arm.activate()
    fault = rig.clock.spawn(lambda: arm.fault(PortLost("board", "gone")), "fault")
    assert entered.wait(5)
    with pytest.raises(TransitionRefused, match="the arm is errorprocessing"):
        arm.deactivate()
    shutdown = rig.clock.spawn(arm.shutdown, "shutdown")
    leave.set()
    fault.join(5)
    shutdown.join(5)
    assert arm.state is State.FINALIZED


def test_shutdown_is_harmless_while_another_thread_shuts_down(rig: Rig) -> None:
    failed: list[HardwareError] = []
    seconds = []

    def shut_down() -> None:
        try:
            rig.arm.shutdown()
        except HardwareError as error:
            failed.append(error)

    def see(event: ArmEvent) -> None:
        if isinstance(event, StateChanged) and event.goal is State.SHUTTINGDOWN:
            seconds.append(rig.clock.spawn(shut_down, "second"))
            rig.wait(0.01)  # the second one waits for this one then

    rig.arm._observe = see
    rig.arm.shutdown()
    (second,) = seconds
    second.join(5)
    assert rig.arm.state is State.FINALIZED
    assert failed == []


def test_shutdown_ends_the_boot_of_another_thread(rig: Rig) -> None:
    rig.arm.configure()
    ends: list[HardwareError] = []

    def activate() -> None:
        try:
            rig.arm.activate()
        except HardwareError as error:
            ends.append(error)

    thread = rig.clock.spawn(activate, "activator")
    rig.wait(0.5)
    rig.arm.shutdown()
    thread.join(5)
    assert rig.arm.state is State.FINALIZED
    assert [type(error) for error in ends] == [ActivationStopped]
    assert rig.clock.now() == 0.5


def test_a_port_that_does_not_open_leaves_the_arm_inactive(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def busy() -> None:
        raise PortBusy("board", None)

    rig.arm.configure()
    with monkeypatch.context() as patch:
        patch.setattr(rig.link, "open", busy)
        with pytest.raises(PortBusy):
            rig.arm.activate()
    assert rig.arm.state is State.INACTIVE
    assert "The arm on port board did not start: The port board is in use by another" in caplog.text
    rig.arm.activate()


@pytest.mark.parametrize("error", [LinkError("board", "it broke"), ValueError("a driver's own")])
def test_a_closing_error_is_logged_and_not_raised(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, error: Exception
) -> None:
    rig.start()
    close = rig.link.close

    def closes_badly(discard: bool) -> None:
        close(discard)
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(rig.link, "close", closes_badly)
        rig.arm.deactivate()
    assert rig.arm.state is State.INACTIVE
    assert f"Closing the port board failed: {error}" in caplog.text


def test_an_observer_that_fails_keeps_the_arm_from_nothing(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def broken(event: ArmEvent) -> None:
        raise RuntimeError("a bug of the one who watches")

    rig = Rig()
    with rig.clock.working(), Arm(ROBOT, rig.link, rig.clock, broken) as arm:
        arm.configure()
        arm.activate()
        playback = arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", arm.generation)
        rig.until(lambda: playback.state is not PlaybackState.PLAYING)
        assert playback.state is PlaybackState.DONE
    assert arm.state is State.FINALIZED
    assert "an observer of the arm failed" in caplog.text


def test_a_callback_that_fails_does_not_end_its_motion(
    rig: Rig, caplog: pytest.LogCaptureFixture
) -> None:
    def broken() -> None:
        raise RuntimeError("a bug of the one who watches")

    rig.start()
    playback = rig.arm.play(motion(HOME, PICK, 4.0), broken, "test", rig.arm.generation)
    rig.wait(10.0)
    assert playback.state is PlaybackState.DONE
    assert rig.arm.state is State.ACTIVE
    assert "the callback of a motion failed" in caplog.text


def test_an_arm_that_is_gone_leaves_nothing_behind() -> None:
    gone = weakref.ref(Rig().arm)
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize("playing", [True, False])
def test_an_arm_that_is_dropped_closes_its_port(playing: bool) -> None:
    rig, before = Rig(), threads()
    rig.start()
    if playing:
        rig.arm.play(motion(HOME, PICK, 4.0), nothing, "test", rig.arm.generation)
    del rig.arm
    assert rig.link.read() == b""  # closed
    assert not left(before)


def test_an_arm_may_be_collected_by_a_thread_that_holds_a_lock() -> None:
    rig = Rig()
    rig.start()
    thread = threading.Thread(target=rig.__dict__.pop, args=("arm",), daemon=True)
    with rig.clock._lock:
        thread.start()
        thread.join(20)
        assert not thread.is_alive()
    assert rig.link.read() == b""  # closed


def test_an_arm_is_shut_down_when_the_interpreter_exits() -> None:
    program = """
from hardware.arm.connection import Connection
from hardware.arm.write_guard import WriteGuard
from tests.support.arms.hardware_rigs import Rig
from hardware import StateChanged
rig = Rig()
rig.start()
rig.arm._observe = lambda event: print(event.label, event.goal.value, flush=True)
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert (done.stderr, done.returncode) == ("", 0)
    assert done.stdout.splitlines()[-1] == "transition_success finalized"


def test_stop_races_with_everything() -> None:
    """Four threads at once: none hangs, and only illegal requests are refused."""
    for _ in range(30):
        rig = Rig()
        rig.start()
        playback = rig.arm.play(motion(HOME, PICK, 4.0), nothing, "test", rig.arm.generation)

        def deactivate(arm: Arm = rig.arm) -> None:
            with contextlib.suppress(TransitionRefused):  # the fault was first
                arm.deactivate()

        threads = [
            threading.Thread(target=act, daemon=True)
            for act in (rig.arm.stop, deactivate, rig.link.unplug, rig.arm.stop)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(5)
            assert not thread.is_alive()
        rig.arm.shutdown()
        assert rig.arm.state is State.FINALIZED
        assert playback.state is not PlaybackState.PLAYING
