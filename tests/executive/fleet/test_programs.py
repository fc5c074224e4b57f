"""`armtree fleet logs` fetches recordings from servers that arms have named."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import closing, nullcontext, suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest

from executive.api.outcome import Ending, GoalState
from executive.fleet import programs
from executive.fleet.errors import FleetError
from executive.fleet.fleet_client import FleetClient
from executive.fleet.nats_server import NatsOptions
from executive.fleet.programs import fetch_recording
from executive.fleet.values import Job, JobRecord
from hardware import ArmtreeError

JOB = Job("a" * 32, "bench", 1, {}, 1)


class Stored(FleetClient):
    """A fleet with one job.

    Args:
        url: URL that its arm has stored.
        recording: Path that its arm has stored.
    """

    def __init__(self, url: str, recording: str) -> None:
        result = Ending(GoalState.SUCCEEDED, "ok", "", recording=recording)
        self._record = JobRecord(JOB, "bench.0", url, "b" * 32, 1, result=result, ended_ns=2)

    async def job(self, identity: str) -> JobRecord:
        """The record."""
        return self._record


@pytest.fixture
def arm() -> Iterator[HTTPServer]:
    """A server that sends a file to whoever has the token, and notes what it got."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            given = self.headers.get("authorization", "")
            server.given.append((self.path, given))  # type: ignore[attr-defined]
            right = given == "Bearer secret" or "open" in self.path
            self.send_response(200 if right else 401)
            self.send_header("content-length", "3")
            self.end_headers()
            self.wfile.write(b"run")

        def log_message(self, *words: Any) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    server.given = []  # type: ignore[attr-defined]
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def fetch(arm: HTTPServer, folder: Path, recording: str, named: bool = False) -> bytes:
    url = f"http://127.0.0.1:{arm.server_port}"
    client, server = Stored(url, f"recordings/{recording}"), url if named else None
    return asyncio.run(fetch_recording(client, JOB.identity, folder, server)).read_bytes()


def test_only_a_server_that_the_user_names_gets_the_token(
    arm: HTTPServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("ARMTREE_TOKEN", "secret")
    with pytest.raises(FleetError, match=r"answers 401 .* --from URL"):
        fetch(arm, tmp_path, "1.mcap")
    assert fetch(arm, tmp_path, "open.mcap") == b"run"
    assert fetch(arm, tmp_path, "1.mcap", named=True) == b"run"
    path = "/api/recordings/{}/file".format
    assert arm.given == [  # type: ignore[attr-defined]
        (path("1.mcap"), ""),
        (path("open.mcap"), ""),
        (path("1.mcap"), "Bearer secret"),
    ]


_OK = b"HTTP/1.1 200 OK\r\n"
_SLOW = r"not give the file within 0\.2 s; copy recordings/1\.mcap from the machine of bench\.0$"


@pytest.mark.parametrize(
    ("first", "piece", "longest", "error"),
    [
        pytest.param(_OK, b"a: b\r\n", 0.2, _SLOW, id="head"),
        pytest.param(_OK + b"\r\n", b"x", 0.2, _SLOW, id="slow body"),
        pytest.param(_OK + b"\r\n", b"x" * 9000, 20.0, "it has more than 8000 bytes", id="body"),
    ],
)
def test_a_file_without_end_is_not_fetched(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    first: bytes,
    piece: bytes,
    longest: float,
    error: str,
) -> None:
    """Each read takes less than its limit, and nothing is left of the file."""
    monkeypatch.setattr(programs, "_FETCH_SECONDS", longest)
    monkeypatch.setattr(programs, "_MOST_FETCHED", 8000)

    async def send(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(first)
        with closing(writer), suppress(ConnectionError):
            while True:
                writer.write(piece)
                await writer.drain()
                await asyncio.sleep(0.01)

    async def main() -> None:
        async with await asyncio.start_server(send, "127.0.0.1", 0) as server:
            url = "http://{}:{}".format(*server.sockets[0].getsockname())
            with pytest.raises(ArmtreeError, match=error):
                await fetch_recording(Stored(url, "recordings/1.mcap"), JOB.identity, tmp_path)

    asyncio.run(main())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("status", "folder", "why"),
    [
        (-9, "", "nats-server has ended with status -9"),
        (None, "gone", "the data folder .* is gone"),
    ],
)
def test_the_fleet_ends_with_its_nats_server_and_with_its_data(
    status: int | None, folder: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if a library loses the first cancel of a task."""
    monkeypatch.setattr(programs, "_RETRY_SECONDS", 0.0)
    monkeypatch.setattr("executive.fleet.connection._RETRY_SECONDS", 0.0)

    class Process:
        """A process that was killed, or that runs."""

        def poll(self) -> int | None:
            return status

    async def supervise(*_: object) -> None:
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            await asyncio.Event().wait()

    monkeypatch.setattr(programs, "nats_server", lambda *_: nullcontext(Process()))
    monkeypatch.setattr(programs, "own_credentials", lambda _: {})
    monkeypatch.setattr(programs, "_supervise", supervise)
    with pytest.raises(FleetError, match=why):
        programs.up("nats://127.0.0.1:9", 0, NatsOptions(tmp_path / folder))


def test_a_failure_of_the_supervisor_ends_the_fleet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def supervise(*_: object) -> None:
        raise ValueError("a bug")

    monkeypatch.setattr(programs, "_RETRY_SECONDS", 0.0)
    monkeypatch.setattr(programs, "nats_server", lambda *_: nullcontext())
    monkeypatch.setattr(programs, "_supervise", supervise)
    with pytest.raises(ValueError, match="a bug"):
        programs.up("nats://127.0.0.1:9", 0, NatsOptions(tmp_path))
    with pytest.raises(ValueError, match="a bug"):
        programs.up("nats://127.0.0.1:9", 0)


def test_a_recording_replaces_no_file(arm: HTTPServer, tmp_path: Path) -> None:
    for name in (".bashrc", "..", "a.toml", "b\\c.mcap", "open\n.mcap"):
        with pytest.raises(FleetError, match="nothing was written"):
            fetch(arm, tmp_path, name)
    assert fetch(arm, tmp_path, "open.mcap") == b"run"
    with pytest.raises(FleetError, match=r"exists; give another folder: -o"):
        fetch(arm, tmp_path, "open.mcap")
    assert [each.name for each in tmp_path.iterdir()] == ["open.mcap"]
