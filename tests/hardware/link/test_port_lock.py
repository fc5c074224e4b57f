"""The lock on a serial port: one owner at a time, and released when the owner ends."""

import contextlib
import os
import resource
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from hardware import LinkError
from hardware.errors import PortBusy
from hardware.link import port_lock as module
from hardware.link.port_lock import PortLock
from tests.support.hardware_rigs import open_files


@pytest.fixture
def port(tmp_path: Path) -> Iterator[str]:
    """A port that no other test uses. Its lock file is removed at the end."""
    port = str(tmp_path / "tty")
    yield port
    assert not PortLock(port).path.exists()


def test_a_lock_file_is_for_every_user(port: str) -> None:
    lock = PortLock(port)
    mask = os.umask(0o077)
    try:
        lock.acquire()
    finally:
        os.umask(mask)
    assert lock.path.stat().st_mode & 0o777 == 0o666
    lock.release()
    lock.release()
    assert not lock.path.exists()


class Competitors:
    """Threads that want one lock. Its owner keeps it until the others have failed."""

    def __init__(self, port: str) -> None:
        self.port = port
        self.changed = threading.Condition()
        self.inside = self.most = self.tries = self.turns = 0

    def compete(self) -> None:
        while self.turns < 60:
            lock = PortLock(self.port)
            with contextlib.suppress(PortBusy):
                lock.acquire()
                self.stay()
                lock.release()
            with self.changed:
                self.tries += 1
                self.changed.notify_all()

    def stay(self) -> None:
        with self.changed:
            self.inside += 1
            self.most = max(self.most, self.inside)
            enough = self.tries + 3
            self.changed.wait_for(lambda: self.tries >= enough or self.turns >= 60, 5)
            self.inside -= 1
            self.turns += 1
            self.changed.notify_all()


def test_many_threads_acquire_a_lock_one_at_a_time(port: str) -> None:
    competitors = Competitors(port)
    threads = [threading.Thread(target=competitors.compete) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert competitors.most == 1
    assert competitors.turns >= 60


def test_a_lock_file_that_its_owner_removes_right_now_is_no_lock(
    port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was opened before its owner removed it, and a third has made a new one since."""
    first, second, third = PortLock(port), PortLock(port), PortLock(port)
    first.acquire()
    opened = module._open

    def late(path: Path) -> int:
        file = opened(path)
        if first._held:
            first.release()
            third.acquire()
        return file

    monkeypatch.setattr(module, "_open", late)
    with pytest.raises(PortBusy, match=f"process id {os.getpid()}"):
        second.acquire()
    third.release()


def test_reading_the_owner_does_not_prevent_locking(port: str) -> None:
    done = threading.Event()

    def look() -> None:
        while not done.is_set():
            assert PortLock(port).owner() in (None, str(os.getpid()))

    lookers = [threading.Thread(target=look) for _ in range(2)]
    for looker in lookers:
        looker.start()
    try:
        for _ in range(500):
            lock = PortLock(port)
            lock.acquire()
            lock.release()
    finally:
        done.set()
        for looker in lookers:
            looker.join()


def test_the_owner_is_named_while_there_is_one(port: str) -> None:
    lock = PortLock(port)
    assert lock.owner() is None
    lock.acquire()
    assert PortLock(port).owner() == str(os.getpid())
    lock.release()
    assert PortLock(port).owner() is None
    lock.path.write_text("4711\n")  # left by a killed process
    assert lock.owner() is None
    lock.path.unlink()


def test_a_lock_of_another_file_system_is_ignored(
    port: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files of two file systems may have one number, and in /run and /tmp small ones are usual."""
    lock, locks = PortLock(port), tmp_path / "locks"
    lock.path.touch()
    file = lock.path.stat()
    devices = [(os.major(file.st_dev), os.minor(file.st_dev)), (0xAB, 0x1)]
    monkeypatch.setattr(module, "_LOCKS", locks)
    owners = []
    for major, minor in devices:
        where = f"{major:02x}:{minor:02x}:{file.st_ino}"
        locks.write_text(f"1: FLOCK  ADVISORY  WRITE 4711 {where} 0 EOF\n")
        owners.append(lock.owner())
    lock.path.unlink()
    assert owners == ["4711", None]


def test_a_lock_file_that_cannot_be_opened_is_named(port: str) -> None:
    lock = PortLock(port)
    lock.path.symlink_to("/etc/passwd")
    with pytest.raises(LinkError) as refused:
        lock.acquire()
    lock.path.unlink()
    why = f"The lock file {lock.path} cannot be used: Too many levels of symbolic links. Remove it"
    assert why in str(refused.value)


def test_a_lock_file_that_cannot_be_written_is_named_and_given_up(port: str) -> None:
    """As with a full disk; a limit on the size of files has the same effect."""
    lock, before = PortLock(port), open_files()
    _, hard = limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        with pytest.raises(LinkError, match=r"cannot be used: File too large\. Remove it, or"):
            lock.acquire()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert open_files() == before
    lock.acquire()
    lock.release()
