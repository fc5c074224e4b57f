"""A deadline for the calls of a link, which a driver or the kernel may not keep."""

import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from functools import partial
from queue import SimpleQueue

from hardware.clock import RealClock
from hardware.errors import LinkError, PortStalled

from .link import Link

# A call that outlasts so many waits is stuck: a write after 0.3 s, a close after 0.9 s. There are
# several, because a stall of the whole host ends one of them at once and gives the call no time.
_WRITE_WAITS, _CLOSE_WAITS, _WAIT = 10, 30, 0.03  # number, and length of each [s]

_Call = tuple[Future[None], Callable[[], None]]


class TimedLink:
    """A link whose `write` and `close` return or raise in time, whatever its driver does.

    They run on other threads. A call that is stuck keeps its thread.

    Args:
        link: The link of the driver.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._writes = SimpleQueue[_Call | None]()
        self._writer: threading.Thread | None = None

    @property
    def port(self) -> str:
        """Name of the port for messages."""
        return self._link.port

    def open(self) -> None:
        """Open the link. Raises what the driver raises."""
        self._link.open()
        self._writes = SimpleQueue()
        self._writer = RealClock().spawn(partial(_work, self._writes), "writer")

    def write(self, data: bytes) -> None:
        """Send bytes. Raises what the driver raises.

        Raises:
            PortStalled: The write of the driver does not return. The bytes may or may not arrive.
        """
        done = Future[None]()
        self._writes.put((done, partial(self._link.write, data)))
        if not _in_time(done, _WRITE_WAITS):
            raise PortStalled(self.port, "A write to the port does not return")

    def read(self) -> bytes:
        """Wait for bytes, and return them. No bytes mean that the link is closed."""
        return self._link.read()

    def close(self, discard: bool = False) -> None:
        """Close the link. Raises what the driver raises.

        Args:
            discard: Whether to drop bytes that were written but have not been sent.

        Raises:
            LinkError: The close of the driver does not return.
        """
        self._writes.put(None)
        done = Future[None]()
        call = done, partial(self._link.close, discard)
        closer = RealClock().spawn(partial(_run, *call), "closer")
        if not _in_time(done, _CLOSE_WAITS):
            raise LinkError(self.port, f"the driver of {self.port} does not return")
        for thread in filter(None, (closer, self._writer)):
            thread.join(_WAIT)


def _in_time(done: Future[None], waits: int) -> bool:
    """Wait for a call and raise what it raises. Return False if it does not return in time."""
    if any(wait([done], _WAIT).done for _ in range(waits)):
        done.result()
        return True
    done.cancel()  # if it has not begun
    return False


def _work(calls: SimpleQueue[_Call | None]) -> None:
    while call := calls.get():
        _run(*call)


def _run(done: Future[None], call: Callable[[], None]) -> None:
    if done.set_running_or_notify_cancel():
        try:
            call()
            done.set_result(None)
        except BaseException as error:  # the caller raises it
            done.set_exception(error)
