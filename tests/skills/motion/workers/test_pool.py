"""The pool: processes that plan, are killed, crash, hang, and leave nothing behind."""

import dataclasses
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from hardware import RealClock, Robot, SimulatedClock, load_robot
from skills.motion import (
    BadQuery,
    Body,
    Box,
    Carry,
    ModelUnusable,
    MotionCollides,
    NotFinite,
    Plan,
    PlanCanceled,
    PlanTimeout,
    Pool,
    Reached,
    Request,
    Rest,
    Result,
    StartInCollision,
    ToolQuery,
    Verify,
    WorkerDied,
    World,
)
from skills.motion.workers import fork_server
from skills.motion.workers.answer_checker import AnswerChecker
from skills.motion.workers.fork_server import ForkServer
from skills.motion.workers.memory import has_spare_memory
from tests.support.paths import ROOT
from tests.support.pools import (
    LONG,
    PICK,
    Answer,
    answered,
    ask,
    idle,
    pid,
    running,
    until,
    until_at_work,
    wait_for_end,
    wait_until_gone,
)

BENT = dataclasses.replace(PICK, via=((-0.7, 0.2, 0.0),))
UNDER_THE_TABLE = (0.0, -1.5, -0.5, 0.0)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def pool(robot: Robot) -> Iterator[Pool]:
    pool = Pool(robot, 1, RealClock())
    pool.start()
    yield pool
    pool.close()


def test_answers(pool: Pool) -> None:
    plan = ask(pool, PICK)
    assert isinstance(plan, Plan)
    assert plan.duration == pytest.approx(3.3466, abs=1e-4)
    assert ask(pool, Verify([PICK.start, (*PICK.goal, 0.0)], 0.002)) is None


def test_memory_is_left_if_the_system_says_so(tmp_path: Path) -> None:
    file = tmp_path / "meminfo"
    for kib, left in ((2**19, False), (2**21, True)):
        file.write_text(f"MemTotal: 8 kB\nMemAvailable: {kib} kB\n")
        assert has_spare_memory(file) is left
    assert not has_spare_memory(tmp_path / "missing")


def test_errors_keep_their_attributes(pool: Pool) -> None:
    start = ask(pool, dataclasses.replace(PICK, start=UNDER_THE_TABLE))
    assert isinstance(start, StartInCollision)
    assert start.distance < 0.0 < start.margin
    hit = ask(pool, Verify([PICK.start, UNDER_THE_TABLE], 0.002, times=[0.0, 2.0]))
    assert isinstance(hit, MotionCollides)
    assert hit.time is not None
    assert "floor" in (hit.first, hit.second)


def test_invalid_requests_do_not_affect_others(pool: Pool) -> None:
    assert isinstance(ask(pool, PICK), Plan)
    worker = pid(pool)
    poison = dataclasses.replace(PICK, goal=(float("nan"), 0.0, 0.0))
    assert isinstance(ask(pool, poison), NotFinite)
    assert isinstance(ask(pool, dataclasses.replace(PICK, group="legs")), BadQuery)
    timeout: Any
    for timeout in (float("nan"), float("inf"), 1e7, "soon", None):
        assert isinstance(ask(pool, dataclasses.replace(PICK, timeout=timeout)), BadQuery)
    for value in (10**400, "a", None, [0.0]):
        goal: Any = (value, 0.0, 0.0)
        assert isinstance(ask(pool, dataclasses.replace(PICK, goal=goal)), BadQuery)
    assert isinstance(ask(pool, "hello"), BadQuery)  # type: ignore[arg-type]
    tool = ToolQuery("arm", PICK.start, (0.1, 0.0, 0.1))
    rest = Rest(answered(pool, PICK), 0.1, PICK.start)
    carry = Carry(World(), "ball", "", PICK.start)
    poisons: tuple[tuple[Request, dict[str, Any]], ...] = (
        (PICK, {"via": 3}),
        (PICK, {"group": []}),
        (PICK, {"world": None}),
        (tool, {"point": None}),
        (tool, {"point": ("a", 0.0, 0.0)}),
        *((tool, {"seed": seed}) for seed in (float("nan"), float("inf"), "a", -1, 2**64 - 1)),
        *((PICK, {"seed": seed}) for seed in (2**64 - 1, 10**400, 10**5000)),
        *(
            (tool, {"direction": (0.0, 0.0, 1.0), what: (10**400, 0.0, 1.0)})
            for what in ("point", "direction", "axis", "offset")
        ),
        *((tool, {what: (1e300, 0.0, 1.0)}) for what in ("point", "offset")),
        *((tool, {what: odd}) for what in ("direction", "axis", "offset") for odd in (5, "abc")),
        *((tool, {what: np.zeros(3)}) for what in ("direction", "axis", "link", "relative")),
        *((tool, {what: None}) for what in ("offset", "link", "relative")),
        *((rest, {"time": time}) for time in (float("nan"), float("-inf"), "a", None, 10**400)),
        *((rest, {"plan": plan}) for plan in (None, "a", PICK)),
        (rest, {"plan": dataclasses.replace(rest.plan, velocity=np.zeros(3))}),
        *((carry, {what: odd}) for what in ("body", "link") for odd in (np.zeros(3), None)),
        (PICK, {"goal": (threading.Lock(), 0.0, 0.0)}),  # cannot be pickled
        (PICK, {"goal": (lambda: 0.0, 0.0, 0.0)}),
        (PICK, {"timeout": 10**5000}),
    )
    for request, odd in poisons:
        assert isinstance(ask(pool, dataclasses.replace(request, **odd)), BadQuery), odd
    assert isinstance(ask(pool, PICK), Plan)
    assert pid(pool) == worker


