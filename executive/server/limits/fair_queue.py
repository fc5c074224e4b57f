"""The order in which received data is processed. Only a stop is not queued."""

import asyncio
import time
from collections.abc import Callable
from typing import Protocol

CHUNK = 1024  # largest number of bytes processed at once, so that the work is short
REST_FACTOR = 3.0  # rest per second of work [s], so that the loop can serve the arm
MAX_DEBT = 0.02  # largest postponed rest [s], so that clients with few requests do not wait
_BUSY_FACTOR = 10.0  # rest per second of other programs or threads on the processor [s]
MAX_BUSY_REST = 0.02  # longest rest of this kind after one piece of work [s]


def busy_rest(elapsed: float, worked: float) -> float:
    """Return the rest after work on a busy computer [s].

    The operating system delays a process that has used its share of the processors. By resting, a
    server keeps a part of its share, so that a stop is not delayed.

    Args:
        elapsed: Time that the work took [s].
        worked: CPU time of the thread during the work [s].
    """
    return min(_BUSY_FACTOR * max(0.0, elapsed - worked), MAX_BUSY_REST)


class Connection(Protocol):
    """A source of data."""

    def process(self, data: bytes) -> None:
        """Process queued data."""


class FairQueue:
    """Processes one piece of data at a time and rests afterwards, in proportion to the work.

    Clients therefore occupy the event loop and the interpreter for at most a quarter of the time,
    independent of their number and data. On a busy computer, the queue rests longer. There are two
    lines, which are served alternately. Within a line, connections are served round robin.

    Args:
        loop: Event loop in which the data is processed.
        worked: Callback that returns the CPU time of the loop's thread [s].
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, worked: Callable[[], float] = time.thread_time
    ) -> None:
        self._loop, self._worked = loop, worked
        self._lines: list[dict[Connection, list[bytes]]] = [{}, {}]
        self._priority, self._ordinary = self._lines
        self._running = False
        self._rested = 0.0  # time at which all rest so far is over [s]

    def put(self, connection: Connection, data: bytes, priority: bool) -> None:
        """Add data after other data of its connection.

        Args:
            connection: Source of the data.
            data: The data.
            priority: True for the line with fewer connections.
        """
        queued = next((line for line in self._lines if connection in line), None)
        line = (self._priority if priority else self._ordinary) if queued is None else queued
        pieces = line.setdefault(connection, [])
        pieces += (data[begin : begin + CHUNK] for begin in range(0, len(data), CHUNK))
        if not self._running:
            self._process_next()

    def has(self, connection: Connection) -> bool:
        """Return True if data of a connection is queued."""
        return any(connection in line for line in self._lines)

    def remove(self, connection: Connection) -> None:
        """Drop the data of a connection."""
        for line in self._lines:
            line.pop(connection, None)

    def _process_next(self) -> None:
        self._lines.reverse()
        line = next(filter(None, self._lines), None)
        self._running = line is not None
        if line:
            connection = next(iter(line))
            piece, *more = line.pop(connection)
            if more:
                line[connection] = more
            begin, worked = self._loop.time(), self._worked()
            try:
                connection.process(piece)
            finally:  # callbacks of the processing run before the rest
                self._loop.call_soon(self._rest, begin, worked)

    def _rest(self, begin: float, worked: float) -> None:
        now, work = self._loop.time(), self._worked() - worked
        rest = REST_FACTOR * work + busy_rest(now - begin, work)
        self._rested = max(self._rested, now) + rest
        self._loop.call_later(max(0.0, self._rested - MAX_DEBT - now), self._process_next)
