"""Who is heard next: what connections bring in waits its turn, and only a stop does not."""

import asyncio
import time
from collections.abc import Callable
from typing import Protocol

CHUNK = 1024  # [bytes] of messages that are read at a time, so that no turn is long
REST_FACTOR = (
    3.0  # times the work of a turn, before the next one: the loop is there for the arm, too
)
MAX_DEBT = 0.02  # [s] of rest that may be owed, so that who asks little need not wait for it


class Connection(Protocol):
    """What brings something in."""

    def process(self, data: bytes) -> None:
        """Its turn has come."""


class FairQueue:
    """Lets in one piece after another, and rests after each in proportion to the work it was.

    So strangers may occupy the loop, and the interpreter, for a part of the time only, whatever
    they send and however many they are.

    Args:
        loop: On which the work is done.
        worked: What the loop's thread has worked so far [s].
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, worked: Callable[[], float] = time.thread_time
    ) -> None:
        self._loop, self._worked = loop, worked
        self._lines: list[dict[Connection, list[bytes]]] = [{}, {}]
        self._first, self._others = self._lines
        self._under_way = False
        self._rested = 0.0  # when all that is owed will have been rested [s]

    def put(self, connection: Connection, data: bytes, first: bool) -> None:
        """Have a piece wait; those who are `first` and all others are heard by turns."""
        behind = next((line for line in self._lines if connection in line), None)
        line = (self._first if first else self._others) if behind is None else behind
        line.setdefault(connection, []).append(data)
        if not self._under_way:
            self._next()

    def has(self, connection: Connection) -> bool:
        """Whether something of a connection waits."""
        return any(connection in line for line in self._lines)

    def remove(self, connection: Connection) -> None:
        """Forget what waits of a connection."""
        for line in self._lines:
            line.pop(connection, None)

    def _next(self) -> None:
        self._lines.reverse()
        line = next(filter(None, self._lines), None)
        self._under_way = line is not None
        if line:
            connection = next(iter(line))
            piece, *more = line.pop(connection)
            if more:
                line[connection] = more
            begun = self._worked()
            try:
                connection.process(piece)
            finally:  # what is done for it has its place on the loop before the rest
                self._loop.call_soon(self._rest, begun)

    def _rest(self, begun: float) -> None:
        now = self._loop.time()
        self._rested = max(self._rested, now) + REST_FACTOR * (self._worked() - begun)
        self._loop.call_later(max(0.0, self._rested - MAX_DEBT - now), self._next)
