"""The worker process: what it loads, and what an invalid answer costs."""

import dataclasses
import os
import pickle
import signal
import struct
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

from hardware import Robot, load_robot
from skills.motion import (
    Body,
    Mesh,
    Plan,
    PlanTimeout,
    Query,
    Reached,
    Verify,
    WorkerDied,
    World,
)
from skills.motion.planner import Planner
from skills.motion.workers.fork_server import ForkServer
from skills.motion.workers.messages import MESHES_READ
from skills.motion.workers.worker_process import WorkerProcess
from tests.support.paths import DATA

PICK = Query("arm", (0.0, 0.0, 0.0, 0.0), (-1.4, -0.6, -0.07))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


# Stands for a fork server that is the worker, too: it reports its process, reads what it is sent,
# then sends bytes of its own.
SAYS = """#!{python}
import os, pickle, socket, sys
with socket.socket(fileno=int(sys.argv[-1])) as forks:
    _, (requests, reports, _), *_ = socket.recv_fds(forks, 1, 3)
with socket.socket(fileno=requests) as parent, socket.socket(fileno=reports) as watch:
    socket.send_fds(watch, [pickle.dumps(os.getpid())], [os.pidfd_open(os.getpid())])
    parent.recv(65536)
    parent.sendall({answer!r})
    parent.recv(1)
"""


def program(file: Path, text: str, monkeypatch: pytest.MonkeyPatch, **values: object) -> None:
    """Let a worker run another program."""
    file.write_text(text.format(python=sys.executable, **values))
    file.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(file))


@contextmanager
def started(robot: Robot) -> Iterator[WorkerProcess]:
    """A worker, and its fork server."""
    with closing(ForkServer(robot)) as server, closing(WorkerProcess(server, robot)) as worker:
        yield worker


