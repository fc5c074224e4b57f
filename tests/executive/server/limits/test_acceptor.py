"""New connections: which are served, and in which order."""

import asyncio
import contextlib
import errno
import os
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain
from queue import SimpleQueue
from types import SimpleNamespace
from typing import Any

import pytest

from executive.api.outcome import CancelResult
from executive.server.limits import acceptor, connections
from executive.server.limits.acceptor import Acceptor
from executive.server.limits.cancel_thread import CancelThread
from executive.server.limits.connections import HttpConnection
from executive.server.limits.fair_queue import FairQueue
from tests.support.servers.foreign_clients import answer, raw, stops
from tests.support.servers.serving import Serve, Served

pytest_plugins = ["tests.support.servers.server_fixtures"]

STOP = "POST /api/stop HTTP/1.1"


STOPPED = 0  # in place of a port


class Watch:
    """The clients that are served, by port, and a loop that is held until it is released."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.served: list[int] = []
        self._released, self._held = threading.Event(), threading.Event()
        self._released.set()
        connection_made = HttpConnection.connection_made

        def made(connection: HttpConnection, transport: asyncio.Transport) -> None:
            self._held.set()
            self._released.wait(60)
            self.served.append(transport.get_extra_info("peername")[1])
            connection_made(connection, transport)

        stop = CancelThread.stop

        def stopped(thread: CancelThread) -> asyncio.Future[CancelResult]:
            self.served.append(STOPPED)
            return stop(thread)

        monkeypatch.setattr(HttpConnection, "connection_made", made)
        monkeypatch.setattr(CancelThread, "stop", stopped)

    @contextlib.contextmanager
    def hold(self, served: Served) -> Iterator[None]:
        """What connects meanwhile is accepted later, in one turn."""
        self._held.clear()
        self._released.clear()
        with raw(served, STOP):
            assert self._held.wait(60)
            try:
                yield
            finally:
                self._released.set()


def port(connection: socket.socket) -> int:
    return int(connection.getsockname()[1])


def is_open(connection: socket.socket) -> bool:
    """Return True unless the server has closed the connection or sent data."""
    return not select.select([connection], [], [], 0)[0]


@pytest.mark.parametrize(
    "lines", [[], [STOP], [STOP, "host: here"]], ids=["nothing", "a line", "half a head"]
)
@pytest.mark.parametrize("reset", [False, True], ids=["closed", "reset"])
def test_an_abandoned_connection_is_never_served(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, lines: list[str], reset: bool
) -> None:
    served, watch = serve(), Watch(monkeypatch)
    abandoned = []
    with watch.hold(served):
        for _ in range(100):
            with raw(served, *lines) as connection:
                abandoned.append(port(connection))
                if reset:
                    linger = b"\1\0\0\0" + bytes(4)
                    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        goal = served.executive.send(10).identity
    assert goal in served.ask("POST", "/api/stop", token=False)[1]["goals"]
    assert stops(served)
    assert not set(abandoned) & set(watch.served)


def test_a_whole_stop_overtakes_all_that_wait(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    watch, served = Watch(monkeypatch), serve()
    own = f"host: 127.0.0.1:{served.server.port}"
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            others = [stack.enter_context(raw(served, STOP)) for _ in range(20)]
            others += [
                stack.enter_context(raw(served, "GET /api/health HTTP/1.1", own, "", ""))
                for _ in range(20)
            ]
            stop = stack.enter_context(raw(served, STOP, own, "connection: close", "", ""))
        assert answer(stop).startswith(b"HTTP/1.1 200")
        assert stops(served)
        ports = [port(each) for each in others]
        order = [each for each in watch.served if each in (STOPPED, *ports)]
        assert order[0] == STOPPED
        for each in others[20:]:
            assert each.recv(9000).startswith(b"HTTP/1.1 200")


def test_a_request_of_a_client_that_sends_no_more_is_answered(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served, watch = serve(), Watch(monkeypatch)
    lines = ("GET /api/health HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", "", "")
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            connection = stack.enter_context(raw(served, *lines))
            connection.shutdown(socket.SHUT_WR)
        assert connection.recv(9000).startswith(b"HTTP/1.1 200")


def test_if_too_many_wait_the_oldest_is_closed(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 4)
    served, watch = serve(), Watch(monkeypatch)
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            waiting = [stack.enter_context(raw(served)) for _ in range(20)]
        assert answer(waiting[0]) == b""
        assert port(waiting[0]) not in watch.served
        assert stops(served)


def test_a_stop_is_executed_before_earlier_connections_are_closed_to_make_room(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To queue and to close a connection takes longer than to accept it and to find its stop."""
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 4)
    watch, stop = Watch(monkeypatch), CancelThread.stop
    silent, open_at_stop = list[socket.socket](), list[int]()

    def stopped(thread: CancelThread) -> asyncio.Future[CancelResult]:
        open_at_stop.append(sum(map(is_open, silent)))
        return stop(thread)

    monkeypatch.setattr(CancelThread, "stop", stopped)
    served = serve()
    own = f"host: 127.0.0.1:{served.server.port}"
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            silent += [stack.enter_context(raw(served)) for _ in range(7)]
            last = stack.enter_context(raw(served, STOP, own, "connection: close", "", ""))
        assert answer(last).startswith(b"HTTP/1.1 200")
        assert open_at_stop == [7]
        assert answer(silent[0]) == b""
        assert stops(served)


def test_as_many_connections_as_one_turn_accepts_do_not_wait_for_another_one(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(acceptor, "_AT_ONCE", 4)
    monkeypatch.setattr(acceptor, "busy_rest", lambda seconds, worked: 0.0)
    served, watch = serve(), Watch(monkeypatch)
    lines = "GET / HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", "connection: close", "", ""
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            clients = [stack.enter_context(raw(served, *lines)) for _ in range(4)]
        assert all(answer(client).startswith(b"HTTP/1.1 200") for client in clients)


def test_a_connection_that_follows_does_not_close_that_of_a_stop(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 1)
    served, watch = serve(), Watch(monkeypatch)
    own = f"host: 127.0.0.1:{served.server.port}"
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            stop = stack.enter_context(raw(served, STOP, own, "connection: close", "", ""))
            stack.enter_context(raw(served))
        assert answer(stop).startswith(b"HTTP/1.1 200")


def test_a_stop_on_a_connection_that_was_silent_needs_no_protocol(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served, watch = serve(), Watch(monkeypatch)
    own = f"host: 127.0.0.1:{served.server.port}"
    with raw(served) as connection:
        assert stops(served)  # the connection has been accepted
        connection.sendall(f"{STOP}\r\n{own}\r\n\r\n".encode())
        assert answer(connection).startswith(b"HTTP/1.1 200")
        assert port(connection) not in watch.served


def test_connections_that_stay_silent_are_closed(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(acceptor, "HEAD_SECONDS", 0.1)
    served = serve()
    with raw(served) as first:
        assert stops(served)  # the first one has been accepted
        with raw(served) as second:
            assert answer(first) == answer(second) == b""


def test_silent_connections_do_not_close_a_later_one_that_has_sent_data(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 4)
    served, watch = serve(), Watch(monkeypatch)
    lines = ("GET /api/health HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", "", "")
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            silent = [stack.enter_context(raw(served)) for _ in range(20)]
            request = stack.enter_context(raw(served, *lines))
        assert answer(silent[0]) == b""
        assert request.recv(9000).startswith(b"HTTP/1.1 200")


def test_older_connections_with_half_a_request_do_not_close_that_of_a_stop_whose_data_comes_later(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 4)
    served, watch = serve(), Watch(monkeypatch)
    own = f"host: 127.0.0.1:{served.server.port}"
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            for _ in range(4):
                stack.enter_context(raw(served, STOP))
            silent = stack.enter_context(raw(served))
        assert stops(served)  # the connections have been accepted
        silent.sendall(f"{STOP}\r\n{own}\r\n\r\n".encode())
        assert answer(silent).startswith(b"HTTP/1.1 200")


def test_a_connection_that_ended_makes_room_before_an_older_silent_one(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 2)
    served, watch, accepted = serve(), Watch(monkeypatch), threading.Event()
    own = f"host: 127.0.0.1:{served.server.port}"
    with contextlib.ExitStack() as stack:
        with watch.hold(served):
            silent = stack.enter_context(raw(served))
            ended = stack.enter_context(raw(served, STOP))
            last = stack.enter_context(raw(served))

            def ends(connection: socket.socket) -> bytes | None:
                data = connections.peek(connection)
                if data:
                    ended.close()
                elif connection.getpeername()[1] == port(last):
                    accepted.set()
                return data

            monkeypatch.setattr(acceptor, "peek", ends)
        assert accepted.wait(60)
        silent.sendall(f"{STOP}\r\n{own}\r\n\r\n".encode())
        assert answer(silent).startswith(b"HTTP/1.1 200")


def test_the_time_for_a_head_counts_from_the_acceptance_of_a_silent_connection(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, deadlines = HttpConnection.connection_made, SimpleQueue[float]()

    def noted(connection: HttpConnection, transport: asyncio.Transport) -> None:
        made(connection, transport)
        assert connection._head_timer
        deadlines.put(connection._head_timer.when())

    served = serve()
    monkeypatch.setattr(HttpConnection, "connection_made", noted)
    with raw(served) as connection:
        assert stops(served)  # the connection has been accepted
        latest = time.monotonic() + connections.HEAD_SECONDS
        connection.sendall(STOP.encode())
        assert deadlines.get(timeout=60) <= latest


def test_a_request_that_waited_longer_than_a_head_may_take_is_answered(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.0)
    served = serve()
    own = f"host: 127.0.0.1:{served.server.port}"
    with raw(served, "GET /api/health HTTP/1.1", own, "", "") as connection:
        assert connection.recv(9000).startswith(b"HTTP/1.1 200")


def test_an_accept_that_fails_is_tried_again(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    served = serve()
    accept, fails = socket.socket.accept, iter(range(3))

    def failing(listener: socket.socket) -> tuple[socket.socket, object]:
        if listener.getsockname()[1] == served.server.port and next(fails, None) is not None:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        return accept(listener)

    monkeypatch.setattr(socket.socket, "accept", failing)
    assert stops(served)
    messages = [each.message for each in caplog.records if "accept" in each.message]
    assert messages == ["Cannot accept a connection: Too many open files"]


class Hold:
    """A fair queue that processes nothing until it is released."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self._given = SimpleQueue[tuple[FairQueue, HttpConnection, bytes, bool]]()
        patch.setattr(FairQueue, "put", lambda *given: self._given.put(given))

    def wait(self) -> Callable[[], object]:
        """Wait until data is put into it; return what releases this data."""
        queue, connection, data, priority = self._given.get(timeout=60)
        return lambda: queue._loop.call_soon_threadsafe(
            partial(queue.put, connection, data, priority)
        )


def test_connections_that_ended_make_room_before_one_that_waits_to_be_processed(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.server.server.MAX_CONNECTIONS", 4)
    served = serve()
    own = f"host: 127.0.0.1:{served.server.port}"
    with contextlib.ExitStack() as stack:
        with monkeypatch.context() as patch:
            hold = Hold(patch)
            waiting = stack.enter_context(raw(served, "GET /api/health HTTP/1.1", own, "", ""))
            release = hold.wait()
            for _ in range(8):
                with raw(served, STOP):
                    hold.wait()
        release()
        assert waiting.recv(9000).startswith(b"HTTP/1.1 200")


def test_a_client_does_not_time_out_while_its_data_waits_to_be_processed(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served, late = serve(), threading.Event()
    own = f"host: 127.0.0.1:{served.server.port}"
    timed_out = HttpConnection._head_timed_out

    def timer(connection: HttpConnection) -> None:
        patch.setattr(connections, "HEAD_SECONDS", 60.0)
        timed_out(connection)
        late.set()

    with contextlib.ExitStack() as stack:
        with monkeypatch.context() as patch:
            hold = Hold(patch)
            patch.setattr(FairQueue, "has", lambda queue, connection: True)
            patch.setattr(HttpConnection, "_head_timed_out", timer)
            patch.setattr(connections, "HEAD_SECONDS", 0.01)
            waiting = stack.enter_context(raw(served, "GET /api/health HTTP/1.1", own, "", ""))
            release = hold.wait()
            assert late.wait(60)
        release()
        assert waiting.recv(9000).startswith(b"HTTP/1.1 200")


def test_little_of_what_a_client_sends_waits_in_memory(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served, sizes, put, passed = serve(), list[int](), FairQueue.put, threading.Event()
    own = f"host: 127.0.0.1:{served.server.port}"

    def noted(queue: FairQueue, connection: HttpConnection, data: bytes, priority: bool) -> None:
        put(queue, connection, data, priority)
        waiting = chain.from_iterable(line.get(connection, ()) for line in queue._lines)
        sizes.append(sum(map(len, waiting)))
        if len(sizes) == 10:
            passed.set()

    monkeypatch.setattr(FairQueue, "put", noted)
    lines = "POST /api/stop HTTP/1.1", own, "transfer-encoding: chunked", ""
    with raw(served, *lines) as client:
        assert client.recv(9000).startswith(b"HTTP/1.1 200")
        client.sendall(b"1\r\nx\r\n" * 10_000)
        assert passed.wait(20)
    assert max(sizes) <= connections.READ_AT_ONCE


def test_a_client_that_connects_while_the_server_ends_is_known() -> None:
    """A connection that is not known would stay open."""
    made: list[asyncio.BaseTransport] = []

    class Protocol(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            made.append(transport)

    async def connect_and_end() -> None:
        accepted = asyncio.Event()

        def protocol(_: float) -> Any:
            accepted.set()
            return Protocol()

        state: Any = SimpleNamespace(rules=None, max_connections=1, max_new=2, stop=None)
        with socket.create_server(("127.0.0.1", 0)) as listener:
            listener.setblocking(False)
            accepting = Acceptor(asyncio.get_running_loop(), listener, state, protocol)
            with socket.create_connection(listener.getsockname()) as connection:
                connection.sendall(b"GET")
                await accepted.wait()
                assert not made
                await accepting.close()
                made.pop().close()

    asyncio.run(connect_and_end())
