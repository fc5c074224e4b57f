"""What others want of a run: whoever posts wakes the thread that owns it."""

import math
from collections.abc import Callable

from hardware import Clock


class Mailbox:
    """Posts for the owner of one run, and the time as that run has it: it stands still in a pause.

    Args:
        clock: Whose time.

    Attributes:
        ticking: Whether the owner is in the tree, which may hold it.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._signal = clock.signal()
        self._woken = self._canceled = self._paused = self._stepping = False
        self._fault: Exception | None = None
        self._deadline = math.inf
        self._paused_time = 0.0  # in pauses [s]
        self.ticking = False

    def wake_at(self, time: float) -> None:
        """Ask for a tick at a time of the run [s]; from the owner thread, and anew at each tick."""
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

    def pause(self) -> None:
        """Ask to stand still."""
        with self._signal:
            self._paused, self._stepping = True, False
            self._signal.notify()

    def resume(self, step: bool = False) -> bool:
        """Ask to go on, also past the end of a step; false where it goes on already.

        Args:
            step: Whether only up to the next node that begins.
        """
        with self._signal:
            if not (self._paused or (self._stepping and not step)):
                return False
            self._paused, self._stepping = False, step
            self._woken = True  # what waits to begin needs a tick, also where no pause was made yet
            self._signal.notify()
            return True

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
    def paused(self) -> bool:
        """Whether it is to stand still."""
        return self._paused

    @property
    def stepping(self) -> bool:
        """Whether it is to stand still before the next node that begins."""
        return self._stepping

    @property
    def fault(self) -> Exception | None:
        """What failed outside the tree."""
        return self._fault

    @property
    def stopping(self) -> bool:
        """Whether the run is to end before its tree does."""
        return self._canceled or self._fault is not None

    @property
    def paused_time(self) -> float:
        """For how long it stood still so far [s]."""
        return self._paused_time

    def wait(self) -> None:
        """Wait until somebody posts, or the earliest time that was asked for has come."""
        with self._signal:
            while not (self._woken or self._paused or self.stopping or self._due):
                until = None if self._deadline == math.inf else self._deadline + self._paused_time
                self._signal.wait(until)
            self._woken = False
            if self._due:
                self._deadline = math.inf

    def wait_for_resume(self) -> None:
        """Stand still until somebody says to go on, or to end."""
        since = self._clock.now()
        with self._signal:
            while self._paused and not self.stopping:
                self._signal.wait(None)
            self._paused_time += self._clock.now() - since

    @property
    def _due(self) -> bool:
        return self._clock.now() - self._paused_time >= self._deadline

    def wait_until(self, settled: Callable[[], bool], seconds: float) -> bool:
        """Wait until something is so; False when it took longer than that [s]."""
        until = self._clock.now() + seconds
        with self._signal:
            while not settled() and self._clock.now() < until:
                self._signal.wait(until)
            return settled()
