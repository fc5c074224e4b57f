"""A pool of worker processes, so that planning can be canceled at once and blocks no thread."""

import logging
from collections import deque
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from threading import Lock, Thread
from typing import TYPE_CHECKING, TypeVar

from hardware import Clock, Robot
from skills.motion.errors import MotionError, PlanCanceled, WorkerDied
from skills.motion.query import Carry, Reached, Request, Result, ToolQuery
from skills.motion.world import Body

from .memory import check_memory

if TYPE_CHECKING:
    from .fork_server import ForkServer
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
        workers: Number of processes. With several, an idle one that was forked before the fork
            server knew a world loads this world itself.
        clock: Time source, on which the threads wait for jobs. Simulated time stands still while a
            worker plans, but passes while a worker starts.

    Raises:
        TooLittleMemory: The operating system allows less address space than planners need.
    """

    # All processes are forked from one that has loaded the robot and the latest world, so the next
    # request after a kill loads nothing.

    def __init__(self, robot: Robot, workers: int, clock: Clock) -> None:
        check_memory()
        self._robot, self._clock = robot, clock
        self._signal = clock.signal()
        self._queue: deque[Job] = deque()
        self._slots = [_Slot() for _ in range(workers)]
        self._server: ForkServer | None = None
        self._starting = Lock()  # for the fork server
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
        if self._server:
            self._server.close()
            self._server = None

    def _serve(self, slot: "_Slot") -> None:
        """Start the process of a slot, and let it answer jobs until the pool is closed."""
        self._prepare(slot)
        while self._wait_for_job(slot):
            if slot.job:
                self._finish(slot, slot.job)
            self._prepare(slot)
        slot.close()

    def _finish(self, slot: "_Slot", job: Job) -> None:
        """Answer a job. Then let the fork server load the job's world, unless another job waits.

        After an error, it is not loaded: the worker may have failed to load it.
        """
        result = self._answer(slot, job)
        job.done(result)
        if not (self._queue or isinstance(result, MotionError)):
            self._load(job)

    def _prepare(self, slot: "_Slot") -> None:
        """Start a process for the next job. If this fails, the next job tries it again."""
        try:
            self._ensure_process(slot)
        except Exception:
            logger.exception("no planning process could be started")

    def _ensure_process(self, slot: "_Slot") -> None:
        """Fork a process if the slot has none that is alive."""
        from .worker_process import WorkerProcess  # imports NumPy

        if not slot.alive:
            slot.close()
            process = WorkerProcess(self._live_server(), self._robot)
            with self._signal:
                slot.process = process

    def _live_server(self) -> "ForkServer":
        """Return the fork server. Start a new one if it has died."""
        from .fork_server import ForkServer

        with self._starting:
            if self._server and not self._server.alive:
                self._server.close()
                self._server = None
            self._server = self._server or ForkServer(self._robot)
            return self._server

    def _load(self, job: Job) -> None:
        """Let the fork server load the world of a job. A Rest has no world."""
        server, world = self._server, getattr(job.request, "world", None)
        if server and world is not None:
            server.load(world)

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
            for _ in range(2):
                self._ensure_process(slot)  # the worker may have died while it was idle
                with self._signal:
                    process = None if slot.canceled else slot.process
                if process:
                    result = process.call(job.request, partial(self._load, job))
                # If the fork server ended before the fork, another worker may answer.
                if not (process and isinstance(result, WorkerDied)) or process.forked:
                    break
        except Exception as error:
            # A bug, or the system cannot start a process. The caller still needs a result.
            logger.exception("a planning process cannot be used")
            slot.close()
            result = WorkerDied(f"{type(error).__name__}: {error}")
        with self._signal:
            slot.job = None
            return PlanCanceled() if slot.canceled else result


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
