"""The parent's side of one worker process."""

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
_GRACE = 0.008  # time after a request's timeout until the worker counts as hanging [s]
_SLOW = 0.1  # longer requests are likely to be canceled [s]
_EXIT = 5.0  # longest wait for the exit status after the worker closed its socket [s]
_FEW = 100  # largest number of via points and bodies in a quickly encoded request
_MANY = 1000  # largest number of bodies in a world that is sent before the process can read
_STOPPED_NOW = os.WSTOPPED | os.WNOHANG | os.WNOWAIT
_START = 30.0  # longest time to load the robot on a slow machine [s]


class WorkerProcess:
    """A process that plans. It starts at once. The first `call` waits until it is ready.

    The process has its own session, so a Ctrl-C on the terminal does not reach it. It ends when its
    socket closes, at the latest at the end of this process.

    Args:
        robot: The robot to plan for.
        world: World to load at once. Default: the empty world.
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
        self._unusable: MotionError | None = None  # its error if the robot is unusable
        self._answers = AnswerChecker(robot)
        self._number = 0  # number of the last request
        self._ahead: tuple[float, bytes] | None = None  # deadline, and bytes still to send
        self._send_setup(robot, world if len(world.bodies) <= _MANY else EMPTY)

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """True while the process runs. False after `kill`, or if it is stopped (SIGSTOP)."""
        return not self._killed and self._process.poll() is None and not self._stopped()

    def call(self, request: Request, slow: Callable[[], None] | None = None) -> Result:
        """Wait for the answer to a request and return it. Errors are returned, not raised.

        After the call, `alive` is False if the worker died, hung or sent an invalid answer.

        Args:
            request: The request.
            slow: Callback for an answer that takes longer than `_SLOW`.
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
            if slow and not self._answers_soon():
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
        """Send the next request before its `call`, as far as possible without blocking.

        Only sends small requests. `call` returns an error.
        """
        if not self._ready or _check(request) or not _is_small(request):
            return
        with contextlib.suppress(BadQuery, OSError):
            self._ahead = until, message = self._encode(request)
            sent = self._socket.send(message, socket.MSG_DONTWAIT)
            self._ahead = until, message[sent:]

    def kill(self) -> None:
        """Kill the process. Any thread may call this, also repeatedly."""
        self._killed = True
        self._process.kill()
        # Wakes a waiting `call` before the cleanup of the process.
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """End the process and free its resources."""
        self.kill()
        self._process.wait()
        self._socket.close()
        self._output.close()

    def _stopped(self) -> bool:
        try:
            return os.waitid(os.P_PID, self.pid, _STOPPED_NOW) is not None
        except ChildProcessError:  # another thread has read its exit status meanwhile
            return False

    def _answers_soon(self) -> bool:
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        return bool(poll.poll(1e3 * _SLOW))

    def _send_setup(self, robot: Robot, world: World) -> None:
        try:
            self._socket.sendall(encode((robot, world)))
        except OSError:
            self.kill()  # the first `call` returns the error

    def _wait_until_ready(self) -> MotionError | None:
        """Wait until the process has loaded the robot. Return its error if it cannot load it."""
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
        """Return the deadline of a request that starts now, and the bytes of the request.

        Raises:
            BadQuery: The request cannot be pickled.
        """
        until = time.monotonic() + max(request.timeout, 0.0) + _GRACE
        self._number += 1
        try:
            return until, encode((self._number, request))
        except Exception as error:  # a value in the request may raise any exception
            what = f"It cannot be sent to a worker ({shown(error)}); give plain numbers"
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
        raise InvalidMessage(f"{type(message).__name__} without a number")

    def _invalid(self, what: str) -> WorkerDied:
        self.kill()
        return WorkerDied(f"it answered {what}")

    def _died(self, until: float) -> WorkerDied:
        """Return the cause of its death, if it is known before the deadline."""
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
        """Return the last line of its output in brackets; empty if there is no output."""
        self._output.seek(0)
        lines = self._output.read().decode(errors="replace").strip().splitlines()
        return f" ({lines[-1].strip()})" if lines else ""


def _is_small(request: Request) -> bool:
    """Return True if a request is small enough to be encoded without delaying other threads."""
    return isinstance(request, Query) and len(request.via) + len(request.world.bodies) < _FEW


def _check(request: Request) -> BadQuery | None:
    """Return an error if a request could crash a worker."""
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
    """Return this process's environment, with the rooms' folder and one thread per library."""
    rooms = str(Path(__file__).parents[3])
    paths = [rooms, *filter(None, [os.environ.get("PYTHONPATH")])]
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **single, "PYTHONPATH": os.pathsep.join(paths)}
