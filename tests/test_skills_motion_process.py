"""The worker as its process shows: how it loads, and what an answer that makes no sense costs."""

import dataclasses
import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hardware import Robot, load_robot
from skills.motion import PlanTimeout, Query, Verify, WorkerDied
from skills.motion.process import WorkerProcess

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
    assert isinstance(worker.ask(dataclasses.replace(PICK, timeout=0.05)), PlanTimeout)
    assert not worker.alive
    worker.close()


LOADS = """
import sys, skills.motion.worker
print(sorted({"scipy.interpolate", "scipy.sparse", "matplotlib", "toppra"} & set(sys.modules)))
from scipy.interpolate import CubicSpline
print(CubicSpline([0, 1, 2], [0, 1, 4])(1.0))
"""


def test_a_worker_loads_of_toppra_what_it_needs() -> None:
    """All of it would take twice as long as everything else together."""
    root = str(Path(__file__).parents[1])
    out = subprocess.run([sys.executable, "-c", LOADS], cwd=root, capture_output=True, check=True)
    assert out.stdout.decode() == "['toppra']\n1.0\n"


def framed(body: bytes, more: int = 0) -> bytes:
    """As a worker sends it, or as if so much more would come."""
    return (len(body) + more).to_bytes(4) + body


@pytest.mark.parametrize(
    "answer",
    [
        framed(b"rubbish"),
        framed(b""),
        framed(pickle.dumps(42)),
        framed(pickle.dumps(OSError("?"))),
        framed(pickle.dumps(None)) + b"and more",
        (2**31).to_bytes(4),
    ],
)
def test_a_worker_that_answers_nonsense(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    program(tmp_path / "nonsense", SAYS, monkeypatch, answer=answer)
    worker = WorkerProcess(robot)
    assert isinstance(worker.ask(PICK), WorkerDied)
    assert not worker.alive
    worker.close()
    assert not Path(f"/proc/{worker.pid}").exists()


@pytest.mark.parametrize("answer", [b"\0", b"\0\0\0\x10", framed(pickle.dumps(None), more=1)])
def test_a_worker_that_announces_more_than_it_sends_is_given_up(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    program(tmp_path / "halts", SAYS, monkeypatch, answer=answer)
    worker = WorkerProcess(robot)
    assert isinstance(worker.ask(dataclasses.replace(PICK, timeout=0.05)), PlanTimeout)
    assert not worker.alive
    worker.close()


def test_a_worker_that_takes_nothing_is_given_up(robot: Robot) -> None:
    """A request of a megabyte does not wait for it beyond its own time."""
    worker = WorkerProcess(robot)
    assert worker.ask(Verify([robot.boot_pose], 0.0)) is None
    os.kill(worker.pid, signal.SIGSTOP)
    rows = [robot.boot_pose] * 40_000
    assert isinstance(worker.ask(Verify(rows, 0.0, timeout=0.05)), PlanTimeout)
    assert not worker.alive
    worker.close()
