"""Deadlines for the calls of a link, because a driver or the kernel may block for too long."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from hardware.clock import Clock
from hardware.errors import LinkError, PortStalled

from .host_load import or_busy
from .link import Link

# A call that takes longer than this number of waits is stuck: a write after 0.3 s, a close after
# 0.9 s. There are several waits, because a stall of the whole host ends one of them without giving
# the call time to run.
_WRITE_WAITS, _CLOSE_WAITS, _WAIT = 10, 30, 0.03  # numbers of waits, and length of a wait [s]

_Call = tuple[Future[None], Callable[[], None]]


class TimedLink:
    """A link whose `write` and `close` return or raise in time, even if its driver blocks.

    These calls run on other threads. A stuck call keeps its thread.

    Args:
        link: The link of the driver.
        clock: Time source. A simulated clock stops during a call that does not wait on the clock.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self._link, self._clock = link, clock
        self._signal = clock.signal()
        self._writes = deque[_Call | None]()
        self._writer: threading.Thread | None = None

    @property
    def port(self) -> str:
        """Name of the port for messages."""
        return self._link.port

    def open(self) -> None:
        """Open the link. Raises the errors of the driver."""
        self._link.open()
        self._writes = deque()
        self._writer = self._clock.spawn(partial(self._work, self._writes), "writer")

    def write(self, data: bytes) -> None:
        """Send bytes. Raises the errors of the driver.

        Raises:
            PortStalled: The write of the driver does not return. Some bytes may still arrive.
        """
        done = Future[None]()
        self._put((done, partial(self._link.write, data)))
        if not self._in_time(done, _WRITE_WAITS):
            raise PortStalled(self.port, "A write to the port does not return", or_busy())

    def read(self) -> bytes:
        """Wait for bytes and return them; empty if the link is closed."""
        return self._link.read()

    @property
    def unread(self) -> bool:
        """True if bytes have arrived that `read` has not returned yet."""
        return self._link.unread

    def close(self, discard: bool = False) -> None:
        """Close the link. Raises the errors of the driver.

        Args:
            discard: True to drop bytes that were written but not sent.

        Raises:
            LinkError: The close of the driver does not return.
        """
        self._put(None)
        done = Future[None]()
        call = done, partial(self._link.close, discard)
        closer = self._clock.spawn(partial(self._run, *call), "closer")
        if not self._in_time(done, _CLOSE_WAITS):
            raise LinkError(self.port, f"the driver of {self.port} does not return")
        for thread in filter(None, (closer, self._writer)):
            thread.join(_WAIT)

    def _put(self, call: _Call | None) -> None:
        with self._signal:
            self._writes.append(call)
            self._signal.notify()

    def _in_time(self, done: Future[None], waits: int) -> bool:
        """Return True when a call has returned, or False if it does not return in time.

        On a busy machine a call may begin late. The time counts from the beginning of the call.

        Args:
            done: Future of the call. An exception of the call is raised.
            waits: Longest time, as a number of waits of `_WAIT`.
        """
        begun, left = False, waits
        with self._signal:
            while left and not done.done():
                self._signal.wait(self._clock.now() + _WAIT)
                if done.running() and not begun:
                    begun, left = True, waits
                left -= 1
        if done.done():
            done.result()
            return True
        done.cancel()  # cancels a call that has not begun
        return False

    def _work(self, calls: deque[_Call | None]) -> None:
        while call := self._next(calls):
            self._run(*call)

    def _next(self, calls: deque[_Call | None]) -> _Call | None:
        with self._signal:
            while not calls:
                self._signal.wait(None)
            return calls.popleft()

    def _run(self, done: Future[None], call: Callable[[], None]) -> None:
        if done.set_running_or_notify_cancel():
            try:
                call()
                done.set_result(None)
            except BaseException as error:  # the caller raises it
                done.set_exception(error)
        with self._signal:
            self._signal.notify()
