"""New connections: a stop does not wait for others, and abandoned connections cost little."""

import asyncio
import contextlib
import logging
import selectors
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from typing import Any

from executive.api.outcome import CancelResult
from executive.api.token_bucket import TokenBucket

from .connections import HEAD_SECONDS, MAX_HEAD, HttpConnection, SharedState, peek
from .fair_queue import busy_rest
from .quick_stop import QuickStop

logger = logging.getLogger(__name__)

_AT_ONCE = 64  # largest number of connections accepted, and then queued, in one turn of the loop
_RETRY_SECONDS = 0.1  # pause if the operating system cannot accept a connection [s]


class Acceptor:
    """Accepts connections, and serves one in each turn of the loop.

    A complete stop is executed at once, without a protocol, and its connection is closed after the
    answer. To find it early among many connections, all others stay in a list of new connections
    until the kernel has no more, or the list is full; to queue and to close them takes longer than
    to accept them.

    A connection that ends before the head of its request is complete is closed without
    service. A silent connection waits for data, because most stops arrive just after their
    connection and a protocol costs several times as much as a stop. All other connections wait for
    service. If too many wait, those that have ended are closed. If none has ended, the oldest
    connection is closed. A connection with a stop is closed last.

    Args:
        loop: Event loop of the server.
        listener: Socket that listens; it must not block.
        state: Rules of access, and the largest numbers of connections.
        protocol: Callback that makes the protocol for a connection from the time of its acceptance.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        listener: socket.socket,
        state: SharedState,
        protocol: Callable[[float], HttpConnection],
    ) -> None:
        self._loop, self._listener = loop, listener
        self._rules, self._max_waiting = state.rules, state.max_connections
        self._protocol, self._stop, self._max_new = protocol, state.stop, state.max_new
        self._accepted: dict[socket.socket, float] = {}  # time of acceptance [s], oldest first
        # Accepted connections that are new, with their first data; those without data, with data,
        # and with a stop. A reader and a timer of the loop for each silent connection would
        # take longer than one selector and one timer.
        self._new: dict[socket.socket, bytes | None] = {}
        self._silent = selectors.DefaultSelector()
        self._waiting: dict[socket.socket, None] = {}
        self._stopping = set[socket.socket]()
        self._tasks: set[asyncio.Task[Any]] = set()
        self._log_bucket = TokenBucket(0.1, 1.0, loop.time)
        self._next: asyncio.Handle | None = None  # callback for the next connections
        self._expiry: asyncio.TimerHandle | None = None  # callback for the oldest connection
        self._turn: asyncio.Handle | None = None  # callback that serves the next connection
        loop.add_reader(self._silent.fileno(), self._examine_silent)
        self._start()

    async def close(self) -> None:
        """Accept no more connections, and close the waiting ones. Wait until all others started."""
        for handle in self._next, self._expiry:
            if handle:
                handle.cancel()
        self._loop.remove_reader(self._listener)
        for connection in tuple(self._accepted):
            self._close(connection)
        self._loop.remove_reader(self._silent.fileno())
        self._silent.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _start(self) -> None:
        self._loop.add_reader(self._listener, self._accept)
        if self._new:
            self._accept()

    def _accept(self) -> None:
        if self._next:
            self._next.cancel()
        begin, cpu = self._loop.time(), time.thread_time()
        pause, empty = 0.0, False
        try:
            for _ in range(min(_AT_ONCE, self._max_new - len(self._new))):
                connection, _ = self._listener.accept()
                self._accepted[connection] = self._loop.time()
                data = peek(connection)
                if not self._execute_stop(connection, data):
                    self._new[connection] = data
        except (BlockingIOError, InterruptedError, ConnectionAbortedError):
            empty = True
        except OSError as error:
            pause, empty = _RETRY_SECONDS, True
            if self._log_bucket.take():
                logger.error("Cannot accept a connection: %s", error.strerror)
        if empty or len(self._new) == self._max_new:
            self._queue_new()
        worked = time.thread_time() - cpu
        # Not longer than the work, so that the kernel's queue of new connections stays short.
        rest = min(worked, busy_rest(self._loop.time() - begin, worked))
        if pause := max(pause, rest):
            self._loop.remove_reader(self._listener)
            self._next = self._loop.call_later(pause, self._start)
        elif self._new:
            self._next = self._loop.call_soon(self._accept)

    def _execute_stop(self, connection: socket.socket, data: bytes | None) -> bool:
        """Execute the stop in the first data of a connection. Return False if there is none."""
        stop = QuickStop.find(data, self._rules) if data else None
        if stop:
            self._stopping.add(connection)
            answer = partial(self._answer, connection, replace(stop, keeps=False))
            self._stop().add_done_callback(answer)
        return stop is not None

    def _queue_new(self) -> None:
        """Queue the oldest of the new connections."""
        for connection, data in tuple(islice(self._new.items(), _AT_ONCE)):
            if connection in self._new:
                del self._new[connection]
                self._queue(connection, data)

    def _queue(self, connection: socket.socket, data: bytes | None) -> None:
        """Queue a connection, or close it if it was abandoned."""
        if data is None:
            self._close(connection)
        elif data:
            self._waiting[connection] = None
            self._turn = self._turn or self._loop.call_soon(self._serve_next)
        else:
            self._silent.register(connection, selectors.EVENT_READ, connection)
            self._expiry = self._expiry or self._loop.call_later(HEAD_SECONDS, self._close_expired)
        self._make_room()

    def _examine_silent(self) -> None:
        """Execute the stop of each silent connection that has data now, or queue it again."""
        for key, _ in self._silent.select(0):
            if (connection := key.data) in self._accepted:
                self._silent.unregister(connection)
                data = peek(connection)
                if not self._execute_stop(connection, data):
                    self._queue(connection, data)

    def _close_expired(self) -> None:
        """Close the connections that are silent for too long."""
        self._expiry, since = None, self._loop.time() - HEAD_SECONDS
        for connection, accepted in tuple(self._accepted.items()):
            if accepted > since:
                self._expiry = self._loop.call_later(accepted - since, self._close_expired)
                break
            if connection in self._silent.get_map():
                self._close(connection)

    def _answer(
        self, connection: socket.socket, stop: QuickStop, stopped: asyncio.Future[CancelResult]
    ) -> None:
        stop.log()
        if connection not in self._stopping:
            return  # the connection was closed
        self._leave(connection)
        with contextlib.suppress(OSError), connection:
            connection.setblocking(False)
            connection.recv(MAX_HEAD)  # with unread data, the client would lose the answer
            connection.send(stop.answer(stopped))

    def _make_room(self) -> None:
        if len(self._accepted) - len(self._new) <= self._max_waiting:
            return
        others = (each for each in self._accepted if each not in self._stopping)
        oldest = next(chain(others, self._accepted))
        for each in [each for each in self._waiting if peek(each) is None] or [oldest]:
            self._close(each)

    def _close(self, connection: socket.socket) -> None:
        self._leave(connection)
        connection.close()

    def _leave(self, connection: socket.socket) -> float:
        """Forget a connection. Return the time of its acceptance."""
        self._stopping.discard(connection)
        self._new.pop(connection, None)
        self._waiting.pop(connection, None)
        with contextlib.suppress(KeyError):
            self._silent.unregister(connection)
        return self._accepted.pop(connection)

    def _serve_next(self) -> None:
        while self._waiting:
            connection = next(iter(self._waiting))
            accepted = self._leave(connection)
            if peek(connection) is not None:
                self._serve(connection, accepted)
                break
            connection.close()
        self._turn = self._loop.call_soon(self._serve_next) if self._waiting else None

    def _serve(self, connection: socket.socket, accepted: float) -> None:
        connection.setblocking(False)
        protocol = partial(self._protocol, accepted)
        serving = self._loop.connect_accepted_socket(protocol, connection)
        task = self._loop.create_task(serving)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
