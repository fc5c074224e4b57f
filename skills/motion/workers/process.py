"""One worker process, as the parent holds it."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import NoneType
from typing import Any

from hardware import Robot
from skills.motion.errors import BadQuery, MotionError, PlanTimeout, WorkerDied, shown
from skills.motion.plan import Plan
from skills.motion.query import Carry, Query, Reached, Request, Rest, Result, ToolQuery, Verify
from skills.motion.world import Body, World

from .wire import Garbled, packed, receive, send

_ANSWERS: dict[type, type[Any]] = {
    Query: Plan,
    Rest: Plan,
    ToolQuery: Reached,
    Carry: Body,
    Verify: NoneType,
}
_LONGEST = 86_400.0  # time-out there can be [s]
_GRACE = 0.008  # beyond its time-out, before a worker counts as hanging [s]
_DYING = 0.2  # to say what was wrong, once it has hung up [s]
_FEW = 100  # points and bodies
_START = 30.0  # to load the model on a slow machine [s]

# What a request must hold, so that it is answered and ends no worker.
_FORMS: tuple[tuple[str, type | tuple[type, ...], str], ...] = (
    ("group", str, "the name of a group"),
    ("via", (tuple, list), "a tuple of points"),
    ("point", (tuple, list), "x, y, z"),
    ("world", World, "a World"),
)


class WorkerProcess:
    """A process that plans, started now and waited for by the first `ask`.

    It has a session of its own, so a Ctrl-C on the terminal does not reach it, and it ends by
    itself when its end of the socket closes, that is, when this process ends.
    """

    def __init__(self, robot: Robot) -> None:
        ours, theirs = socket.socketpair()
        self._notes = tempfile.TemporaryFile()  # noqa: SIM115, closed by `close`
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "skills.motion.workers.worker", str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=self._notes,
                stderr=self._notes,
                env=_environment(),
                start_new_session=True,
            )
        self._socket = ours
        self._ready = self._killed = False
        self._unusable: MotionError | None = None  # what it says of the robot
        self._number = 0  # of the last request
        self._begun: tuple[float, bytes] | None = None  # until when, and what is still to be sent
        self._hello(robot)

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it still runs, and nobody has ended it."""
        return not self._killed and self._process.poll() is None

    def ask(self, request: Request) -> Result:
        """Its answer, waited for; errors are answers.

        A worker that died, hung or answered nonsense is no longer alive after it.
        """
        begun, self._begun = self._begun, None
        if wrong := _wrong(request):
            return wrong
        if not self._ready and (broken := self._start()):
            return broken
        try:
            until, message = begun or self._packed(request)
        except BadQuery as error:
            return error
        try:
            if message:
                send(self._socket, message, until)
            number, answer = _pair(receive(self._socket, until))
        except TimeoutError:
            self.kill()
            return PlanTimeout(request.timeout)
        except (EOFError, OSError):
            return self._died(until)
        except Garbled as error:
            return self._nonsense(str(error))
        if number != self._number:
            return self._nonsense(f"request {number} instead of {self._number}")
        if isinstance(answer, (_ANSWERS[type(request)], MotionError)):
            return answer
        return self._nonsense(f"{type(request).__name__} with {type(answer).__name__}")

    def begin(self, request: Request) -> None:
        """Send what will be asked next, if it is small, as far as that needs no waiting."""
        if not self._ready or _wrong(request) or not _is_small(request):
            return
        with contextlib.suppress(BadQuery, OSError):  # who asks is told
            self._begun = until, message = self._packed(request)
            sent = self._socket.send(message, socket.MSG_DONTWAIT)
            self._begun = until, message[sent:]

    def kill(self) -> None:
        """End it now. May be called from any thread, and again."""
        self._killed = True
        self._process.kill()
        with contextlib.suppress(OSError):  # who waits for it need not wait until all is cleared up
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """End it and leave nothing behind."""
        self.kill()
        self._process.wait()
        self._socket.close()
        self._notes.close()

    def _hello(self, robot: Robot) -> None:
        try:
            self._socket.sendall(packed(robot))
        except OSError:
            self.kill()  # told by the first `ask`

    def _start(self) -> MotionError | None:
        """Wait until it has loaded the robot; the error where it cannot."""
        until = time.monotonic() + _START
        try:
            answer = self._unusable or receive(self._socket, until)
        except TimeoutError:
            return self._nonsense(f"nothing within {_START:g} s of its start")
        except (EOFError, OSError):
            return self._died(until)
        except Garbled as error:
            return self._nonsense(str(error))
        if isinstance(answer, MotionError):
            self._unusable = answer
            return answer
        if answer is not None:
            return self._nonsense(f"{type(answer).__name__} when it started")
        self._ready = True
        return None

    def _packed(self, request: Request) -> tuple[float, bytes]:
        """Until when it may take, from now on, and the next request as it is sent.

        Raises:
            BadQuery: It cannot be sent.
        """
        until = time.monotonic() + max(request.timeout, 0.0) + _GRACE
        self._number += 1
        try:
            return until, packed((self._number, request))
        except Exception as error:  # whatever the values in it raise
            what = f"It cannot be sent to a worker ({shown(error)}); give plain numbers"
            raise BadQuery(what) from error

    def _nonsense(self, what: str) -> WorkerDied:
        self.kill()
        return WorkerDied(f"it answered {what}")

    def _died(self, until: float) -> WorkerDied:
        """What it died of, as far as that is known by then."""
        if self._killed:
            return WorkerDied("it was ended")
        try:
            code = self._process.wait(min(_DYING, max(0.0, until - time.monotonic())))
        except subprocess.TimeoutExpired:
            self.kill()
            return WorkerDied("it hung up")
        self.kill()
        how = f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        return WorkerDied(how + self._last_words())

    def _last_words(self) -> str:
        """What it said last, where it said anything."""
        self._notes.seek(0)
        lines = self._notes.read().decode(errors="replace").strip().splitlines()
        return f" ({lines[-1].strip()})" if lines else ""


def _is_small(request: Request) -> bool:
    """Whether it is packed in no time, so that nobody waits for it."""
    return isinstance(request, Query) and len(request.via) + len(request.world.bodies) < _FEW


def _pair(answer: object) -> tuple[int, Any]:
    """The number of a request, and its answer.

    Raises:
        Garbled: It is no pair.
    """
    if isinstance(answer, tuple) and len(answer) == 2 and type(answer[0]) is int:
        return answer
    raise Garbled(f"{type(answer).__name__} without a number")


def _wrong(request: Request) -> BadQuery | None:
    if type(request) not in _ANSWERS:
        return BadQuery(f"{type(request).__name__} is nothing that a planner can be asked")
    for name, kind, form in _FORMS:
        value = getattr(request, name, None)
        if hasattr(request, name) and not isinstance(value, kind):
            return BadQuery(f"The {name} is {shown(value)}; give {form}")
    timeout = request.timeout
    if isinstance(timeout, (int, float)) and abs(timeout) <= _LONGEST:  # not so if it is a NaN
        return None
    return BadQuery(f"The time-out is {shown(timeout)} s; give a number up to {_LONGEST:g}")


def _environment() -> dict[str, str]:
    """Ours, with the folder these rooms are in, and one thread per numeric library."""
    rooms = str(Path(__file__).parents[3])
    paths = [rooms, *filter(None, [os.environ.get("PYTHONPATH")])]
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **single, "PYTHONPATH": os.pathsep.join(paths)}
