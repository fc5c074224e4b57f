"""Handles signals during a run, also the signal of `armtree stop`."""

import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import FrameType
from typing import Any, Self, TypeVar

from executive.api.codes import INTERRUPTED_EXIT
from executive.cli.terminal.full_screen import last_words, suspend
from hardware import Clock, RealClock

from .process import end_process, signal_status

T = TypeVar("T")

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
STOP = signal.SIGUSR1  # sent by `armtree stop`; cancels the run, and never ends the process
CANCELING = "Canceling: the arm stops. Ctrl-C ends this command at once."
_END = 0  # not the number of a signal
# Smallest time from the first signal to the second one [s]. GNU `timeout` and some shells send two
# signals at once; a person does not.
_AGAIN = 0.5
_LAST_WORDS = (
    "Ended at once: no result is printed, and the board may still execute two frames. The next run "
    "completes the recording."
)


class Interrupts:
    r"""A context in which the first signal cancels the run, and a second one ends the process.

    Ctrl-\ also ends the process. Before `on_cancel`, the first signal raises KeyboardInterrupt in
    the main thread, because this thread may then read thousands of files. If this signal was not
    Ctrl-C, the context raises SystemExit with the exit status of the signal.

    A signal counts as the second one if it comes at least `_AGAIN` seconds after the first, also
    after the context. A hang-up never counts as the second one: the kernel and the shell of a
    closed terminal each send a hang-up. Ctrl-Z suspends the process. `STOP` cancels a run that is
    not canceled yet. It does not count as the first signal.

    One thread reads the signals from a pipe, and another thread cancels. Therefore the second
    signal works even if the cancel or the main thread does not return.

    Args:
        last: Text to print at the second signal.
        clock: Time source. Default: real time.
    """

    def __init__(self, last: str = _LAST_WORDS, clock: Clock | None = None) -> None:
        self._last, self._clock = last, clock or RealClock()
        self._cancel: Callable[[], None] | None = None
        self._canceled = self._raised = False
        self._status = INTERRUPTED_EXIT  # exit status after KeyboardInterrupt
        self._signaled: float | None = None  # time of the first signal [s], ignoring STOP
        self._lock, self._ended = threading.Lock(), threading.Event()

    def __enter__(self) -> Self:
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        self._wakeup = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        self._handlers: dict[signal.Signals, Any] = {
            number: signal.signal(number, self._raise if number in _SIGNALS else _do_nothing)
            for number in (*_SIGNALS, signal.SIGQUIT, STOP)
            if not _hangup_ignored(number)
        }
        self._handlers[STOP] = signal.SIG_IGN  # a late STOP must not kill the process
        self._handlers[signal.SIGTSTP] = signal.signal(signal.SIGTSTP, suspend)
        self._thread = self._clock.spawn(self._handle_signals, "signals")
        return self

    def __exit__(self, kind: type[BaseException] | None, *raised: object) -> None:
        self._raised = True
        os.write(self._writer, bytes([_END]))
        self._thread.join()
        for number, handler in self._handlers.items():
            late = self._signaled is not None and number in _SIGNALS
            signal.signal(number, self._handle_late if late else handler)
        signal.set_wakeup_fd(self._wakeup)
        os.close(self._reader)
        os.close(self._writer)
        if kind is KeyboardInterrupt and self._status != INTERRUPTED_EXIT:
            sys.exit(self._status)

    def on_cancel(self, cancel: Callable[[], None]) -> None:
        """Call a function on another thread at the first signal, even if it arrived before."""
        with self._lock:
            self._cancel = cancel
            if self._canceled:
                self._clock.spawn(cancel, "cancel")

    def run(self, work: Callable[[], T]) -> T:
        """Run a function on another thread.

        Returns:
            The result of the function. Its exception is raised.
        """
        with ThreadPoolExecutor(1, "work") as threads:
            return threads.submit(work).result()

    def end(self) -> None:
        """Make `wait` return. Any thread may call."""
        self._ended.set()

    def wait(self) -> None:
        """Wait for `end`."""
        self._ended.wait()

    def _handle_signals(self) -> None:
        while (number := os.read(self._reader, 1)[0]) != _END:
            first = self._signaled is None and number in _SIGNALS
            if first and number in self._handlers:
                self._signaled = self._clock.now()
                self._start_cancel()
            elif number == signal.SIGQUIT or self._is_second(number):
                last_words(self._last)
                end_process(signal_status(number))
            elif number == STOP and not self._canceled:
                self._start_cancel()

    def _raise(self, number: int, frame: FrameType | None) -> None:
        if self._cancel is None and not self._raised:
            self._raised, self._status = True, signal_status(number)
            raise KeyboardInterrupt

    def _handle_late(self, number: int, frame: FrameType | None) -> None:
        if self._is_second(number):
            end_process(signal_status(number))

    def _is_second(self, number: int) -> bool:
        if self._signaled is None or number not in (signal.SIGINT, signal.SIGTERM):
            return False
        return self._clock.now() - self._signaled >= _AGAIN

    def _start_cancel(self) -> None:
        with self._lock:
            self._canceled = True
            if self._cancel:
                self._clock.spawn(self._cancel, "cancel")


def _do_nothing(number: int, frame: FrameType | None) -> None:
    """Let Python write the signal to the pipe."""


def _hangup_ignored(number: signal.Signals) -> bool:
    """Return True if the parent process has disabled hang-ups, as nohup does."""
    return number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN
