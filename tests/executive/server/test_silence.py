"""Silence on a connection: heartbeats while the other end runs, timeouts if it does not."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from armtree import AsyncClient, Client, Refused, ServerUnreachable
from executive.client import transport
from executive.server import event_hub
from tests.support.servers.foreign_clients import head, raw
from tests.support.servers.serving import Serve

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]


@pytest.fixture
def mute() -> Iterator[str]:
    """The URL of a server that starts its answers and then sends nothing more."""
    over = threading.Event()

    def begin() -> None:
        with suppress(OSError):  # it is shut down
            while True:
                connection, _ = listener.accept()
                threads.append(threading.Thread(target=hold, args=(connection,)))
                threads[-1].start()

    def hold(connection: socket.socket) -> None:
        with connection:
            connection.recv(4096)
            kind = b"content-type: text/event-stream"
            connection.sendall(b"HTTP/1.1 200 OK\r\n" + kind + b"\r\n\r\n: armtree\n\n")
            over.wait()

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threads = [threading.Thread(target=begin)]
        threads[0].start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        over.set()
        listener.shutdown(socket.SHUT_RDWR)
        for thread in threads:
            thread.join()


def test_a_stream_without_events_has_a_heartbeat(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_hub, "HEARTBEAT", 0.01)
    served = serve()
    with raw(served, "GET /api/events?events=log HTTP/1.1", *head(served, "")[1:]) as watching:
        pieces = iter(lambda: watching.recv(4096), b"")
        assert next(piece for piece in pieces if b": still here\n\n" in piece)
    with served.client() as client, client.events("status") as events:
        goal = client.send(11)
        assert getattr(next(events), "identity", "") == goal  # a heartbeat is not an event


def test_a_silent_stream_times_out(mute: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "SILENCE_TIMEOUT", 0.05)
    with (
        Client(mute, "token") as client,
        client.events() as events,
        pytest.raises(ServerUnreachable, match=r"nothing came for 0\.05 s"),
    ):
        next(events)

    async def watch() -> None:
        async with AsyncClient(mute, "token") as client, client.events() as events:
            with pytest.raises(ServerUnreachable, match=r"nothing came for 0\.05 s"):
                await anext(events)

    asyncio.run(watch())


@pytest.mark.parametrize(
    ("name", "changes"), [("where", False), ("status", False), ("stop", True), ("cancel", True)]
)
def test_only_a_request_that_changes_something_may_be_executed_later(
    mute: str, monkeypatch: pytest.MonkeyPatch, name: str, changes: bool
) -> None:
    monkeypatch.setattr(transport, "ANSWER_TIMEOUT", 0.05)
    with Client(mute, "token") as client, pytest.raises(ServerUnreachable) as silent:
        getattr(client, name)()
    assert ("It may execute the request later" in str(silent.value)) is changes

    async def call() -> None:
        async with AsyncClient(mute, "token") as client:
            await getattr(client, name)()

    with pytest.raises(ServerUnreachable) as silent:
        asyncio.run(call())
    assert ("It may execute the request later" in str(silent.value)) is changes


def test_waiting_for_a_goal_times_out_if_the_server_hangs(
    mute: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "POLL_PERIOD", 0.05)
    monkeypatch.setattr(transport, "ANSWER_TIMEOUT", 0.05)
    with Client(mute, "token") as client:
        with pytest.raises(ServerUnreachable, match="does not answer: its answer takes"):
            client.result("ab" * 16)
        with client.hold("ab" * 16):
            pass  # the end of a hold needs no answer

    async def wait() -> None:
        async with AsyncClient(mute, "token") as client:
            with pytest.raises(ServerUnreachable, match="does not answer: its answer takes"):
                await client.result("ab" * 16)
            async with client.hold("ab" * 16):
                pass

    asyncio.run(wait())


def test_waiting_for_a_goal_is_split_into_requests(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "POLL_PERIOD", 0.01)
    served = serve()
    with served.client() as client:
        goal = client.send(10)
        with pytest.raises(Refused, match=r"has not ended within 0\.05 s") as refused:
            client.result(goal, 0.05)
        assert refused.value.code == "goal.result_timeout"
        canceling = threading.Timer(0.05, client.cancel)
        canceling.start()
        assert client.result(goal).code == "goal.canceled"
        canceling.join()

    async def wait() -> None:
        async with AsyncClient(served.server.url) as client:
            goal = await client.send(10)
            with pytest.raises(Refused, match=r"has not ended within 0\.05 s"):
                await client.result(goal, 0.05)
            waiting = asyncio.create_task(client.result(goal))
            await client.cancel()
            assert (await waiting).code == "goal.canceled"

    asyncio.run(wait())


def test_a_late_heartbeat_is_no_silence() -> None:
    assert transport.SILENCE_TIMEOUT >= 3 * event_hub.HEARTBEAT


def test_both_ends_use_tcp_keepalive(serve: Serve) -> None:
    served = serve()
    port = f":{served.server.port:04X}"

    def keeping_alive() -> set[bool]:
        """For each connection with a running keep-alive timer: True for the server's end."""
        rows = [row.split() for row in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        ends = [row for row in rows if row[3] == "01" and row[5].startswith("02:")]
        return {row[1].endswith(port) for row in ends if port in row[1] + row[2]}

    with served.client() as client, client.events("log"):
        # The timer may be of a byte in flight.
        assert any(keeping_alive() == {True, False} for _ in range(1000))
