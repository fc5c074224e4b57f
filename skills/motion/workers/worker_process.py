"""Sends requests to a worker process, and receives its answers."""

import contextlib
import math
import os
import pickle
import select
import signal
import socket
import tempfile
import threading
import time
from collections.abc import Callable
from typing import Any

from hardware import Robot
from skills.motion.errors import BadQuery, BadWorld, MotionError, PlanTimeout, WorkerDied, shown
from skills.motion.query import Query, Request, Result, check_types, checked_world
from skills.motion.world import EMPTY

from .answer_checker import AnswerChecker
from .fork_server import ForkServer, ending, is_readable, is_stopped
from .messages import MESHES_READ, InvalidMessage, encode, receive, send

_MAX_TIMEOUT = 86_400.0  # largest timeout of a request [s]
_GRACE = 0.008  # a worker that has not answered this time after the timeout is killed [s]
_SLOW = 0.02  # a world in which an answer takes longer may take long to load [s]
_EXIT = 5.0  # longest wait for the exit code after the worker closed its socket [s]
_FEW = 100  # a request with fewer via points and bodies in total is encoded quickly
_START = 30.0  # longest time to load the robot on a slow machine [s]
_READ = 30.0  # longest time to read the meshes of a world [s]
_PATIENCE = 0.3  # longest wait for a load of another world; to start a new server takes longer [s]
_REPORT = 65_536  # largest report about a worker [bytes]


class WorkerProcess:
    """A worker process for planning. It is forked when the object is created.

    The first `call` waits until the fork server has loaded the robot. A worker ends when its socket
    is closed, at the latest when the parent process ends.

    Args:
        server: The process from which the worker is forked.
        robot: The robot for which the worker plans.
    """

    def __init__(self, server: ForkServer, robot: Robot) -> None:
        self._server = server
        self._socket, theirs = socket.socketpair()
        self._reports, reports = socket.socketpair(type=socket.SOCK_SEQPACKET)
        self._output = tempfile.TemporaryFile()  # noqa: SIM115, closed by `close`
        with theirs, reports, contextlib.suppress(OSError):  # `call` returns the error
            server.fork(theirs.fileno(), reports.fileno(), self._output.fileno())
        self._lock = threading.Lock()  # for the next five
        self._pid: int | None = None
        self._process: int | None = None  # descriptor of the process, once it is forked
        self._unusable: MotionError | None = None  # error of the server if the robot is unusable
        self._lost = False  # True if the server ended without a report
        self._killed = False
        self._answers = AnswerChecker(robot)
        self._number = 0  # number of the last request
        self._ahead: tuple[float, bytes] | None = None  # deadline, and bytes still to send

    @property
    def pid(self) -> int | None:
        """Process id of the worker; None before it is forked."""
        with self._lock:
            self._read_report()
            return self._pid

    @property
    def forked(self) -> bool:
        """True if the worker was forked."""
        return self.pid is not None

    @property
    def alive(self) -> bool:
        """True while the worker runs, or while the fork server runs that has not forked it yet.

        False after `kill`, or if SIGSTOP has stopped the process.
        """
        with self._lock:
            self._read_report()
            if self._killed or self._lost:
                return False
            if self._process is None or self._pid is None:
                return self._server.alive
            return not (_has_ended(self._process) or is_stopped(self._pid))

    def call(self, request: Request, slow: Callable[[], None] | None = None) -> Result:
        """Send a request to the worker. Wait for its answer, and return the answer or an error.

        Errors are not raised. After the call, `alive` is False if the worker died, did not answer
        in time or sent an invalid answer.

        Args:
            request: The request.
            slow: Callback that is called if the meshes take longer than `_SLOW`, and again if the
                answer does.
        """
        ahead, self._ahead = self._ahead, None
        if invalid := _check(request):
            return invalid
        deadline = self._deadline(request)
        if failed := self._wait_until_forked(request, deadline):
            return failed
        reading = bool(checked_world(request).meshes)
        try:
            until, message = ahead or self._encode(request)
            until = min(until, deadline)
            if message:
                send(self._socket, message, until)
            if reading:
                until = time.monotonic() + _READ
            answer = self._receive(until, slow)
            if reading and isinstance(answer, str) and answer == MESHES_READ:
                reading, until = False, _end(request)
                answer = self._receive(until, slow)
            return self._answers.check(request, answer)
        except BadQuery as error:
            return error
        except TimeoutError:
            self.kill()
            return _unread() if reading else PlanTimeout(request.timeout)
        except (EOFError, OSError):
            return self._died(until)
        except InvalidMessage as error:
            return self._invalid(str(error))

    def send_ahead(self, request: Request) -> None:
        """Send as much of the next request as possible without blocking, before its `call`.

        Sends only small requests. If there is an error, `call` returns it later.
        """
        if not self.forked or _check(request) or not _is_small(request):
            return
        with contextlib.suppress(BadQuery, OSError):
            self._ahead = until, message = self._encode(request)
            sent = self._socket.send(message, socket.MSG_DONTWAIT)
            self._ahead = until, message[sent:]

    def kill(self) -> None:
        """Kill the worker. Any thread may call this method, also more than once."""
        wakes = [self._socket]
        with self._lock:
            self._read_report()
            self._killed = True
            if self._process is None:
                wakes.append(self._reports)
            else:
                _kill(self._process)
        # Wakes a waiting `call` at once, before the operating system has cleaned up the process.
        for each in wakes:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Kill the worker, wait for its end, and free its resources."""
        self.kill()
        if self._process is not None:
            _has_ended(self._process, _EXIT)
            if self._server.alive and not self._server.is_loading():
                is_readable(self._reports, _EXIT)  # then the server has read the exit code
        with self._lock:
            if self._process is not None:
                # Without its server, the worker may have become a child of this process.
                with contextlib.suppress(ChildProcessError):
                    os.waitid(os.P_PIDFD, self._process, os.WEXITED | os.WNOHANG)
                os.close(self._process)
                self._process = None
            for each in (self._socket, self._reports, self._output):
                each.close()

    def _is_slow(self, until: float) -> bool:
        """Wait for an answer. Return True if there is none after `_SLOW`, and time is left."""
        if until - time.monotonic() < _SLOW:
            return False
        return not is_readable(self._socket, _SLOW)

    def _deadline(self, request: Request) -> float:
        """Return when a request ends, on the monotonic clock [s]; infinity if it has not begun.

        It begins when it is sent; if it has no meshes, at once while the server loads a world.
        """
        meshes = checked_world(request).meshes
        if self.forked or meshes or not self._server.is_loading():
            return math.inf
        return _end(request)

    def _receive(self, until: float, slow: Callable[[], None] | None) -> Any:
        """Wait for the next answer of the worker. For `slow`, see `call`.

        Raises:
            TimeoutError, EOFError, OSError, InvalidMessage: As `receive`.
        """
        if slow and self._is_slow(until):
            slow()
        return self._answer_of(receive(self._socket, until))

    def _wait_until_forked(self, request: Request, deadline: float) -> MotionError | None:
        """Wait until the worker is forked. Return None, or an error.

        Args:
            request: The next request. If the server still loads another world after `_PATIENCE`, it
                is killed.
            deadline: Longest time to wait, on the monotonic clock [s].
        """
        if self.forked:
            return None
        world = getattr(request, "world", EMPTY)
        if self._server.is_loading_other(world) and not is_readable(self._reports, _PATIENCE):
            self._server.kill()
        left = min(deadline - time.monotonic(), _START)
        if not is_readable(self._reports, max(left, 0.0)):
            self.kill()
            if deadline < math.inf:
                return PlanTimeout(request.timeout)
            self._server.kill()
            return WorkerDied(f"it answered nothing within {_START:g} s of its start")
        with self._lock:
            self._read_report()
            if self._killed:
                return WorkerDied("it was killed")
            if self._unusable or self._process is not None:
                return self._unusable
        return WorkerDied(self._server.ending())

    def _read_report(self) -> None:
        """Read the report about the fork if it has come. The caller has the lock."""
        missing = self._process is None and not (self._unusable or self._lost or self._killed)
        if not missing or not is_readable(self._reports):
            return
        report, processes = self._report()
        if isinstance(report, MotionError):
            self._unusable = report
        elif processes:
            self._pid, (self._process,) = report, processes
        else:
            self._lost = True

    def _report(self) -> tuple[Any, list[int]]:
        """Return the next report of the fork server, and the descriptors that came with it.

        Returns None and no descriptors if there are no more reports.
        """
        data, descriptors, *_ = socket.recv_fds(self._reports, _REPORT, 1)
        return (pickle.loads(data) if data else None), descriptors

    def _encode(self, request: Request) -> tuple[float, bytes]:
        """Return the deadline of a request that is sent now [s], and the message to send.

        Raises:
            BadQuery: The request cannot be pickled.
        """
        until = _end(request)
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
        left = min(_EXIT, until - time.monotonic())
        if not is_readable(self._reports, max(left, 0.0)):
            self.kill()
            return WorkerDied("it closed its socket")
        code, _ = self._report()
        self.kill()
        return WorkerDied("it ended" if code is None else ending(code, self._output))


def _has_ended(process: int, timeout: float = 0.0) -> bool:
    """Return True if a process, given by its descriptor, ends within a timeout [s]."""
    poll = select.poll()
    poll.register(process, select.POLLIN)
    return bool(poll.poll(1e3 * timeout))


def _kill(process: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        signal.pidfd_send_signal(process, signal.SIGKILL)


def _is_small(request: Request) -> bool:
    """Return True if a request is small enough to be encoded without delaying other threads."""
    return isinstance(request, Query) and len(request.via) + len(request.world.bodies) < _FEW


def _unread() -> BadWorld:
    why = f"The meshes of the world were not read within {_READ:g} s"
    return BadWorld(f"{why}; run again, or give meshes with fewer triangles")


def _end(request: Request) -> float:
    """Return the latest time of the answer to a request that begins now [s]."""
    return time.monotonic() + max(request.timeout, 0.0) + _GRACE


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
