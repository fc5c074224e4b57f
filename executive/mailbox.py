"""What others want of a run: whoever posts wakes the thread that owns it."""

import math
from collections.abc import Callable

from hardware import Clock


class Mailbox:
    """Posts for the owner of one run.

    Args:
        clock: Whose time.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._signal = clock.signal()
        self._woken = self._canceled = False
        self._fault: Exception | None = None
        self._deadline = math.inf

    def wake_at(self, time: float) -> None:
        """Ask for a tick at a time [s]; from the owner thread, and anew at each tick."""
        self._deadline = min(self._deadline, time)

    def wake(self) -> None:
        """Ask for a tick."""
        with self._signal:
            self._woken = True
            self._signal.notify()

    def cancel(self) -> None:
        """Ask to cancel."""
        with self._signal:
            self._canceled = True
            self._signal.notify()

    def fail(self, error: Exception) -> None:
        """Say that something outside the tree failed; the first cause counts."""
        with self._signal:
            self._fault = self._fault or error
            self._signal.notify()

    @property
    def canceled(self) -> bool:
        """Whether a cancel was asked for."""
        return self._canceled

    @property
    def stopping(self) -> bool:
        """Whether the run is to end before its tree does."""
        return self._canceled or self._fault is not None

    @property
    def fault(self) -> Exception | None:
        """What failed outside the tree."""
        return self._fault

    def wait(self) -> None:
        """Wait until somebody posts, or the earliest time that was asked for has come."""
        with self._signal:
            while not (self._woken or self._canceled or self._fault or self._due):
                self._signal.wait(None if self._deadline == math.inf else self._deadline)
            self._woken = False
            if self._due:
                self._deadline = math.inf

    @property
    def _due(self) -> bool:
        return self._clock.now() >= self._deadline

    def wait_until(self, settled: Callable[[], bool], seconds: float) -> bool:
        """Wait until something is so; False when it took longer than that [s]."""
        until = self._clock.now() + seconds
        with self._signal:
            while not settled() and self._clock.now() < until:
                self._signal.wait(until)
            return settled()
