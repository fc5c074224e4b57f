"""Starts a worker process, sends requests to it, and receives its answers."""

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hardware import Robot
from skills.motion.errors import BadQuery, MotionError, PlanTimeout, WorkerDied, shown
from skills.motion.query import Query, Request, Result, check_types
from skills.motion.world import EMPTY, World

from .answer_checker import AnswerChecker
from .messages import InvalidMessage, encode, receive, send

_PROGRAM = "skills.motion.workers.worker_main"
_MAX_TIMEOUT = 86_400.0  # largest timeout of a request [s]
_GRACE = 0.008  # a worker that has not answered this time after the timeout is killed [s]
_SLOW = 0.1  # requests that take longer are likely to be canceled [s]
_EXIT = 5.0  # longest wait for the exit status after the worker closed its socket [s]
_FEW = 100  # a request with fewer via points and bodies in total is encoded quickly
_STOPPED_NOW = os.WSTOPPED | os.WNOHANG | os.WNOWAIT
_START = 30.0  # longest time to load the robot on a slow machine [s]


class WorkerProcess:
    """A worker process for planning. It starts when the object is created.

    The first `call` waits until the worker is ready. The worker has its own session, so Ctrl-C in
    the terminal does not reach it. It ends when its socket is closed, at the latest when the parent
    process ends.

    Args:
        robot: The robot for which the worker plans.
        world: World that the worker loads at its start. Default: the empty world.
    """

    def __init__(self, robot: Robot, world: World = EMPTY) -> None:
        ours, theirs = socket.socketpair()
        self._output = tempfile.TemporaryFile()  # noqa: SIM115, closed by `close`
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", _PROGRAM, str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=self._output,
                env=_environment(),
                start_new_session=True,
            )
        self._socket = ours
        self._ready = self._killed = False
        self._unusable: MotionError | None = None  # error of the worker if the robot is unusable
        self._answers = AnswerChecker(robot)
        self._number = 0  # number of the last request
        self._ahead: tuple[float, bytes] | None = None  # deadline, and bytes still to send
        self._send_setup(robot, world)

    @property
    def pid(self) -> int:
        """Process id of the worker."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """True while the worker runs. False after `kill`, or if SIGSTOP has stopped the worker."""
        return not self._killed and self._process.poll() is None and not self._stopped()

    def call(self, request: Request, slow: Callable[[], None] | None = None) -> Result:
        """Send a request to the worker. Wait for its answer, and return the answer or an error.

        Errors are not raised. After the call, `alive` is False if the worker died, did not answer
        in time or sent an invalid answer.

        Args:
            request: The request.
            slow: Callback that is called once if the answer takes longer than `_SLOW`.
        """
        ahead, self._ahead = self._ahead, None
        if invalid := _check(request):
            return invalid
        if not self._ready and (failed := self._wait_until_ready()):
            return failed
        try:
            until, message = ahead or self._encode(request)
            if message:
                send(self._socket, message, until)
            if slow and self._is_slow(until):
                slow()
            return self._answers.check(request, self._answer_of(receive(self._socket, until)))
        except BadQuery as error:
            return error
        except TimeoutError:
            self.kill()
            return PlanTimeout(request.timeout)
        except (EOFError, OSError):
            return self._died(until)
        except InvalidMessage as error:
            return self._invalid(str(error))

    def send_ahead(self, request: Request) -> None:
        """Send as much of the next request as possible without blocking, before its `call`.

        Sends only small requests. If there is an error, `call` returns it later.
        """
        if not self._ready or _check(request) or not _is_small(request):
            return
        with contextlib.suppress(BadQuery, OSError):
            self._ahead = until, message = self._encode(request)
            sent = self._socket.send(message, socket.MSG_DONTWAIT)
            self._ahead = until, message[sent:]

    def kill(self) -> None:
        """Kill the worker. Any thread may call this method, also more than once."""
        self._killed = True
        self._process.kill()
        # Wakes a waiting `call` at once, before the operating system has cleaned up the process.
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Kill the worker, and free its resources."""
        self.kill()
        self._process.wait()
        self._socket.close()
        self._output.close()

    def _stopped(self) -> bool:
        try:
            return os.waitid(os.P_PID, self.pid, _STOPPED_NOW) is not None
        except ChildProcessError:  # another thread has read its exit status meanwhile
            return False

    def _is_slow(self, until: float) -> bool:
        """Wait for an answer. Return True if there is none after `_SLOW`, and time is left."""
        if until - time.monotonic() < _SLOW:
            return False
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        return not poll.poll(1e3 * _SLOW)

    def _send_setup(self, robot: Robot, world: World) -> None:
        try:
            self._socket.sendall(encode((robot, world)))
        except OSError:
            self.kill()  # the first `call` returns the error

    def _wait_until_ready(self) -> MotionError | None:
        """Wait until the worker has loaded the robot. Return None, or the error if this failed."""
        until = time.monotonic() + _START
        try:
            answer = self._unusable or receive(self._socket, until)
        except TimeoutError:
            return self._invalid(f"nothing within {_START:g} s of its start")
        except (EOFError, OSError):
            return self._died(until)
        except InvalidMessage as error:
            return self._invalid(str(error))
        if isinstance(answer, MotionError):
            self._unusable = answer
            return answer
        if answer is not None:
            return self._invalid(f"{type(answer).__name__} when it started")
        self._ready = True
        return None

    def _encode(self, request: Request) -> tuple[float, bytes]:
        """Return the deadline of a request that is sent now [s], and the message to send.

        Raises:
            BadQuery: The request cannot be pickled.
        """
        until = time.monotonic() + max(request.timeout, 0.0) + _GRACE
        self._number += 1
        try:
            return until, encode((self._number, request))
        except Exception as error:  # a value in the request may raise any exception
            what = f"The request cannot be sent to a worker ({shown(error)}); give plain numbers"
            raise BadQuery(what) from error

    def _answer_of(self, message: object) -> Any:
        """Return the answer in a message.

        Raises:
            InvalidMessage: The message does not answer the last request.
        """
        if isinstance(message, tuple) and len(message) == 2 and type(message[0]) is int:
            number, answer = message
            if number == self._number:
                return answer
            raise InvalidMessage(f"request {number}, not {self._number}")
        raise InvalidMessage(f"{type(message).__name__} without the number of the request")

    def _invalid(self, what: str) -> WorkerDied:
        self.kill()
        return WorkerDied(f"it answered {what}")

    def _died(self, until: float) -> WorkerDied:
        """Return the error for a worker that ended or closed its socket.

        Args:
            until: Longest time to wait for the exit status, on the monotonic clock [s].
        """
        if self._killed:
            return WorkerDied("it was killed")
        try:
            code = self._process.wait(min(_EXIT, max(0.0, until - time.monotonic())))
        except subprocess.TimeoutExpired:
            self.kill()
            return WorkerDied("it closed its socket")
        self.kill()
        how = f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        return WorkerDied(how + self._last_line())

    def _last_line(self) -> str:
        """Return the last line of the worker's output in brackets; empty if there is no output."""
        self._output.seek(0)
        lines = self._output.read().decode(errors="replace").strip().splitlines()
        return f" ({lines[-1].strip()})" if lines else ""


def _is_small(request: Request) -> bool:
    """Return True if a request is small enough to be encoded without delaying other threads."""
    return isinstance(request, Query) and len(request.via) + len(request.world.bodies) < _FEW


def _check(request: Request) -> BadQuery | None:
    """Return an error if a request is not valid and could crash a worker, else None."""
    try:
        check_types(request)
    except BadQuery as error:
        return error
    timeout = request.timeout
    # NaN fails this comparison.
    if isinstance(timeout, (int, float)) and abs(timeout) <= _MAX_TIMEOUT:
        return None
    return BadQuery(f"The timeout is {shown(timeout)} s; give a number up to {_MAX_TIMEOUT:g}")


def _environment() -> dict[str, str]:
    """Return the environment for a worker.

    It is the environment of this process, with armtree on the Python path and with one thread for
    each numeric library.
    """
    rooms = str(Path(__file__).parents[3])
    paths = [rooms, *filter(None, [os.environ.get("PYTHONPATH")])]
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **single, "PYTHONPATH": os.pathsep.join(paths)}