def test_cancel_kills_the_process_and_the_next_job_succeeds(pool: Pool) -> None:
    assert isinstance(ask(pool, PICK), Plan)
    worker, running_job, waiting_job = pid(pool), Answer(), Answer()
    job = pool.submit(LONG, running_job)
    waiting = pool.submit(PICK, waiting_job)
    taken = threading.Event()
    while pool._slots[0].job is not job:
        taken.wait(0.001)
    waiting.cancel()
    assert isinstance(waiting_job.wait(), PlanCanceled)
    assert not running_job.results
    job.cancel()
    assert isinstance(running_job.wait(), PlanCanceled)
    job.cancel()
    assert isinstance(ask(pool, PICK), Plan)
    wait_until_gone(worker)
    assert len(running_job.results) == 1


def test_a_bug_in_a_thread_of_the_pool_ends_only_its_job(
    pool: Pool, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_arguments: object) -> None:
        raise KeyError("x")

    assert isinstance(ask(pool, PICK), Plan)
    with monkeypatch.context() as patched:
        patched.setattr(AnswerChecker, "check", fail)
        died = ask(pool, PICK)
    assert isinstance(died, WorkerDied)
    assert died.why == "KeyError: 'x'"
    assert "KeyError" in caplog.text
    assert isinstance(ask(pool, PICK), Plan)


def test_a_process_that_cannot_be_started_is_tried_again_by_each_job(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_robot: Robot) -> ForkServer:
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(fork_server, "ForkServer", refuse)
    pool = Pool(robot, 1, RealClock())
    pool.start()
    for _ in range(2):
        died = ask(pool, PICK)
        assert isinstance(died, WorkerDied)
        assert "Too many open files" in died.why
    monkeypatch.undo()
    assert isinstance(ask(pool, PICK), Plan)
    pool.close()


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGABRT, signal.SIGSEGV])
def test_a_worker_that_dies_affects_only_its_job(pool: Pool, how: signal.Signals) -> None:
    assert isinstance(ask(pool, PICK), Plan)
    answer = Answer()
    pool.submit(LONG, answer)
    until_at_work(pid(pool))
    os.kill(pid(pool), how)
    died = answer.wait()
    assert isinstance(died, WorkerDied)
    assert how.name in died.why
    assert isinstance(ask(pool, PICK), Plan)


@pytest.mark.slow
def test_a_worker_that_dies_while_idle_affects_no_job(pool: Pool) -> None:
    assert isinstance(ask(pool, PICK), Plan)
    worker = idle(pool)
    os.kill(worker, signal.SIGKILL)
    wait_for_end(worker)
    assert isinstance(ask(pool, PICK), Plan)


