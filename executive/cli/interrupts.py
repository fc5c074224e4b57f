"""Handles SIGINT, SIGTERM and SIGHUP while the main thread waits for a run to end."""

import os
import signal
from collections.abc import Callable
from concurrent.futures import Future
from types import FrameType
from typing import Any, Self, TypeVar

from executive.codes import INTERRUPTED_EXIT
from hardware import RealClock

T = TypeVar("T")

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_END = 0  # no signal has this number


class Interrupts:
    """The first signal cancels the run, the second exits the process at once.

    The main thread waits on a pipe, not on a lock: Python handles a signal that arrives just before
    a thread sleeps on a lock only when the lock is released.
    """

    def __init__(self) -> None:
        self._cancel: Callable[[], None] | None = None
        self._canceled = False

    def __enter__(self) -> Self:
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        self._wakeup = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        self._handlers: dict[signal.Signals, Any] = {
            number: signal.signal(number, self._interrupt)
            for number in _SIGNALS
            if not _hangup_ignored(number)
        }
        return self

    def __exit__(self, *raised: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._wakeup)
        os.close(self._reader)
        os.close(self._writer)

    def on_cancel(self, cancel: Callable[[], None]) -> None:
        """Call a function on the main thread at the first signal, or now if it has arrived."""
        self._cancel = cancel
        if self._canceled:
            cancel()

    def run(self, work: Callable[[], T]) -> T:
        """Run a function on another thread, and handle signals on this one.

        Returns:
            The result of the function. Its exception is raised.
        """
        work_done: Future[T] = Future()

        def run() -> None:
            try:
                work_done.set_result(work())
            except Exception as error:
                work_done.set_exception(error)
            finally:
                self.end()

        thread = RealClock().spawn(run, "work")
        self.wait()
        thread.join()
        return work_done.result()

    def end(self) -> None:
        """Make `wait` return. Any thread may call."""
        os.write(self._writer, bytes([_END]))

    def wait(self) -> None:
        """Wait for `end`, and handle signals."""
        while _END not in os.read(self._reader, 64):
            pass  # a signal, and its handler has run

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        if self._canceled:
            os._exit(INTERRUPTED_EXIT)
        self._canceled = True
        if self._cancel:
            self._cancel()


def _hangup_ignored(number: signal.Signals) -> bool:
    """Return True if the parent process has disabled hang-ups, as nohup does."""
    return number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN
