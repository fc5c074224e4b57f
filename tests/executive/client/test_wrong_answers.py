"""Another program, or another version, answers in place of the server."""

import asyncio
import gzip
import json
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from armtree import AsyncClient, Client
from executive.api.outcome import Cause
from executive.client import responses
from executive.errors import ClientError, Refused, ServerUnreachable, WrongAnswer
from hardware import RealClock

Say = Callable[[bytes], str]
DEEP = b"[" * 100_000
GOAL = "0123456789abcdef" * 2


@pytest.fixture
def say() -> Iterator[Say]:
    """Starts a program that answers every request with these bytes; returns its URL."""
    listeners: list[socket.socket] = []

    def start(data: bytes) -> str:
        listener = socket.create_server(("127.0.0.1", 0))
        listeners.append(listener)
        threading.Thread(target=serve, args=(listener, data), daemon=True).start()
        return f"http://127.0.0.1:{listener.getsockname()[1]}"

    def serve(listener: socket.socket, data: bytes) -> None:
        with suppress(OSError):  # the listener is closed
            while True:
                connection, _ = listener.accept()
                with connection, suppress(OSError):
                    connection.recv(65_536)
                    connection.sendall(data)
                    connection.shutdown(socket.SHUT_WR)
                    while connection.recv(65_536):  # closing earlier would reset the connection
                        pass

    yield start
    for listener in listeners:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def http(body: bytes, status: str = "200 OK", *headers: str) -> bytes:
    length, closed = f"content-length: {len(body)}", "connection: close"  # as `serve` does
    lines = [f"HTTP/1.1 {status}", length, closed, *headers, "", ""]
    return "\r\n".join(lines).encode() + body


STATUS: dict[str, object] = {
    "arm": "active",
    "fault": None,
    "port": "",
    "commanded": None,
    "goal": None,
}
STATUS |= {"percentage": None, "phase": "", "node": "", "attempt": 1, "waiting": []}
STATUS |= {"policy": "reject", "paused": False, "breakpoints": [], "stops": 0}
STATUS |= {"uptime_s": 1.0, "time_s": 2.0}

WRONG = {
    "text": http(b"<html>hello"),
    "nothing": http(b""),
    "a list": http(b"[]"),
    "a number": http(b"1"),
    "other keys": http(b'{"ok": true}'),
    "other types": http(json.dumps(STATUS | {"arm": 1, "goal": [], "waiting": 1}).encode()),
    "another state": http(json.dumps(STATUS | {"arm": "sleeping"}).encode()),
    "NaN": http(b'{"arm": NaN}'),
    "deep": http(DEEP),
    "a long number": http(b"9" * 5000),
    "not UTF-8": http(b'{"arm": "\xff"}'),
    "a redirect": http(b"", "302 Found", "location: http://127.0.0.1:1/"),
    "another status": http(json.dumps(STATUS).encode(), "202 Accepted"),
    "an error without JSON": http(b"no", "404 Not Found"),
    "an error of another program": http(b'{"detail": "no"}', "404 Not Found"),
    "compressed": http(gzip.compress(bytes(10_000_000)), "200 OK", "content-encoding: gzip"),
    "too long": http(b" " * (responses.MAX_BYTES + 1)),
}


@pytest.mark.parametrize(
    "event",
    [
        {},
        {"event": "x"},
        {"event": ["node"]},
        {"event": "node"},
        {"event": "lifecycle", "label": 1},
    ],
)
def test_a_plan_with_other_events_is_an_error(say: Say, event: dict[str, object]) -> None:
    url = say(http(json.dumps({"events": [event], "unknown": []}).encode()))
    with Client(url, "x") as client, pytest.raises(WrongAnswer, match=url):
        client.plan(1)


@pytest.mark.parametrize("data", WRONG.values(), ids=WRONG)
def test_an_answer_of_another_program_is_an_error(say: Say, data: bytes) -> None:
    url = say(data)
    with Client(url, "x") as client:
        for call in (client.status, client.stop, client.goals, client.tasks, client.questions):
            with pytest.raises(WrongAnswer, match=url):
                call()
        for ask in (client.goal, client.pause, client.arm, client.result):
            with pytest.raises(WrongAnswer, match=url):
                ask(GOAL if ask != client.arm else "activate")
        with pytest.raises(WrongAnswer, match=url):
            client.send(1)


EVENTS = {
    "text": b"data: hello\n\n",
    "a list": b"data: []\n\n",
    "another kind": b'data: {"event": "x"}\n\n',
    "other keys": b'data: {"event": "node"}\n\n',
    "other types": b'data: {"event": "node", "time_s": "x", "path": 1, "name": [], "status": {}, '
    b'"message": null}\n\n',
    "deep": b"data: " + DEEP + b"\n\n",
    "too long": b"data: " + b" " * (responses.MAX_BYTES + 1),
}


@pytest.mark.parametrize("data", EVENTS.values(), ids=EVENTS)
def test_events_of_another_program_are_an_error(say: Say, data: bytes) -> None:
    url = say(b"HTTP/1.1 200 OK\r\nconnection: close\r\n\r\n: armtree\n\n" + data)
    with (
        Client(url, "x") as client,
        pytest.raises(WrongAnswer, match=url),
        client.events() as events,
    ):
        list(events)

    async def watch() -> None:
        async with AsyncClient(url, "x") as client, client.events() as events:
            async for _ in events:
                pass

    with pytest.raises(WrongAnswer, match=url):
        asyncio.run(watch())


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"HTTP/1.1 200 OK\r\ncontent-length: 99\r\n\r\n{",
        b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n9\r\n{",
    ],
)
def test_a_server_that_ends_in_the_middle_of_an_answer_is_unreachable(
    say: Say, data: bytes
) -> None:
    ended = pytest.raises(ServerUnreachable, match="the connection ended before the answer")
    with Client(say(data), "x") as client:
        with ended:
            client.status()
        with ended, client.events() as events:
            list(events)


def test_an_answer_that_does_not_end_is_an_error(say: Say, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.client.transport.ANSWER_TIMEOUT", 0.0)
    with Client(say(http(b"{}")), "x") as client, pytest.raises(ClientError):
        client.status()


OK = b"HTTP/1.1 200 OK\r\n"
SLOW: dict[str, tuple[bytes, bytes]] = {
    "head": (OK, b"a: b\r\n"),
    "body": (OK + b"content-length: 5000\r\n\r\n", b" "),
    "chunk": (OK + b"transfer-encoding: chunked\r\n\r\n1;", b"x"),
    "processing": (b"", b"HTTP/1.1 102 Processing\r\n\r\n"),
}


@pytest.fixture
def drip(request: pytest.FixtureRequest) -> Iterator[str]:
    """The URL of a program that answers every request slowly, without end."""
    first, piece = SLOW[request.param]
    over = threading.Event()

    def serve() -> None:
        with suppress(OSError):  # the listener is closed
            while True:
                connection, _ = listener.accept()
                threading.Thread(target=answer, args=(connection,), daemon=True).start()

    def answer(connection: socket.socket) -> None:
        with connection, suppress(OSError):  # the client has left
            connection.recv(65_536)
            connection.sendall(first)
            while not over.wait(0.01):
                connection.sendall(piece)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=serve, daemon=True).start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        over.set()
        listener.shutdown(socket.SHUT_RDWR)


class Fast(RealClock):
    """A clock that runs 25 times as fast, so that 10 s for an answer end after 0.4 s."""

    def now(self) -> float:
        return 25 * super().now()


@pytest.mark.slow
@pytest.mark.parametrize("drip", SLOW, indirect=True)
def test_a_slow_answer_has_one_deadline(drip: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.client.transport.ANSWER_TIMEOUT", 10.0)
    late = pytest.raises(ServerUnreachable, match="its answer takes more than 10 s")

    async def status() -> None:
        async with AsyncClient(drip, "x", clock=Fast()) as client:
            await client.status()

    with Client(drip, "x", clock=Fast()) as client:
        with late:
            client.status()
        with late:
            client.send(1)
    with late:
        asyncio.run(status())


@pytest.mark.slow
@pytest.mark.parametrize("drip", ["head", "processing"], indirect=True)
def test_the_head_of_events_has_a_deadline(drip: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.client.transport.ANSWER_TIMEOUT", 10.0)
    late = pytest.raises(ServerUnreachable, match="its answer takes more than 10 s")

    async def watch() -> None:
        async with AsyncClient(drip, "x", clock=Fast()) as client, client.events():
            pass

    with Client(drip, "x", clock=Fast()) as client, late, client.events():
        pass
    with late:
        asyncio.run(watch())


def test_an_error_of_the_server_is_not_one_of_another_program(say: Say) -> None:
    data = http(json.dumps(Cause("goal.busy", "no").to_json()).encode(), "409 Conflict")
    with Client(say(data), "x") as client, pytest.raises(Refused, match="no") as refused:
        client.send(1)
    assert refused.value.code == "goal.busy"


@pytest.mark.parametrize("url", ["http://[::1", "http://x:y", "http://x:99999", "http://a b"])
def test_an_invalid_url_is_an_error(url: str) -> None:
    with pytest.raises(ServerUnreachable), Client(url, "x") as client:
        client.status()
