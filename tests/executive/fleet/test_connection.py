"""The connection to the NATS server of a fleet, without a fleet."""

import asyncio
import contextlib
import fcntl
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from executive.fleet import programs
from executive.fleet.connection import open_fleet
from executive.fleet.errors import FleetError, FleetUnreachable, NotStarted
from executive.fleet.nats_server import NatsOptions, nats_server
from executive.fleet.values import Member
from hardware import RealClock
from tests.support.servers.cuttable_proxy import CuttableProxy
from tests.support.servers.free_port import free_port

pytestmark = pytest.mark.slow


def test_the_token_is_sent_only_to_the_address_of_the_server(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another user's program may listen on the same port of another address."""
    options, heads = NatsOptions(tmp_path / "fleet", port=free_port()), list[bytes]()

    def listen(listener: socket.socket) -> None:
        connection, _ = listener.accept()
        with connection:
            connection.sendall(b'INFO {"auth_required": true, "max_payload": 9}\r\n')
            heads.append(connection.recv(65_536))

    async def connect(url: str) -> None:
        async with open_fleet(url, "person"):
            pass

    address = "::1", options.port
    with (
        socket.create_server(address, family=socket.AF_INET6) as listener,
        nats_server(options, RealClock()),
    ):
        asyncio.run(connect(f"nats://localhost:{options.port}"))
        other = threading.Thread(target=listen, args=(listener,))
        other.start()
        monkeypatch.setattr("executive.fleet.connection._ANSWER_SECONDS", 0.1)
        with pytest.raises(FleetError):
            asyncio.run(connect(f"nats://[::1]:{options.port}"))
        other.join()
    assert heads[0].startswith(b"CONNECT")
    assert (options.data / "token").read_bytes() not in heads[0]


@pytest.mark.parametrize("address", ["::1", "localhost"])
def test_a_fleet_on_another_address_of_this_machine_has_a_url(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))  # it has the token

    async def connect() -> None:
        async with open_fleet(options.url, "person") as fleet:
            assert await fleet.values(Member) == {}

    options = NatsOptions(tmp_path / "fleet", address, free_port())
    with nats_server(options, RealClock()):
        asyncio.run(connect())


_INFO = b'INFO {"server_id": "x", "headers": true, "max_payload": 1048576}\r\n'
_HELLO = _INFO + b"PONG\r\n"


@pytest.mark.parametrize(
    "pieces",
    [
        pytest.param((b"INFO []\r\n", b""), id="INFO with a list"),
        pytest.param((b'INFO {"max_payload": "a"}\r\nPONG\r\n', b""), id="INFO with a text"),
        pytest.param((b"INFO ", b"x" * 65_536), id="INFO without end"),
        pytest.param((_HELLO, b"x" * 65_536), id="line without end"),
        pytest.param((_HELLO + b"MSG a 1 999999999999\r\n", b"x" * 65_536), id="endless message"),
        pytest.param((_HELLO + b"INFO {]\r\n", b""), id="later INFO"),
    ],
)
def test_another_program_that_answers_ends_a_connection(pieces: tuple[bytes, bytes]) -> None:
    """It is no bug of armtree, fills no memory, and takes less than the time for an answer."""
    first, more = pieces
    sent = 0

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal sent
        writer.write(first)
        with contextlib.closing(writer), contextlib.suppress(ConnectionError):
            while more:
                writer.write(more)
                await writer.drain()
                sent += len(more)
            await reader.read()  # until the connection ends

    async def main() -> None:
        async with await asyncio.start_server(answer, "127.0.0.1", 0) as server:
            port = server.sockets[0].getsockname()[1]
            async with asyncio.timeout(4):
                with pytest.raises(FleetUnreachable):
                    async with open_fleet(f"nats://127.0.0.1:{port}", "person"):
                        pass

    asyncio.run(main())
    assert sent < 2**25


def test_an_answer_that_is_waited_for_no_more_leaves_the_connection_alive(tmp_path: Path) -> None:
    options = NatsOptions(tmp_path / "fleet", port=free_port())

    async def main() -> None:
        async with open_fleet(options.url, "person") as fleet:
            given_up = asyncio.get_running_loop().create_future()
            given_up.cancel()
            await fleet.nats._send_ping(given_up)  # as a flush that is canceled before its answer
            async with asyncio.timeout(3):
                assert await fleet.values(Member) == {}

    with nats_server(options, RealClock()):
        asyncio.run(main())


def test_an_attempt_to_reconnect_that_fails_leaves_no_socket_open(tmp_path: Path) -> None:
    """An open one is a ResourceWarning, which fails the test."""
    options = NatsOptions(tmp_path / "fleet", port=free_port())

    async def main() -> None:
        back = asyncio.Event()

        async def changed(is_up: bool) -> None:
            if is_up:
                back.set()

        with nats_server(options, RealClock()), CuttableProxy(options.port) as proxy:
            token = {"token": (options.data / "token").read_text()}
            url = f"nats://127.0.0.1:{proxy.port}"
            async with open_fleet(url, "arm", True, changed, token):
                proxy.cut()
                assert await asyncio.to_thread(proxy.refused.wait, 20)
                proxy.mend()
                await asyncio.wait_for(back.wait(), 20)

    asyncio.run(main())


def test_a_data_folder_has_one_nats_server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second one would damage the jobs of the first."""
    monkeypatch.setattr("executive.fleet.nats_server._LOCK_SECONDS", 0.0)
    options = NatsOptions(tmp_path / "fleet", port=free_port())

    async def main() -> None:
        async with open_fleet(options.url, "person"):
            raise FileNotFoundError(2, "of the caller")

    with nats_server(options, RealClock()):
        second = replace(options, port=free_port())
        with pytest.raises(NotStarted, match=r"its jobs are there\. End that fleet first"):
            programs.up(second.url, options.port, second)  # also if the port of the page is used
        with pytest.raises(FileNotFoundError, match="of the caller"):
            asyncio.run(main())
    with nats_server(second, RealClock()):
        pass


def test_a_fleet_that_was_killed_starts_again_though_its_nats_server_is_still_ending(
    tmp_path: Path,
) -> None:
    options = NatsOptions(tmp_path, port=free_port())
    with (tmp_path / "lock").open("wb") as lock, socket.create_server(("", options.port)) as port:
        fcntl.flock(lock, fcntl.LOCK_EX)

        def end() -> None:
            port.close()
            lock.close()

        ending = threading.Timer(0.1, end)
        ending.start()
        with nats_server(options, RealClock()) as process:
            assert process.poll() is None
        ending.join()


_HOLDS_A_SERVER = """
import sys
from pathlib import Path
from executive.fleet.nats_server import NatsOptions, nats_server
from hardware import RealClock
with nats_server(NatsOptions(Path(sys.argv[1]), port=int(sys.argv[2])), RealClock()):
    print("ready", flush=True)
    sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nats-server outlives armtree")
def test_nats_server_ends_with_a_killed_program(tmp_path: Path) -> None:
    port = free_port()
    command = [sys.executable, "-c", _HOLDS_A_SERVER, str(tmp_path / "fleet"), str(port)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as program:
        assert program.stdout
        assert program.stdout.readline() == b"ready\n"
        program.kill()
    end = time.monotonic() + 20
    while accepts(port):
        assert time.monotonic() < end


def accepts(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port)).close()
    except ConnectionRefusedError:
        return False
    except ConnectionResetError:
        return True  # it is just ending
    return True