def test_a_worker_that_hangs_in_its_first_request_is_killed(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Everything was loaded before, so the request's own timeout applies."""
    program(tmp_path / "hangs", SAYS, monkeypatch, answer=b"")
    with started(robot) as worker:
        assert isinstance(worker.call(dataclasses.replace(PICK, timeout=0.05)), PlanTimeout)
        assert not worker.alive


def framed(body: bytes, more: int = 0) -> bytes:
    """A message as a worker sends it, or one that announces more bytes than it has."""
    return (len(body) + more).to_bytes(4) + body


class _Raises:
    """Raises any exception when it is unpickled."""

    def __reduce__(self) -> tuple[object, ...]:
        return exec, ("raise RuntimeError('?')",)


def answered(answer: object, number: object = 1) -> bytes:
    """An answer to the first request, or to another one."""
    return framed(pickle.dumps((number, answer)))


@pytest.mark.parametrize(
    "answer",
    [
        framed(b"rubbish"),
        framed(b""),
        framed(pickle.dumps(42)),
        framed(pickle.dumps(_Raises())),
        answered(42),
        answered(OSError("?")),
        answered(None),
        answered(Reached((0.0,), 1)),
        answered(PlanTimeout(1.0), number=2),
        answered(PlanTimeout(1.0), number=np.array([1, 1])),
        answered(PlanTimeout(1.0), number=1.0),
        answered(MESHES_READ),
        answered(np.zeros(2)),
        (2**31).to_bytes(4),
    ],
)
def test_a_worker_with_an_invalid_answer(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    program(tmp_path / "nonsense", SAYS, monkeypatch, answer=answer)
    beam = World((Body("beam", Mesh(str(DATA / "beam.stl")), (2.0, 0.0, 0.0)),))
    for request in (PICK, dataclasses.replace(PICK, world=beam, timeout=0.5)):
        with started(robot) as worker:
            died = worker.call(request)
            if answer == answered(MESHES_READ) and request is not PICK:
                assert isinstance(died, PlanTimeout)  # no answer follows
            else:
                assert isinstance(died, WorkerDied)
            assert not worker.alive
        assert not Path(f"/proc/{worker.pid}").exists()


def test_bytes_after_an_answer_are_no_answer(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program(tmp_path / "more", SAYS, monkeypatch, answer=answered(PlanTimeout(1.0)) + b"and more")
    with started(robot) as worker:
        assert isinstance(worker.call(PICK), PlanTimeout)
        assert isinstance(worker.call(PICK), WorkerDied)
        assert not worker.alive


def test_a_worker_with_a_plan_for_another_goal(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = Planner(robot).plan(dataclasses.replace(PICK, goal=(-1.4, -0.5, -0.07)))
    program(tmp_path / "lies", SAYS, monkeypatch, answer=answered(other))
    with started(robot) as worker:
        lied = worker.call(PICK)
        assert isinstance(lied, WorkerDied)
        assert lied.why == (
            "it answered a plan that ends with joint_2 at -28.6479 deg, not at -34.3775 deg"
        )
        assert not worker.alive


@pytest.mark.parametrize("answer", [b"\0", b"\0\0\0\x10", framed(pickle.dumps(None), more=1)])
def test_a_worker_that_announces_more_than_it_sends_is_killed(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    program(tmp_path / "halts", SAYS, monkeypatch, answer=answer)
    with started(robot) as worker:
        assert isinstance(worker.call(dataclasses.replace(PICK, timeout=0.05)), PlanTimeout)
        assert not worker.alive


def test_a_worker_that_answers_twice(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A late answer to the first request is not an answer to the second."""
    again = "parent.recv(65536)\n    parent.sendall({answer!r})\n    parent.recv(1)"
    says = SAYS.replace("parent.recv(1)", again)
    program(tmp_path / "twice", says, monkeypatch, answer=answered(PlanTimeout(1.0)))
    with started(robot) as worker:
        assert isinstance(worker.call(PICK), PlanTimeout)
        died = worker.call(PICK)
        assert isinstance(died, WorkerDied)
        assert died.why == "it answered request 1, not 2"
        assert not worker.alive


def test_a_plan_that_is_not_finite_or_incomplete_is_invalid(robot: Robot) -> None:
    *rest, (places, memory) = Planner(robot).plan(PICK).__getstate__()
    nan, short = struct.pack("d", float("nan")) + memory[8:], memory[:-8]
    high = struct.pack("dd", 1.7e308, 1.7e308) + memory[16:]
    Plan.__new__(Plan).__setstate__((*rest, (places, high)))  # type: ignore[arg-type]
    for joined in ((places, nan), (places, short), (places[:-1], memory)):
        twin = Plan.__new__(Plan)
        with pytest.raises((ValueError, TypeError), match=r"finite|buffer|shorter"):
            twin.__setstate__((*rest, joined))  # type: ignore[arg-type]


def test_a_worker_that_closes_its_socket_is_replaced_at_once(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The exit status is not waited for without an end."""
    monkeypatch.setattr("skills.motion.workers.worker_process._EXIT", 0.05)
    says = SAYS.replace("parent.recv(1)", "parent.close(); import signal; signal.pause()")
    program(tmp_path / "hangs_up", says, monkeypatch, answer=b"")
    with started(robot) as worker:
        died = worker.call(dataclasses.replace(PICK, timeout=20.0))
        assert isinstance(died, WorkerDied)
        assert died.why == "it closed its socket"
        assert not worker.alive


@pytest.mark.slow
def test_a_worker_that_reads_nothing_is_killed(robot: Robot) -> None:
    """Sending a request of a megabyte ends at the request's timeout."""
    with started(robot) as worker:
        assert worker.call(Verify([robot.boot_pose], 0.0)) is None
        assert worker.pid
        os.kill(worker.pid, signal.SIGSTOP)
        rows = [robot.boot_pose] * 40_000
        assert isinstance(worker.call(Verify(rows, 0.0, timeout=0.05)), PlanTimeout)
        assert not worker.alive
