"""Injected time: the real clock, and a simulated clock that jumps when all threads wait.

No other code reads the time, sleeps or starts a thread. Therefore a program runs the same code with
a `SimulatedClock` as with a `RealClock`, but needs no real time for its waits.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol


class Signal(Protocol):
    """A condition variable of a clock. Acquire it (`with`) to wait or notify."""

    def __enter__(self) -> object: ...

    def __exit__(self, *raised: object) -> None: ...

    def wait(self, until: float | None) -> None:
        """Release the lock, sleep until a notification, and acquire the lock again.

        Args:
            until: Latest end of the sleep on the clock [s]; None for no limit.
        """

    def notify(self) -> None:
        """Wake all waiting threads."""


class Clock(Protocol):
    """A monotonic clock. It also creates signals, and threads that wait with these signals."""

    def now(self) -> float:
        """Return the monotonic time [s]."""

    def epoch_ns(self) -> int:
        """Return the UTC time at time 0 of this clock [ns since 1970]."""

    def signal(self) -> Signal:
        """Return a new condition variable on this clock."""

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        """Start a daemon thread and return it. `target` may only wait with signals of the clock."""


def utc_ns(clock: Clock, time: float | None = None) -> int:
    """Return a time of a clock [s] as UTC [ns since 1970]. Default: now."""
    return clock.epoch_ns() + round((clock.now() if time is None else time) * 1e9)


class RealClock:
    """The machine's monotonic clock."""

    def __init__(self) -> None:
        self._epoch_ns = time.time_ns() - time.monotonic_ns()

    def now(self) -> float:
        """Return the monotonic time [s]."""
        return time.monotonic()

    def epoch_ns(self) -> int:
        """Return the UTC time at time 0 of the monotonic clock [ns since 1970]."""
        return self._epoch_ns

    def signal(self) -> Signal:
        """Return a new condition variable."""
        return _RealSignal()

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        """Start a daemon thread."""
        thread = threading.Thread(target=target, name=name, daemon=True)
        thread.start()
        return thread


class _RealSignal:
    def __init__(self) -> None:
        self._condition = threading.Condition()

    def __enter__(self) -> object:
        return self._condition.acquire()

    def __exit__(self, *raised: object) -> None:
        self._condition.release()

    def wait(self, until: float | None) -> None:
        self._condition.wait(None if until is None else max(0.0, until - time.monotonic()))

    def notify(self) -> None:
        self._condition.notify_all()


class _Sleeper:
    """A waiting thread."""

    def __init__(self, until: float | None, counted: bool) -> None:
        self.until, self.counted = until, counted
        self.woken = threading.Event()


class SimulatedClock:
    """A clock that stops while any thread works, and jumps to the next deadline when all wait.

    Only threads of `spawn` and threads inside `working()` count as working. A notified thread
    counts as working at once, so the clock cannot jump before this thread runs.

    Args:
        epoch_ns: UTC time at time 0 of this clock [ns since 1970].
    """

    def __init__(self, epoch_ns: int = 1_767_225_600_000_000_000) -> None:
        self._epoch_ns = epoch_ns
        self._lock = threading.Lock()
        self._now = 0.0
        self._working = 0
        self._sleepers: list[_Sleeper] = []
        self._thread_local = threading.local()

    def now(self) -> float:
        """Return the simulated time [s]."""
        return self._now

    def epoch_ns(self) -> int:
        """Return the UTC time at time 0 of this clock [ns since 1970]."""
        return self._epoch_ns

    def signal(self) -> Signal:
        """Return a new condition variable on simulated time."""
        return _SimulatedSignal(self)

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        """Start a daemon thread. It counts as working at once."""
        with self._lock:
            self._working += 1

        def run() -> None:
            self._thread_local.counts = True
            try:
                target()
            finally:
                self._stop_working()

        thread = threading.Thread(target=run, name=name, daemon=True)
        thread.start()
        return thread

    @contextmanager
    def working(self) -> Iterator[None]:
        """Mark the calling thread as working. Does nothing if it is already marked."""
        if self._counts():
            yield
            return
        with self._lock:
            self._working += 1
        self._thread_local.counts = True
        try:
            yield
        finally:
            self._thread_local.counts = False
            self._stop_working()

    def _counts(self) -> bool:
        """Return True if the calling thread counts as working."""
        return getattr(self._thread_local, "counts", False)

    def _stop_working(self) -> None:
        with self._lock:
            self._working -= 1
            self._jump()

    def sleep(self, until: float | None) -> _Sleeper:
        """Register that the calling thread is about to wait."""
        sleeper = _Sleeper(until, self._counts())
        with self._lock:
            self._sleepers.append(sleeper)
            self._working -= sleeper.counted
            self._jump()
        return sleeper

    def wake(self, sleepers: list[_Sleeper]) -> None:
        """Wake threads. They count as working at once."""
        with self._lock:
            self._wake(sleepers)

    def _wake(self, sleepers: list[_Sleeper]) -> None:
        for sleeper in sleepers:
            if not sleeper.woken.is_set():
                self._sleepers.remove(sleeper)
                self._working += sleeper.counted
                sleeper.woken.set()

    def _jump(self) -> None:
        deadlines = [s.until for s in self._sleepers if s.until is not None]
        if self._working == 0 and deadlines:
            self._now = max(self._now, min(deadlines))
            due = [s for s in self._sleepers if s.until is not None and s.until <= self._now]
            self._wake(due)


class _SimulatedSignal:
    def __init__(self, clock: SimulatedClock) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        self._sleepers: list[_Sleeper] = []

    def __enter__(self) -> object:
        return self._lock.__enter__()

    def __exit__(self, *raised: object) -> None:
        self._lock.release()

    def wait(self, until: float | None) -> None:
        if until is not None and until <= self._clock.now():
            return
        sleeper = self._clock.sleep(until)
        self._sleepers.append(sleeper)
        try:
            self._lock.release()
            sleeper.woken.wait()
        finally:  # also after Ctrl-C, because the caller releases the lock
            self._lock.acquire()
            self._clock.wake([sleeper])
            self._sleepers.remove(sleeper)

    def notify(self) -> None:
        self._clock.wake(self._sleepers)