@pytest.mark.slow
def test_a_worker_that_dies_while_idle_is_replaced(robot: Robot) -> None:
    pool = Pool(robot, 2, RealClock())
    pool.start()
    dead, other = pool._slots
    until(lambda: dead.idle and dead.process and dead.process.forked)
    until(lambda: other.idle and other.process and other.process.forked)
    assert dead.process
    assert other.process
    worker, living = dead.process.pid, other.process.pid
    assert worker
    os.kill(worker, signal.SIGKILL)
    wait_for_end(worker)
    answer = Answer()
    pool.submit(PICK, answer)
    assert isinstance(answer.wait(), Plan)
    assert other.process.pid == living
    until(lambda: dead.process and dead.process.pid != worker)  # without a request
    pool.close()


@pytest.mark.slow
def test_a_worker_that_hangs_is_killed(pool: Pool) -> None:
    assert isinstance(ask(pool, BENT), Plan)
    worker, answer = pid(pool), Answer()
    pool.submit(dataclasses.replace(LONG, timeout=2.0), answer)
    os.kill(worker, signal.SIGSTOP)
    assert isinstance(answer.wait(), PlanTimeout)
    assert isinstance(ask(pool, PICK), Plan)
    wait_until_gone(worker)


@pytest.mark.slow
def test_a_worker_that_is_stopped_while_idle_affects_no_job(pool: Pool) -> None:
    assert isinstance(ask(pool, BENT), Plan)
    worker = idle(pool)
    os.kill(worker, signal.SIGSTOP)
    until(lambda: fork_server.is_stopped(worker))
    assert isinstance(ask(pool, PICK), Plan)
    wait_until_gone(worker)


def test_a_worker_that_was_stopped_and_continues_is_kept(pool: Pool) -> None:
    assert isinstance(ask(pool, PICK), Plan)
    worker = idle(pool)
    os.kill(worker, signal.SIGSTOP)
    until(lambda: fork_server.is_stopped(worker))
    os.kill(worker, signal.SIGCONT)
    assert isinstance(ask(pool, PICK), Plan)
    assert pid(pool) == worker


class _Hungry:
    """Needs more memory when it is unpickled than a worker may use."""

    def __reduce__(self) -> tuple[type[bytearray], tuple[int]]:
        return bytearray, (8 * 2**30,)


@pytest.mark.slow
def test_a_worker_with_too_much_memory_affects_only_its_job(pool: Pool) -> None:
    died = ask(pool, dataclasses.replace(PICK, seed=cast("int", _Hungry())))
    assert isinstance(died, WorkerDied)
    assert "MemoryError" in died.why
    assert isinstance(ask(pool, PICK), Plan)


