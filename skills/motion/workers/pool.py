"""A pool of worker processes, so that planning can be canceled at once and blocks no thread."""

import logging
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, TypeVar

from hardware import Clock, Robot
from skills.motion.errors import MotionError, PlanCanceled, WorkerDied
from skills.motion.query import Carry, Reached, Request, Result, ToolQuery
from skills.motion.world import EMPTY, Body, World

from .memory import check_memory, has_spare_memory

if TYPE_CHECKING:
    from .worker_process import WorkerProcess

logger = logging.getLogger(__name__)

T = TypeVar("T")


class Job:
    """A request that was submitted to a pool.

    Args:
        pool: The pool.
        request: The request.
        done: Callback for the result.
    """

    def __init__(self, pool: "Pool", request: Request, done: Callable[[Result], None]) -> None:
        self._pool = pool
        self.request = request
        self.done = done

    def cancel(self) -> None:
        """Cancel the job and return at once. If the job has no result yet, it gets PlanCanceled.

        If the job is waiting, its callback runs in the calling thread. If a worker already answers
        it, the worker is killed, and the callback then runs in a thread of the pool.
        """
        self._pool.cancel(self)


class Pool:
    """A pool of worker processes for one robot. A thread waits for the answers of each process.

    Args:
        robot: The robot for which the workers plan.
        workers: Number of processes.
        clock: Time source, on which the threads wait for jobs. Simulated time stands still while a
            worker plans, but passes while a worker starts.
        standby: True to keep a standby process after the first answer, if there is enough memory.
            If a worker is killed, the next request then does not wait for the start of a process.
            Default: a standby process is started only during a slow request.

    Raises:
        TooLittleMemory: The operating system allows less address space than planners need.
    """

    # A process starts within 0.3 to 0.5 s, and needs 40 to 60 MB of memory (measured; a mesh of
    # 400,000 triangles adds 250 MB). A standby process is useful for a server, not for a command
    # that plans a few times and ends. It starts only after the first answer: a server without goals
    # needs no second process, the first process then loads faster, and the world is known later.

    def __init__(self, robot: Robot, workers: int, clock: Clock, *, standby: bool = False) -> None:
        check_memory()
        self._robot, self._clock, self._keeps_standby = robot, clock, standby
        self._signal = clock.signal()
        self._queue: deque[Job] = deque()
        self._slots = [_Slot() for _ in range(workers)]
        self._standby: WorkerProcess | None = None
        self._closed = False

    def start(self) -> None:
        """Start the processes in the background and return at once. Further calls do nothing."""
        for number, slot in enumerate(self._slots):
            slot.thread = slot.thread or self._clock.spawn(
                partial(self._serve, slot), f"plan-{number}"
            )

    def submit(self, request: Request, done: Callable[[Result], None]) -> Job:
        """Give a request to the next free worker. Return its job at once.

        Args:
            request: A request that `Planner.answer` accepts.
            done: Callback for the answer or the MotionError. The pool calls it exactly once: from
                one of its threads, or inside `Job.cancel` or `close`. It must not block or raise.
        """
        job = Job(self, request, done)
        with self._signal:
            if not self._closed:
                if self._queue or not self._assign(job):
                    self._queue.append(job)
                self._signal.notify()
                return job
        done(PlanCanceled())
        return job

    def ask(self, request: Request) -> Result:
        """Wait until a worker has answered a request. Return the answer or the MotionError."""
        answers: SimpleQueue[Result] = SimpleQueue()
        self.submit(request, answers.put)
        return answers.get()

    def reach(self, query: ToolQuery) -> Reached:
        """Return joint positions that bring the tool to the query's point; see `Planner.reach`."""
        return self._wanted(query, Reached)

    def carry(self, request: Carry) -> Body:
        """Return a body at the same pose, attached to another link; see `Planner.carry`."""
        return self._wanted(request, Body)

    def _wanted(self, request: Request, kind: type[T]) -> T:
        """Wait for the answer to a request. Return the answer, or raise it if it is an error."""
        answer = self.ask(request)
        if isinstance(answer, MotionError):
            raise answer
        assert isinstance(answer, kind)
        return answer

    def cancel(self, job: Job) -> None:
        """Cancel a job; see `Job.cancel`."""
        with self._signal:
            waiting = job in self._queue
            if waiting:
                self._queue.remove(job)
            for slot in self._slots:
                if slot.job is job:
                    slot.cancel()
        if waiting:
            job.done(PlanCanceled())

    def close(self) -> None:
        """Cancel all jobs, and end all processes and threads. Further calls do nothing."""
        with self._signal:
            self._closed = True
            dropped = list(self._queue)
            self._queue.clear()
            for slot in self._slots:
                slot.cancel()
            self._signal.notify()
        for job in dropped:
            job.done(PlanCanceled())
        for slot in self._slots:
            if slot.thread:
                slot.thread.join()
        if self._standby:
            self._standby.close()
            self._standby = None

    def _serve(self, slot: "_Slot") -> None:
        """Start the process of a slot, and let it answer jobs until the pool is closed."""
        self._prepare(slot)
        while self._wait_for_job(slot):
            if slot.job:
                self._finish(slot, slot.job)
            self._prepare(slot)
        slot.close()

    def _finish(self, slot: "_Slot", job: Job) -> None:
        """Answer a job. Then start the standby process, unless another job waits.

        After an error, no standby process is started: the worker may still load the robot, or the
        world may be invalid.
        """
        result = self._answer(slot, job)
        job.done(result)
        if self._keeps_standby and not (self._queue or isinstance(result, MotionError)):
            self._prepare_standby(_world(job))

    def _prepare(self, slot: "_Slot") -> None:
        """Start a process for the next job. If this fails, the next job tries it again."""
        try:
            self._ensure_process(slot)
        except Exception:
            logger.exception("no planning process could be started")

    def _ensure_process(self, slot: "_Slot") -> None:
        from .worker_process import WorkerProcess  # imports NumPy

        if not slot.alive:
            slot.close()
            with self._signal:
                slot.process, self._standby = self._standby, None
            if not slot.alive:
                slot.close()
                process = WorkerProcess(self._robot)
                with self._signal:
                    slot.process = process

    def _prepare_standby(self, world: World) -> None:
        """Start a standby process if there is none and if there is enough memory.

        Args:
            world: World in which the workers plan. The standby process loads it.
        """
        with self._signal:
            usable = self._standby is not None and self._standby.alive
            wanted = not (usable or self._closed)
        if wanted and has_spare_memory():
            from .worker_process import WorkerProcess

            with suppress(OSError):  # the standby process is optional
                process = WorkerProcess(self._robot, world)
                with self._signal:
                    spare, self._standby = self._standby, process
                if spare:  # this standby process died, or another thread has just started it
                    spare.close()

    def _assign(self, job: Job) -> bool:
        """Give a job to an idle worker, and return True; return False if no worker is idle.

        The worker receives the request while the thread that waits for it still wakes up.
        """
        slot = next((slot for slot in self._slots if slot.idle and slot.alive), None)
        if not (slot and slot.process):
            return False
        slot.job, slot.canceled, slot.idle = job, False, False
        slot.process.send_ahead(job.request)
        return True

    def _wait_for_job(self, slot: "_Slot") -> bool:
        """Wait for a job or for the end of the worker process.

        Returns False if the pool is closed and no job is left.
        """
        with self._signal:
            while not slot.job and not self._closed and (slot.alive or not slot.process):
                if self._queue:
                    slot.job, slot.canceled = self._queue.popleft(), False
                else:
                    slot.idle = True
                    self._signal.wait(None)
                    slot.idle = False
            return slot.job is not None or not self._closed

    def _answer(self, slot: "_Slot", job: Job) -> Result:
        result: Result = PlanCanceled()
        try:
            self._ensure_process(slot)  # the worker may have died while it was idle
            with self._signal:
                process = None if slot.canceled else slot.process
            if process:
                result = process.call(job.request, partial(self._prepare_standby, _world(job)))
        except Exception as error:
            # A bug, or the system cannot start a process. The caller still needs a result.
            logger.exception("a planning process cannot be used")
            slot.close()
            result = WorkerDied(f"{type(error).__name__}: {error}")
        with self._signal:
            slot.job = None
            return PlanCanceled() if slot.canceled else result


def _world(job: Job) -> World:
    """Return the world of a job's request; the empty world for a Rest, which has no world."""
    return getattr(job.request, "world", EMPTY)


class _Slot:
    """A worker of the pool: a process, the thread that waits for the process, and the current job.

    Attributes:
        process: The worker process; None if it is closed or not started yet.
        thread: Thread of this process that waits for the worker process.
        job: The current job, or None.
        canceled: True if the current job was canceled and the worker process was killed.
        idle: True while the thread waits for a job.
    """

    def __init__(self) -> None:
        self.process: WorkerProcess | None = None
        self.thread: Thread | None = None
        self.job: Job | None = None
        self.canceled = self.idle = False

    @property
    def alive(self) -> bool:
        return self.process is not None and self.process.alive

    def cancel(self) -> None:
        self.canceled = True
        if process := self.process:  # another thread may close it meanwhile
            process.kill()

    def close(self) -> None:
        if self.process:
            self.process.close()
            self.process = None
