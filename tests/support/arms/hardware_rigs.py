"""An arm in simulated time, for the tests of hardware."""

import contextlib
import os
import pty
import threading
import tty
from collections.abc import Callable, Iterator, Sequence

from hardware import (
    Arm,
    ArmEvent,
    BoardLink,
    Faulted,
    FrameSent,
    HardwareError,
    RealClock,
    Robot,
    Schedule,
    SimulatedClock,
    State,
    compile_schedule,
    load_robot,
)
from tests.support.arms.virtual_boards import virtual_board

ROBOT = load_robot()
HOME = (0.0, 0.0, 0.0, 0.0)
PICK = (-1.4, -0.6, -0.07, 0.0)


def nothing() -> None:
    """A callback that does nothing."""


def motion(
    start: Sequence[float], goal: Sequence[float], duration: float, robot: Robot = ROBOT
) -> Schedule:
    def sample(times: Sequence[float]) -> list[list[float]]:
        parts = [time / duration for time in times]
        return [[a + (b - a) * part for a, b in zip(start, goal, strict=True)] for part in parts]

    return compile_schedule(robot, start, sample, duration)


class Rig:
    """An arm on an in-process board, and its events."""

    def __init__(self, robot: Robot = ROBOT) -> None:
        self.clock = SimulatedClock()
        self.link = BoardLink(virtual_board(robot), self.clock)
        self.events: list[ArmEvent] = []
        self.arm = Arm(robot, self.link, self.clock, self.events.append)
        self.woken = self.clock.signal()

    def wake(self) -> None:
        with self.woken:
            self.woken.notify()

    def until(self, settled: Callable[[], bool], deadline: float | None = None) -> None:
        with self.woken:
            while not settled() and (deadline is None or self.clock.now() < deadline):
                self.woken.wait(deadline)

    def wait(self, seconds: float) -> None:
        self.until(lambda: False, self.clock.now() + seconds)

    def start(self) -> None:
        self.arm.configure()
        self.arm.activate()

    @property
    def frames(self) -> list[FrameSent]:
        return [event for event in self.events if isinstance(event, FrameSent)]

    @property
    def faults(self) -> list[HardwareError]:
        return [event.error for event in self.events if isinstance(event, Faulted)]

    @property
    def resets(self) -> int:
        return self.link.board.state(self.clock.now()).resets

    @classmethod
    @contextlib.contextmanager
    def alone(cls, robot: Robot = ROBOT) -> Iterator["Rig"]:
        """A rig whose time passes only while this thread waits too. It leaves no thread behind."""
        before, rig = threads(), cls(robot)
        with rig.clock.working():
            yield rig
            rig.arm.shutdown()
            assert not left(before)


def settled(rig: Rig, state: State) -> None:
    rig.until(lambda: rig.arm.state is state, rig.clock.now() + 1.0)
    assert rig.arm.state is state


def threads() -> set[threading.Thread]:
    """The threads of this process."""
    return set(threading.enumerate())


def left(before: set[threading.Thread]) -> set[threading.Thread]:
    """The threads that were started since then and do not end within 5 s each.

    The one that releases collected arms never ends; one without an ident is about to start.
    """
    started = {t for t in threads() - before if t.ident and t.name != "releaser"}
    for thread in started:
        thread.join(5)
    return {thread for thread in started if thread.is_alive()}


def open_files() -> int:
    """How many file descriptors this process has."""
    return len(os.listdir("/proc/self/fd"))


def settled_for(arm: Arm, state: State, patience: float) -> None:
    """Waits in real time until an arm has come to a state, for so long at the most [s]."""
    clock = RealClock()
    signal, until = clock.signal(), clock.now() + patience
    while arm.state is not state or arm._is_changing():
        assert clock.now() < until, arm.state
        with signal:
            signal.wait(clock.now() + 0.002)


class Pty:
    """A pseudo-terminal. The test controls its other end."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.port = os.ttyname(self.slave)
        os.set_blocking(self.master, False)

    def vanish(self) -> None:
        """Closes the other end."""
        if self.master >= 0:
            os.close(self.master)
            self.master = -1

    def drain(self) -> bytes:
        data = b""
        try:
            while part := os.read(self.master, 65536):
                data += part
        except BlockingIOError:
            pass
        return data
