"""One worker process, as the parent holds it."""

import contextlib
import os
import pickle
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

from hardware import Robot

from .errors import BadQuery, MotionError, PlanTimeout, WorkerDied, shown
from .plan import Plan
from .query import Carry, Query, Reached, Rest, ToolQuery, Verify
from .wire import packed, receive
from .world import Body, World

Request = Query | Verify | ToolQuery | Carry | Rest
Answer = Plan | Reached | Body | None
Result = Answer | MotionError

# What reading a damaged answer raises; anything else is a bug of ours and should be seen.
_NONSENSE = (
    pickle.UnpicklingError,
    ArithmeticError,
    AttributeError,
    ImportError,
    LookupError,
    MemoryError,
    TypeError,
    ValueError,
)
_LONGEST = 86_400.0  # time-out there can be [s]
_AT_ONCE = 32_768  # that a socket takes without waiting, when nothing else is in it [bytes]
_GRACE = 0.008  # beyond its time-out, before a worker counts as hanging [s]
_DYING = 0.2  # to say what was wrong, once it has hung up [s]
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
                [sys.executable, "-P", "-m", "skills.motion.worker", str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=self._notes,
                stderr=self._notes,
                env=_environment(),
                start_new_session=True,
            )
        self._socket = ours
        self._ready = self._killed = self._begun = False
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
        begun, self._begun = self._begun, False
        if wrong := _wrong(request):
            return wrong
        message = b"" if begun else _packed(request)
        if isinstance(message, BadQuery):
            return message
        timeout = max(request.timeout, 0.0) + _GRACE
        try:
            if not self._ready and (broken := self._start()):
                return broken
            if not begun:
                self._socket.settimeout(timeout)
                self._socket.sendall(message)
            answer = receive(self._socket, timeout)
        except TimeoutError:
            self.kill()
            return PlanTimeout(request.timeout)
        except (EOFError, OSError):
            return self._died()
        except _NONSENSE as error:
            return self._nonsense(repr(error))
        if answer is None or isinstance(answer, Plan | Reached | Body | MotionError):
            return answer
        return self._nonsense(f"{type(answer).__name__} instead of a plan")

    def begin(self, request: Request) -> None:
        """Send what will be asked next, where that can be done without waiting."""
        if not self._ready or _wrong(request):
            return
        message = _packed(request)
        if isinstance(message, bytes) and len(message) <= _AT_ONCE:
            with contextlib.suppress(OSError):  # it died; who asks is told
                self._socket.sendall(message)
                self._begun = True

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
        try:
            answer = receive(self._socket, _START)
        except TimeoutError:
            return self._nonsense(f"nothing within {_START:g} s of its start")
        if answer is None or isinstance(answer, MotionError):
            self._ready = True
            return answer
        return self._nonsense(f"{type(answer).__name__} when it started")

    def _nonsense(self, what: str) -> WorkerDied:
        self.kill()
        return WorkerDied(f"it answered {what}")

    def _died(self) -> WorkerDied:
        if self._killed:
            return WorkerDied("it was ended")
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_DYING)
        self.kill()
        code = self._process.wait()
        how = f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        return WorkerDied(how + self._last_words())

    def _last_words(self) -> str:
        """What it said last, where it said anything."""
        self._notes.seek(0)
        lines = self._notes.read().decode(errors="replace").strip().splitlines()
        return f" ({lines[-1].strip()})" if lines else ""


def _packed(request: Request) -> bytes | BadQuery:
    """A request as it is sent."""
    try:
        return packed(request)
    except Exception as error:  # whatever the values in it raise
        return BadQuery(f"It cannot be sent to a worker ({shown(error)}); give plain numbers")


def _wrong(request: Request) -> BadQuery | None:
    if not isinstance(request, Request):
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
    rooms = str(Path(__file__).parents[2])
    paths = [rooms, *filter(None, [os.environ.get("PYTHONPATH")])]
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **single, "PYTHONPATH": os.pathsep.join(paths)}
