"""The worker as its process shows: how it loads, and what an answer that makes no sense costs."""

import dataclasses
import pickle
import sys
import threading
from pathlib import Path

import pytest

from hardware import Robot, load_robot
from skills.motion import PlanTimeout, Query, Request, WorkerDied
from skills.motion.planner import Planner
from skills.motion.process import LOADED, Answer, WorkerProcess, receive
from skills.motion.worker import answered

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


SLOW = """#!{python}
import sys, time
from multiprocessing.connection import Connection
with Connection(int(sys.argv[-1])) as connection:
    connection.recv_bytes()
    connection.send(None)
    connection.recv_bytes()
    time.sleep(0.2)  # of loading
    connection.send({loaded!r})
    connection.send(None)
    connection.recv_bytes()
    connection.recv_bytes()
"""


def test_loading_what_bends_need_is_no_part_of_a_time_out(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "slow"
    program.write_text(SLOW.format(python=sys.executable, loaded=LOADED))
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    worker = WorkerProcess(robot)
    quick = dataclasses.replace(PICK, timeout=0.05)
    assert worker.ask(quick) is None
    assert isinstance(worker.ask(quick), PlanTimeout)  # it counts again
    worker.close()


def test_who_ran_out_of_time_beside_the_loading_is_asked_again(robot: Robot) -> None:
    class Slow(Planner):
        def answer(self, request: Request) -> Answer:
            asked.append(request)
            loaded.set()
            if len(asked) == 2:
                return None
            raise PlanTimeout(request.timeout)

    asked, loaded, planner = list[Request](), threading.Event(), Slow(robot)
    loading = threading.Thread(target=loaded.wait, args=(20.0,))
    loading.start()
    assert answered(planner, PICK, loading) is None
    assert isinstance(answered(planner, PICK, loading), PlanTimeout)
    assert len(asked) == 3


def test_an_idle_worker_loads_what_bends_need_by_itself(robot: Robot) -> None:
    worker = WorkerProcess(robot)
    assert receive(worker._connection) is None
    assert worker._connection.poll(20.0)
    assert receive(worker._connection) == LOADED
    loaded = Path(f"/proc/{worker.pid}/maps").read_text()
    assert "toppra" in loaded
    worker.close()


@pytest.mark.parametrize("answer", [b"rubbish", b"", pickle.dumps(42), pickle.dumps(OSError("?"))])
def test_a_worker_that_answers_nonsense(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: bytes
) -> None:
    program = tmp_path / "nonsense"
    program.write_text(NONSENSE.format(python=sys.executable, answer=answer))
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    worker = WorkerProcess(robot)
    assert isinstance(worker.ask(PICK), WorkerDied)
    assert not worker.alive
    worker.close()
    assert not Path(f"/proc/{worker.pid}").exists()
