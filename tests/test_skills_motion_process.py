"""The worker as its process shows: how it loads, and what an answer that makes no sense costs."""

import dataclasses
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from hardware import Robot, load_robot
from skills.motion import PlanTimeout, Query, WorkerDied
from skills.motion.process import WorkerProcess

PICK = Query("arm", (0.0, 0.0, 0.0, 0.0), (-1.4, -0.6, -0.07))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


NONSENSE = """#!{python}
import pickle, sys
from multiprocessing.connection import Connection
with Connection(int(sys.argv[-1])) as connection:
    connection.recv_bytes()
    connection.send(None)
    connection.recv_bytes()
    connection.send_bytes({answer!r})
    connection.recv_bytes()
"""


HANGS = """#!{python}
import sys
from multiprocessing.connection import Connection
with Connection(int(sys.argv[-1])) as connection:
    connection.recv_bytes()
    connection.send(None)
    connection.recv_bytes()
    if connection.poll(5.0):  # nothing comes; it is ended long before
        connection.recv_bytes()
    connection.send(None)
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
    program(tmp_path / "hangs", HANGS, monkeypatch)
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


@pytest.mark.parametrize("answer", [b"rubbish", b"", pickle.dumps(42), pickle.dumps(OSError("?"))])
def test_a_worker_that_answers_nonsense(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    program(tmp_path / "nonsense", NONSENSE, monkeypatch, answer=answer)
    worker = WorkerProcess(robot)
    assert isinstance(worker.ask(PICK), WorkerDied)
    assert not worker.alive
    worker.close()
    assert not Path(f"/proc/{worker.pid}").exists()
