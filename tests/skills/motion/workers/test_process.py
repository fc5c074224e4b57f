"""The worker as its process shows: how it loads, and what an answer that makes no sense costs."""

import dataclasses
import os
import pickle
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hardware import Robot, load_robot
from skills.motion import Plan, PlanTimeout, Query, Reached, Verify, WorkerDied
from skills.motion.planner import Planner
from skills.motion.workers.process import WorkerProcess
from tests.support.paths import ROOT

PICK = Query("arm", (0.0, 0.0, 0.0, 0.0), (-1.4, -0.6, -0.07))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


# Stands for a worker: reads what it is sent, says that it is ready, then sends bytes of its own.
SAYS = """#!{python}
import pickle, socket, sys
with socket.socket(fileno=int(sys.argv[-1])) as parent:
    parent.recv(65536)
    body = pickle.dumps(None)
    parent.sendall(len(body).to_bytes(4) + body)
    parent.recv(65536)
    parent.sendall({answer!r})
    parent.recv(1)
"""


def program(file: Path, text: str, monkeypatch: pytest.MonkeyPatch, **values: object) -> None:
    """Have a worker run another program than it should."""
    file.write_text(text.format(python=sys.executable, **values))
    file.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(file))


def test_a_worker_that_hangs_in_its_first_goal_is_given_up(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that it may need was loaded before, so the goal's own time holds."""
    program(tmp_path / "hangs", SAYS, monkeypatch, answer=b"")
    worker = WorkerProcess(robot)
    assert isinstance(worker.call(dataclasses.replace(PICK, timeout=0.05)), PlanTimeout)
    assert not worker.alive
    worker.close()


LOADS = """
import sys, skills.motion.planner
wanted = {"scipy.interpolate", "scipy.sparse", "matplotlib", "toppra"}
print(sorted(wanted & set(sys.modules)))
import skills.motion.workers.worker
print(sorted(wanted & set(sys.modules)))
from scipy.interpolate import CubicSpline
print(CubicSpline([0, 1, 2], [0, 1, 4])(1.0))
"""


def test_toppra_is_loaded_at_need_and_only_what_is_needed_of_it() -> None:
    """By a worker before its first goal. All of it would take twice as long as all else."""
    root = str(ROOT)
    out = subprocess.run([sys.executable, "-c", LOADS], cwd=root, capture_output=True, check=True)
    assert out.stdout.decode() == "[]\n['toppra']\n1.0\n"


def framed(body: bytes, more: int = 0) -> bytes:
    """As a worker sends it, or as if so much more would come."""
    return (len(body) + more).to_bytes(4) + body


class _Raises:
    """What, when it is received, raises anything."""

    def __reduce__(self) -> tuple[object, ...]:
        return exec, ("raise RuntimeError('?')",)


def answered(answer: object, number: object = 1) -> bytes:
    """The answer to the first request, or another."""
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
        answered(PlanTimeout(1.0)) + b"and more",
        (2**31).to_bytes(4),
    ],
)
def test_a_worker_that_answers_nonsense(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    program(tmp_path / "nonsense", SAYS, monkeypatch, answer=answer)
    worker = WorkerProcess(robot)
    assert isinstance(worker.call(PICK), WorkerDied)
    assert not worker.alive
    worker.close()
    assert not Path(f"/proc/{worker.pid}").exists()


@pytest.mark.parametrize("answer", [b"\0", b"\0\0\0\x10", framed(pickle.dumps(None), more=1)])
def test_a_worker_that_announces_more_than_it_sends_is_given_up(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    program(tmp_path / "halts", SAYS, monkeypatch, answer=answer)
    worker = WorkerProcess(robot)
    assert isinstance(worker.call(dataclasses.replace(PICK, timeout=0.05)), PlanTimeout)
    assert not worker.alive
    worker.close()


def test_a_worker_that_answers_twice(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it says of the first question is no answer to the second."""
    again = "parent.recv(65536)\n    parent.sendall({answer!r})\n    parent.recv(1)"
    says = SAYS.replace("parent.recv(1)", again)
    program(tmp_path / "twice", says, monkeypatch, answer=answered(PlanTimeout(1.0)))
    worker = WorkerProcess(robot)
    assert isinstance(worker.call(PICK), PlanTimeout)
    died = worker.call(PICK)
    assert isinstance(died, WorkerDied)
    assert died.why == "it answered request 1 instead of 2"
    assert not worker.alive
    worker.close()


def test_a_plan_that_is_not_finite_or_not_whole_is_none(robot: Robot) -> None:
    *rest, (places, memory) = Planner(robot).plan(PICK).__getstate__()
    nan, short = struct.pack("d", float("nan")) + memory[8:], memory[:-8]
    high = struct.pack("dd", 1.7e308, 1.7e308) + memory[16:]
    Plan.__new__(Plan).__setstate__((*rest, (places, high)))  # type: ignore[arg-type]
    for joined in ((places, nan), (places, short), (places[:-1], memory)):
        twin = Plan.__new__(Plan)
        with pytest.raises((ValueError, TypeError), match=r"finite|buffer|shorter"):
            twin.__setstate__((*rest, joined))  # type: ignore[arg-type]


def test_a_worker_that_hangs_up_is_given_up_at_once(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It need not say why, if its time is up before it could."""
    says = SAYS.replace("parent.recv(1)", "parent.close(); import signal; signal.pause()")
    program(tmp_path / "hangs_up", says, monkeypatch, answer=b"")
    worker = WorkerProcess(robot)
    died = worker.call(dataclasses.replace(PICK, timeout=0.05))
    assert isinstance(died, WorkerDied)
    assert died.why == "it closed its socket"
    assert not worker.alive
    worker.close()


def test_a_worker_that_takes_nothing_is_given_up(robot: Robot) -> None:
    """A request of a megabyte does not wait for it beyond its own time."""
    worker = WorkerProcess(robot)
    assert worker.call(Verify([robot.boot_pose], 0.0)) is None
    os.kill(worker.pid, signal.SIGSTOP)
    rows = [robot.boot_pose] * 40_000
    assert isinstance(worker.call(Verify(rows, 0.0, timeout=0.05)), PlanTimeout)
    assert not worker.alive
    worker.close()
