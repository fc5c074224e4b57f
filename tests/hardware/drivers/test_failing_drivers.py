"""Drivers of other packages: every exception is a fault and ends. In simulated time."""

import contextlib
import dataclasses
import threading
from collections.abc import Callable, Iterator

import pytest

from hardware import (
    Arm,
    ArmEvent,
    BoardLink,
    Faulted,
    NotActive,
    PlaybackState,
    RealClock,
    State,
    TransitionRefused,
)
from hardware.drivers.arduino.virtual.board import Board
from hardware.errors import DriverFailed, PortLost, PortStalled, StaleGeneration
from tests.support.arms.hardware_rigs import HOME, PICK, ROBOT, Rig, motion, nothing, settled
from tests.support.arms.virtual_boards import virtual_board


@pytest.fixture
def rig() -> Iterator[Rig]:
    with Rig.alone() as rig:
        yield rig


class Foreign(BoardLink[Board]):
    """A link that raises other exceptions."""

    error: Exception
    deaf: bool

    def write(self, data: bytes) -> None:
        try:
            super().write(data)
        except PortLost:
            raise self.error from None

    def read(self) -> bytes:
        with self._changed:
            while self.deaf and self._open:
                self._changed.wait(None)
        try:
            return super().read()
        except PortLost:
            raise self.error from None


@pytest.mark.parametrize("deaf", [True, False])
@pytest.mark.parametrize("error", [OSError(5, "I/O"), ValueError("bad"), AssertionError()])
def test_an_exception_of_a_driver_ends_the_motion_and_is_its_cause(
    deaf: bool, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the reading thread, or in the writing one."""
    monkeypatch.setattr("tests.support.arms.hardware_rigs.BoardLink", Foreign)
    with Rig.alone() as rig:
        assert isinstance(rig.link, Foreign)
        rig.link.error, rig.link.deaf = error, deaf
        rig.start()
        playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
        rig.wait(1.0)
        rig.link.unplug()
        settled(rig, State.UNCONFIGURED)
        (fault,) = rig.faults
        assert playback.state is PlaybackState.FAILED
        assert fault is playback.error
        assert isinstance(fault, DriverFailed)
        assert (fault.code, fault.__cause__) == ("hw.driver", error)
        assert f"The driver failed: {error!r}" in str(fault)


@pytest.mark.parametrize("error", [NotActive("theirs"), StaleGeneration("theirs"), SystemExit(3)])
def test_hardware_errors_from_a_driver_end_the_motion_too(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    rig.start()

    def fail(data: bytes) -> None:
        raise error

    monkeypatch.setattr(rig.link, "write", fail)
    playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.wait(1.0)
    settled(rig, State.UNCONFIGURED)
    assert playback.state is PlaybackState.FAILED
    assert isinstance(playback.error, DriverFailed)
    assert playback.error.__cause__ is error


@pytest.mark.parametrize("act", [Arm.stop, Arm.deactivate, Arm.shutdown])
def test_a_hold_at_which_the_driver_fails_is_a_fault(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, act: Callable[[Arm], None]
) -> None:
    rig.start()
    playback = rig.arm.play(motion(HOME, PICK, 4.0), rig.wake, "test", rig.arm.generation)
    rig.wait(1.0)

    def fail(data: bytes) -> None:
        raise OSError(5, "I/O")

    monkeypatch.setattr(rig.link, "write", fail)
    with contextlib.suppress(TransitionRefused):  # the fault was first
        act(rig.arm)
    assert [type(fault) for fault in rig.faults] == [DriverFailed]
    assert isinstance(playback.error, DriverFailed)


def test_a_driver_that_fails_to_open_leaves_the_arm_inactive(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        raise OSError(5, "I/O")

    rig.arm.configure()
    with monkeypatch.context() as patch:
        patch.setattr(rig.link, "open", fail)
        with pytest.raises(DriverFailed, match=r"The driver failed: OSError\(5, 'I/O'\)"):
            rig.arm.activate()
    assert rig.arm.state is State.INACTIVE
    rig.arm.activate()


class Stuck(BoardLink[Board]):
    """A link with a write that returns when the test lets it, and then fails."""

    def __init__(self) -> None:
        super().__init__(virtual_board(ROBOT), RealClock())
        self.stuck, self.leave = threading.Event(), threading.Event()

    def write(self, data: bytes) -> None:
        self.writer = threading.current_thread()
        self.stuck.set()
        self.leave.wait()
        raise OSError(5, "I/O")


@pytest.mark.parametrize("act", [Arm.stop, Arm.deactivate, Arm.shutdown])
def test_a_write_that_does_not_return_blocks_no_thread_forever_and_no_later_motion(
    monkeypatch: pytest.MonkeyPatch, act: Callable[[Arm], None]
) -> None:
    monkeypatch.setattr("hardware.arm.connection.OBSERVER_TIMEOUT", 0.02)
    monkeypatch.setattr("hardware.link.timed_link._WAIT", 0.05)
    robot = dataclasses.replace(ROBOT, serial=dataclasses.replace(ROBOT.serial, boot_wait=0.0))
    link, events = Stuck(), list[ArmEvent]()
    arm = Arm(robot, link, RealClock(), events.append)
    arm.configure()
    arm.activate()
    assert arm._streamer
    streamer = arm._streamer.thread
    playback = arm.play(motion(HOME, PICK, 4.0), nothing, "test", arm.generation)
    assert link.stuck.wait(5)
    with contextlib.suppress(TransitionRefused):  # the fault was first
        act(arm)
    streamer.join(5)  # it processes the fault
    assert isinstance(playback.error, PortStalled)
    stuck = link.writer
    if act is not Arm.shutdown:
        if arm.state is State.UNCONFIGURED:  # inactive if the deactivation was first
            arm.configure()
        arm.activate()
    link.leave.set()
    stuck.join(5)
    assert arm.state is (State.FINALIZED if act is Arm.shutdown else State.ACTIVE)
    assert [event.error for event in events if isinstance(event, Faulted)] == [playback.error]
    arm.shutdown()
