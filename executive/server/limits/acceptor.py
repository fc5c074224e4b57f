"""New connections: a stop does not wait behind others, and abandoned ones cost little."""

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import Any

from .connections import HEAD_END, MAX_HEAD, HttpConnection, SharedState
from .quick_stop import QuickStop
from .token_bucket import TokenBucket

logger = logging.getLogger(__name__)

_AT_ONCE = 64  # connections that are accepted in one turn of the loop
_RETRY_SECONDS = 0.1  # pause if the operating system cannot accept a connection [s]
_TCP_ESTABLISHED = 1  # first byte of TCP_INFO while the client has not closed its side


class Acceptor:
    """Accepts connections, and serves one in each turn of the loop.

    A whole stop is served at once. A connection that ends before the head of its request is
    complete is closed, and never served. All others wait; if there are too many, those that
    ended are closed, or else the one that waits for longest.

    Args:
        loop: Event loop of the server.
        listener: Socket that listens; it must not block.
        state: Who may call, and how many connections may wait.
        protocol: Makes the protocol that serves a connection.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        listener: socket.socket,
        state: SharedState,
        protocol: Callable[[], HttpConnection],
    ) -> None:
        self._loop, self._listener = loop, listener
        self._rules, self._max_waiting = state.rules, state.max_connections
        self._protocol = protocol
        self._waiting: dict[socket.socket, None] = {}  # oldest first
        self._tasks: set[asyncio.Task[Any]] = set()
        self._log_bucket = TokenBucket(0.1, 1.0, loop.time)
        self._retry: asyncio.TimerHandle | None = None
        self._turn: asyncio.Handle | None = None  # serves the next one
        self._start()

    def close(self) -> None:
        """Accept no more, and close the connections that wait."""
        if self._retry:
            self._retry.cancel()
        self._loop.remove_reader(self._listener)
        for connection in tuple(self._waiting):
            self._leave(connection)
            connection.close()

    def _start(self) -> None:
        self._loop.add_reader(self._listener, self._accept)

    def _accept(self) -> None:
        for _ in range(_AT_ONCE):
            try:
                connection, _ = self._listener.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                self._loop.remove_reader(self._listener)
                self._retry = self._loop.call_later(_RETRY_SECONDS, self._start)
                if self._log_bucket.take():
                    logger.error("Cannot accept a connection: %s", error.strerror)
                return
            self._examine(connection)

    def _examine(self, connection: socket.socket) -> None:
        """Serve a whole stop, close an abandoned connection, and let every other one wait."""
        data = _peek(connection)
        if data is None:
            connection.close()
        elif QuickStop.find(data, self._rules):
            self._serve(connection, stops=True)
        else:
            if not data:
                self._loop.add_reader(connection, self._examine_again, connection)
            self._wait(connection)

    def _examine_again(self, connection: socket.socket) -> None:
        self._leave(connection)
        self._examine(connection)

    def _wait(self, connection: socket.socket) -> None:
        self._waiting[connection] = None
        self._turn = self._turn or self._loop.call_soon(self._serve_next)
        if len(self._waiting) > self._max_waiting:
            oldest = next(iter(self._waiting))
            abandoned = [each for each in self._waiting if _peek(each) is None]
            for each in abandoned or [oldest]:
                self._leave(each)
                each.close()

    def _leave(self, connection: socket.socket) -> None:
        del self._waiting[connection]
        self._loop.remove_reader(connection)

    def _serve_next(self) -> None:
        while self._waiting:
            connection = next(iter(self._waiting))
            self._leave(connection)
            if _peek(connection) is not None:
                self._serve(connection)
                break
            connection.close()
        self._turn = self._loop.call_soon(self._serve_next) if self._waiting else None

    def _serve(self, connection: socket.socket, stops: bool = False) -> None:
        connection.setblocking(False)
        protocol = self._protocol()
        protocol.stopping = stops
        serving = self._loop.connect_accepted_socket(lambda: protocol, connection)
        task = self._loop.create_task(serving)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _peek(connection: socket.socket) -> bytes | None:
    """Return what has arrived, or None if the head of a request will never be complete."""
    try:
        data = connection.recv(MAX_HEAD, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except BlockingIOError:
        return b""
    except OSError:
        return None
    if HEAD_END.search(data):
        return data
    state = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0]
    return data if data and state == _TCP_ESTABLISHED else None
