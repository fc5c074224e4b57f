"""A pool of worker processes, so that planning can be ended at once and disturbs nobody."""

from collections import deque
from collections.abc import Callable
from functools import partial
from threading import Thread

from hardware import Clock, Robot
from skills.motion.errors import PlanCanceled
from skills.motion.query import Request, Result

from .process import WorkerProcess


class Job:
    """A request handed to the pool."""

    def __init__(self, pool: "Pool", request: Request, done: Callable[[Result], None]) -> None:
        self._pool = pool
        self.request = request
        self.done = done

    def cancel(self) -> None:
        """End it; its result is PlanCanceled, unless it has one already. Returns at once.

        A job that still waits is told from this thread, one that runs from the pool's, as soon as
        its process is dead.
        """
        self._pool.cancel(self)


class Pool:
    """Worker processes for one robot, each with a thread that waits for it.

    Args:
        robot: Whose motions are planned.
        workers: How many processes.
        clock: Threads are made by it and wait for jobs on it. Simulated time stands still while a
            worker plans, but passes while one starts.
    """

    def __init__(self, robot: Robot, workers: int, clock: Clock) -> None:
        self._robot, self._clock = robot, clock
        self._signal = clock.signal()
        self._queue: deque[Job] = deque()
        self._seats = [_Seat() for _ in range(workers)]
        self._closed = False

    def start(self) -> None:
        """Start the processes in the background; returns at once."""
        for number, seat in enumerate(self._seats):
            seat.thread = self._clock.spawn(partial(self._serve, seat), f"plan-{number}")

    def submit(self, request: Request, done: Callable[[Result], None]) -> Job:
        """Have a request answered by the next free worker.

        Args:
            request: What `Planner.answer` answers.
            done: Called exactly once, with its answer or the MotionError; from a thread of the
                pool, or from within `Job.cancel` and `close`. It must not block and must not raise.
        """
        job = Job(self, request, done)
        with self._signal:
            if not self._closed:
                if self._queue or not self._begin(job):
                    self._queue.append(job)
                self._signal.notify()
                return job
        done(PlanCanceled())
        return job

    def cancel(self, job: Job) -> None:
        """See `Job.cancel`."""
        with self._signal:
            waiting = job in self._queue
            if waiting:
                self._queue.remove(job)
            for seat in self._seats:
                if seat.job is job:
                    seat.end()
        if waiting:
            job.done(PlanCanceled())

    def close(self) -> None:
        """Cancel everything, end all processes and threads. May be called again."""
        with self._signal:
            self._closed = True
            dropped = list(self._queue)
            self._queue.clear()
            for seat in self._seats:
                seat.end()
            self._signal.notify()
        for job in dropped:
            job.done(PlanCanceled())
        for seat in self._seats:
            if seat.thread:
                seat.thread.join()

    def _serve(self, seat: "_Seat") -> None:
        """What the thread of a worker does."""
        self._seated(seat)
        while self._next(seat):
            if seat.job:
                done = seat.job.done
                done(self._answer(seat, seat.job))
            self._seated(seat)
        seat.close()

    def _seated(self, seat: "_Seat") -> None:
        """See to it that a living process sits there."""
        if not seat.alive:
            seat.close()
            process = WorkerProcess(self._robot)
            with self._signal:
                seat.process = process

    def _begin(self, job: Job) -> bool:
        """Have an idle worker begin at once: it works while its thread here wakes up."""
        seat = next((seat for seat in self._seats if seat.idle and seat.alive), None)
        if not (seat and seat.process):
            return False
        seat.job, seat.ended, seat.idle = job, False, False
        seat.process.begin(job.request)
        return True

    def _next(self, seat: "_Seat") -> bool:
        """Wait for a job, or for a dead process to be found; False when the pool closes."""
        with self._signal:
            while not seat.job and not self._closed and seat.alive:
                if self._queue:
                    seat.job, seat.ended = self._queue.popleft(), False
                else:
                    seat.idle = True
                    self._signal.wait(None)
                    seat.idle = False
            return seat.job is not None or not self._closed

    def _answer(self, seat: "_Seat", job: Job) -> Result:
        self._seated(seat)  # it may have died while it had nothing to do
        with self._signal:
            process = None if seat.ended else seat.process
        result = process.ask(job.request) if process else PlanCanceled()
        with self._signal:
            seat.job = None
            return PlanCanceled() if seat.ended else result


class _Seat:
    """Where a worker sits: its process, its thread here, and the job it is at.

    Attributes:
        ended: Whether that job was canceled, and the process killed for it.
        idle: Whether its thread waits for a job.
    """

    def __init__(self) -> None:
        self.process: WorkerProcess | None = None
        self.thread: Thread | None = None
        self.job: Job | None = None
        self.ended = self.idle = False

    @property
    def alive(self) -> bool:
        return self.process is not None and self.process.alive

    def end(self) -> None:
        self.ended = True
        if self.process:
            self.process.kill()

    def close(self) -> None:
        if self.process:
            self.process.close()
            self.process = None
