"""A server tells systemd that it is ready, that its loop runs, and that it ends."""

import asyncio
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from executive.server.server import Viewer
from executive.server.systemd.notifier import SystemdNotifier
from hardware import RealClock


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """The socket on which systemd listens; the timeout of its watchdog is 0.02 s."""
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    monkeypatch.setenv("WATCHDOG_USEC", "20000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.settimeout(20)
        yield listener


def test_a_server_reports_from_its_loop(
    manager: socket.socket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with Viewer(tmp_path, RealClock()) as viewer:
        viewer.start()
        assert [manager.recv(99) for _ in range(4)] == [b"READY=1", *[b"WATCHDOG=1"] * 3]
    manager.settimeout(0)
    rest: list[bytes] = []
    while not rest or rest[-1] != b"STOPPING=1":
        rest.append(manager.recv(99))
    with pytest.raises(BlockingIOError):
        manager.recv(99)


def test_a_loop_that_hangs_reports_nothing(manager: socket.socket) -> None:
    loop = asyncio.new_event_loop()
    SystemdNotifier().ready(loop)
    assert [manager.recv(99) for _ in range(2)] == [b"READY=1", b"WATCHDOG=1"]
    manager.settimeout(0.1)  # five times the timeout of the watchdog
    with pytest.raises(TimeoutError):
        manager.recv(99)
    loop.close()


def test_reports_come_at_half_of_the_timeout(
    manager: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WATCHDOG_USEC", "30000000")
    loop, delays = asyncio.new_event_loop(), list[float]()
    monkeypatch.setattr(loop, "call_later", lambda delay, *_: delays.append(delay))
    SystemdNotifier().ready(loop)
    assert [manager.recv(99) for _ in range(2)] == [b"READY=1", b"WATCHDOG=1"]
    assert delays == [15.0]
    loop.close()


def test_only_a_name_that_begins_with_an_at_sign_is_abstract(tmp_path: Path) -> None:
    for name, address in (
        (f"{tmp_path}/a@b", f"{tmp_path}/a@b"),
        (f"@{tmp_path}/c@d", f"\0{tmp_path}/c@d"),
    ):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
            listener.bind(address)
            listener.setblocking(False)
            SystemdNotifier({"NOTIFY_SOCKET": name}).ending()
            assert listener.recv(99) == b"STOPPING=1"


@pytest.mark.parametrize(
    ("variable", "value"), [("WATCHDOG_PID", "1"), ("WATCHDOG_USEC", "0"), ("NOTIFY_SOCKET", "/no")]
)
def test_only_the_process_of_the_service_reports(
    manager: socket.socket, monkeypatch: pytest.MonkeyPatch, variable: str, value: str
) -> None:
    monkeypatch.setenv(variable, value)
    loop = asyncio.new_event_loop()
    SystemdNotifier().ready(loop)
    loop.call_soon(loop.stop)
    loop.run_forever()
    loop.close()
    manager.settimeout(0)
    reported = b"" if variable == "NOTIFY_SOCKET" else b"READY=1"
    if reported:
        assert manager.recv(99) == reported
    with pytest.raises(BlockingIOError):
        manager.recv(99)
