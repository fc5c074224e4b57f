"""The worker of a server as a process: it starts again, unless the fleet refuses it."""

import errno
import logging
import os
import subprocess
import threading
from queue import Queue

import pytest

from executive.fleet.worker_process import FleetPlace, RunningWorker, worker_of
from hardware import RealClock


def started(*scripts: str) -> tuple[RunningWorker, list[str]]:
    """A worker whose processes are these scripts, one after the other; the scripts left.

    An empty script cannot be started.
    """
    left = [*scripts]

    def start() -> "subprocess.Popen[bytes]":
        if not (script := left.pop(0)):
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        return subprocess.Popen(["sh", "-c", script], stdin=subprocess.PIPE)

    return RunningWorker(start, "armtree fleet join", RealClock()), left


def test_a_worker_that_dies_starts_again_until_the_fleet_refuses_it(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.worker_process._FIRST_DELAY", 0.01)
    running, left = started("kill -9 $$", "exit 1", "exit 13", "exit 0")
    with caplog.at_level(logging.WARNING):
        running.keep()
    running.end()
    assert left == ["exit 0"]
    assert [each.getMessage().partition(";")[0] for each in caplog.records[:2]] == [
        "FLEET: the worker ended with status -9",
        "FLEET: the worker ended with status 1",
    ]
    assert "type: armtree fleet join" in caplog.text


def test_a_worker_that_cannot_be_started_is_started_later(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.fleet.worker_process._FIRST_DELAY", 0.01)
    running, left = started("", "exit 1", "", "exit 13")
    with caplog.at_level(logging.WARNING):
        running.keep()
    running.end()
    assert left == []
    assert [each.getMessage() for each in caplog.records[:3]] == [
        "FLEET: the worker cannot be started ([Errno 11] Resource temporarily unavailable); it "
        "starts again in 0.01 s",
        "FLEET: the worker ended with status 1; it starts again in 0.02 s",
        "FLEET: the worker cannot be started ([Errno 11] Resource temporarily unavailable); it "
        "starts again in 0.04 s",
    ]


def test_the_password_of_a_fleet_is_in_no_command(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, url = Queue[tuple[list[str], dict[str, str]]](), "nats://lab:secret@bench.example"

    def start(command: list[str], env: dict[str, str], **_: object) -> None:
        begun.put((command, env))
        raise BlockingIOError

    monkeypatch.setattr(subprocess, "Popen", start)
    with worker_of(FleetPlace(url, "bench", "0"), "http://arm", "token", "http://arm"):
        command, environment = begun.get(timeout=10)
    assert "secret" not in " ".join(command)
    assert environment["ARMTREE_FLEET"] == url


def test_a_server_can_end_while_its_worker_cannot_be_started(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("executive.fleet.worker_process._FIRST_DELAY", 0.01)
    processes, failed = iter([subprocess.Popen("true", stdin=subprocess.PIPE)]), threading.Event()

    def start() -> "subprocess.Popen[bytes]":
        for process in processes:
            return process
        failed.set()
        raise BlockingIOError

    running = RunningWorker(start, "armtree fleet join", RealClock())
    keeping = threading.Thread(target=running.keep)
    keeping.start()
    assert failed.wait(10)
    running.end()
    keeping.join(10)
    assert not keeping.is_alive()


def test_a_worker_that_ends_in_order_learns_it_and_does_not_start_again() -> None:
    running, left = started('test "$(head -c 1)" = . && exit 7', "exit 0")
    keeping = threading.Thread(target=running.keep)
    keeping.start()
    while not (process := running._process):
        continue
    running.end()
    keeping.join(10)
    assert process.returncode == 7
    assert left == ["exit 0"]
