"""What a thread does in turn, and how those who give it work need not wake it each time."""

import threading
import time
from collections import deque
from collections.abc import Callable
from queue import Empty, SimpleQueue

Job = Callable[[], object]

# How late a job of a beat may be taken up at most [s], and what is too slow to be a beat [s].
_LATE = 0.001
_SLOWEST = 0.2


class Jobs:
    """Calls what is put, in turn, in a thread of its own.

    To wake a sleeping thread costs the one who wakes it 5 to 15 us, more than all else that is
    done to record a frame. So after a job that came at a beat the thread sleeps by the timer,
    until just after the next one should be there; that one is put without waking anybody.
    """

    def __init__(self, name: str) -> None:
        """Begins the thread.

        Args:
            name: Of the thread.
        """
        self._jobs = deque[Job]()
        self._bell = SimpleQueue[None]()
        self._last = self._interval = float("inf")
        self._naps = False  # whether it sleeps no longer than till the next beat
        # A daemon: whoever leaves without close() leaves a journal, which recovery can read.
        threading.Thread(target=self._work, name=name, daemon=True).start()

    def put(self, job: Job) -> None:
        """Has a job done as soon as those before it are; never blocks. From any thread."""
        self._jobs.append(job)
        self._bell.put(None)

    def put_at_beat(self, job: Job) -> None:
        """Has one of many jobs done that come at a steady pace; never blocks. From one thread.

        It is begun within 1 ms where it is in time, and not later than the next one should come.
        """
        now = time.monotonic()
        self._last, self._interval = now, now - self._last
        self._jobs.append(job)
        if not self._naps:
            self._bell.put(None)

    def _work(self) -> None:
        while True:
            while self._jobs:
                self._jobs.popleft()()
            nap = self._next_beat() - time.monotonic()
            self._naps = nap > 0
            if self._jobs:  # it came before it could know that it must ring
                continue
            try:
                self._bell.get(timeout=nap if nap > 0 else None)
            except Empty:
                continue

    def _next_beat(self) -> float:
        interval = self._interval
        if not 0 <= interval <= _SLOWEST:
            return 0.0
        return self._last + interval + min(interval / 4, _LATE)
