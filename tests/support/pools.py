"""Submits requests to a pool of planning processes, and waits for answers and for processes."""

import os
import select
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from skills.motion import Plan, Pool, Query, Request, Result, Verify

PICK = Query("arm", (0.0, 0.0, 0.0, 0.0), (-1.4, -0.6, -0.07))
# 10 000 times across the table and back: seconds of work for a worker.
LONG = Verify([(0.0, 0.0, 0.0, 0.0), (-1.4, 0.0, 0.0, 0.0)] * 5_000, 0.002, timeout=60.0)


class Answer:
    """Receives the result of a job and waits for it."""

    def __init__(self) -> None:
        self.results: list[Result] = []
        self._there = threading.Event()

    def __call__(self, result: Result) -> None:
        self.results.append(result)
        self._there.set()

    def wait(self) -> Result:
        assert self._there.wait(20.0), "no answer"
        assert len(self.results) == 1
        return self.results[0]


def ask(pool: Pool, request: Request) -> Result:
    answer = Answer()
    pool.submit(request, answer)
    return answer.wait()


def pid(pool: Pool) -> int:
    process = pool._slots[0].process
    assert process
    assert process.pid
    return process.pid


def wait_for_end(process: int) -> None:
    """Wait until a process has ended. It may still be a zombie."""
    with suppress(ProcessLookupError):
        watch = os.pidfd_open(process)
        select.select([watch], [], [])
        os.close(watch)


def wait_until_gone(process: int) -> None:
    """Wait until the exit status of a process was read, so that it is no zombie."""
    until(lambda: not running(process))


def until(holds: Callable[[], object]) -> None:
    nap = threading.Event()
    while not holds():
        nap.wait(0.001)


def idle(pool: Pool) -> int:
    """Return the pid of the worker, once its thread has answered and waits for the next job."""
    until(lambda: pool._slots[0].idle)
    return pid(pool)


def until_at_work(process: int) -> None:
    """Wait until a process has used 50 ms of processor time from now on."""
    nap, begun = threading.Event(), ticks(process)
    while ticks(process) < begun + 0.05 * os.sysconf("SC_CLK_TCK"):
        nap.wait(0.005)


def ticks(process: int) -> int:
    """Processor time of a process, in clock ticks; field 14 of its stat line."""
    return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[11])


def running(process: int) -> bool:
    """True if a process exists, also as a zombie."""
    return Path(f"/proc/{process}").exists()


def answered(pool: Pool, request: Query) -> Plan:
    plan = ask(pool, request)
    assert isinstance(plan, Plan)
    return plan