LIMITED = """
import resource, sys, threading
from hardware import RealClock, load_robot
from skills.motion import MotionError, Pool, Query
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]),) * 2)
try:
    pool = Pool(load_robot(), 1, RealClock())
except MotionError as error:
    print(error.code, error.exit_status, error)
    sys.exit()
pool.start()
there = threading.Event()
pool.submit(
    Query("arm", (0.0,) * 4, (-1.4, -0.6, -0.07), timeout=60.0),
    lambda answer: (print(type(answer).__name__), there.set()),
)
there.wait()
pool.close()
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limit", "says"),
    [
        (2**30, "Plan"),
        (2**32 - 2**20, "Plan"),
        (
            2**30 - 1024,
            "plan.memory 3 The operating system allows 1048575 KiB of address space to a process; "
            "armtree needs 1048576 KiB; raise the limit (`ulimit -v`), then run again",
        ),
    ],
)
def test_a_hard_limit_of_the_address_space(limit: int, says: str) -> None:
    """A worker takes the smaller limit: its own, or that of the operating system."""
    command = [sys.executable, "-c", LIMITED, str(limit)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    assert (run.stdout.decode().strip(), run.stderr.decode()) == (says, "")


def test_other_requests(pool: Pool) -> None:
    start = PICK.start
    reached = ask(pool, ToolQuery("arm", start, (0.1, 0.05, 0.08)))
    assert isinstance(reached, Reached)
    world = World((Body("cube", Box((0.02, 0.02, 0.02)), (0.0, 0.15, 0.1)),))
    held = ask(pool, Carry(world, "cube", "claw_support", start))
    assert isinstance(held, Body)
    assert held.link == "claw_support"
    inside = World((Body("cube", Box((0.1, 0.1, 0.1)), (0.0, 0.1, 0.15)),))
    blocked = ask(pool, dataclasses.replace(PICK, world=inside))
    assert isinstance(blocked, StartInCollision)
    assert "cube" in (blocked.first, blocked.second)


def test_ctrl_c_does_not_reach_a_worker(pool: Pool) -> None:
    assert isinstance(ask(pool, PICK), Plan)
    worker = pid(pool)
    os.kill(worker, signal.SIGINT)
    assert isinstance(ask(pool, PICK), Plan)
    assert pid(pool) == worker
    assert os.getsid(worker) != os.getsid(0)


@pytest.mark.slow
def test_an_unusable_model_is_reported(robot: Robot, tmp_path: Path) -> None:
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot name='x'><link name='a'/><link name='b'/></robot>")
    pool = Pool(dataclasses.replace(robot, urdf=broken), 1, RealClock())
    pool.start()
    assert isinstance(ask(pool, PICK), ModelUnusable)
    assert pool._server
    server = pool._server.pid
    for _ in range(5):
        assert isinstance(ask(pool, PICK), ModelUnusable)
    assert pool._server.pid == server  # it is known, so the robot is not loaded again
    pool.close()


@pytest.mark.slow
def test_close_cancels_all_and_leaves_nothing(robot: Robot) -> None:
    before = set(threading.enumerate())
    pool = Pool(robot, 2, RealClock())
    pool.start()
    assert isinstance(ask(pool, PICK), Plan)
    answers = [Answer() for _ in range(4)]
    for answer in answers:
        pool.submit(LONG, answer)
    workers = [slot.process.pid for slot in pool._slots if slot.process]
    pool.close()
    pool.close()
    assert all(isinstance(answer.wait(), PlanCanceled) for answer in answers)
    assert set(threading.enumerate()) == before
    assert not any(running(worker) for worker in workers if worker)
    assert isinstance(ask(pool, PICK), PlanCanceled)


@pytest.mark.slow
def test_simulated_time_stands_still_while_a_worker_plans(robot: Robot) -> None:
    clock = SimulatedClock()
    pool = Pool(robot, 1, clock)
    pool.start()
    with clock.working():
        signal_, answer = clock.signal(), Answer()

        def done(result: Result) -> None:
            answer(result)
            with signal_:
                signal_.notify()

        pool.submit(PICK, done)
        with signal_:
            while not answer.results:
                signal_.wait(3600.0)
        assert clock.now() == 0.0
    assert isinstance(answer.wait(), Plan)
    pool.close()


ORPHAN = """
import os, sys, threading
from hardware import RealClock, load_robot
from skills.motion import Pool, Query
pool = Pool(load_robot(), 1, RealClock())
pool.start()
there = threading.Event()
pool.submit(Query("gripper", (0.0, 0.0, 0.0, 0.0), (-0.7,)), lambda result: there.set())
there.wait()
print(pool._slots[0].process.pid, flush=True)
os._exit(0)
"""


@pytest.mark.slow
def test_workers_end_with_their_parent() -> None:
    root = str(ROOT)
    with subprocess.Popen(
        [sys.executable, "-c", ORPHAN], cwd=root, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout
        worker = int(parent.stdout.readline())
    gone = threading.Thread(target=wait_for_end, args=(worker,))
    gone.start()
    gone.join(5.0)
    assert not gone.is_alive()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "unused"),
    [
        ("skills.motion", {"pinocchio", "coal", "matplotlib"}),
        ("skills.motion.workers.worker_main", {"py_trees", "ruamel", "click", "matplotlib"}),
    ],
    ids=["parent", "worker"],
)
def test_a_process_loads_only_the_libraries_it_needs(module: str, unused: set[str]) -> None:
    code = f"import sys, {module}; print(sorted({unused} & set(sys.modules)))"
    root = str(ROOT)
    out = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, check=True)
    assert out.stdout == b"[]\n"
