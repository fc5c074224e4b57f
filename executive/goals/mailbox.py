"""The mailbox of a run: other threads post requests to the executor thread and wake it."""

import math
from collections.abc import Callable

from hardware import Clock


class Mailbox:
    """Requests for one run, and the time of the run. The time stops during a pause.

    Any thread may post. Only the executor thread waits.

    Args:
        clock: Time source.

    Attributes:
        canceled: True after a cancel.
        paused: True while a pause is requested.
        stepping: True if the run pauses before the next node starts.
        fault: First error outside the tree, or None.
        paused_time: Total time of the pauses so far [s].
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._signal = clock.signal()
        self._woken = self.canceled = self.paused = self.stepping = False
        self.fault: Exception | None = None
        self._deadline = math.inf  # time of the requested tick, in the time of the run [s]
        self.paused_time = 0.0

    def wake_at(self, time: float) -> None:
        """Request a tick at a time of the run [s]. Only for the executor thread.

        Only the earliest request is kept. Therefore repeat a request at every tick.
        """
        self._deadline = min(self._deadline, time)

    def wake(self) -> None:
        """Request a tick."""
        with self._signal:
            self._woken = True
            self._signal.notify()

    def cancel(self) -> None:
        """Request a cancel."""
        with self._signal:
            self.canceled = True
            self._signal.notify()

    def pause(self) -> None:
        """Request a pause."""
        with self._signal:
            self.paused, self.stepping = True, False
            self._signal.notify()

    def resume(self, step: bool = False) -> bool:
        """Resume a paused run. Without `step`, also end the steps of a run that steps.

        Args:
            step: True to pause again before the next node starts.

        Returns:
            False if there is nothing to resume.
        """
        with self._signal:
            if not (self.paused or (self.stepping and not step)):
                return False
            self.paused, self.stepping = False, step
            self._woken = True  # a node at a breakpoint needs a tick, also before the pause begins
            self._signal.notify()
            return True

    def fail(self, error: Exception) -> None:
        """Report an error outside the tree. Only the first error counts."""
        with self._signal:
            self.fault = self.fault or error
            self._signal.notify()

    @property
    def stopping(self) -> bool:
        """True if the run must end before its tree ends."""
        return self.canceled or self.fault is not None

    def wait(self) -> None:
        """Wait until another thread posts a request, or until the time of the requested tick."""
        with self._signal:
            while not (self._woken or self.paused or self.stopping or self._due):
                until = None if self._deadline == math.inf else self._deadline + self.paused_time
                self._signal.wait(until)
            self._woken = False
            if self._due:
                self._deadline = math.inf

    def wait_for_resume(self) -> None:
        """Wait until the run is resumed or must end."""
        since = self._clock.now()
        with self._signal:
            while self.paused and not self.stopping:
                self._signal.wait(None)
            self.paused_time += self._clock.now() - since

    @property
    def _due(self) -> bool:
        return self._clock.now() - self.paused_time >= self._deadline

    def wait_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until a condition is true. Return False after the timeout.

        Args:
            condition: Callback that returns True at the end. It is called after every post.
            timeout: Longest time to wait [s].
        """
        until = self._clock.now() + timeout
        with self._signal:
            while not condition() and self._clock.now() < until:
                self._signal.wait(until)
            return condition()
