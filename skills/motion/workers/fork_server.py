"""Starts the process from which the workers are forked."""

import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from hardware import Robot
from skills.motion.world import EMPTY, Stamp, World, mesh_stamps

from .memory import has_spare_memory
from .messages import InvalidMessage, encode, receive, send

_PROGRAM = "skills.motion.workers.worker_main"
_EXIT = 5.0  # longest wait for the exit status after the process closed its sockets [s]
_SEND = 0.1  # longest time to send a world to a process that waits for it [s]


class ForkServer:
    """A process that has loaded the robot and a world. Worker processes are forked from it.

    To fork takes 4 ms, and 12 ms with a mesh of 400,000 triangles; to load the robot takes 0.3 s,
    and such a mesh 2.6 s (measured). The processes share memory as long as they do not change it.
    Any thread may use the object.

    The process has its own session, so Ctrl-C in the terminal does not reach it. It ends when its
    sockets are closed, at the latest when the parent process ends.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._worlds, worlds = socket.socketpair()
        self._forks, forks = socket.socketpair(type=socket.SOCK_SEQPACKET)
        self._output = tempfile.TemporaryFile()  # noqa: SIM115, closed by `close`
        with worlds, forks:
            descriptors = worlds.fileno(), forks.fileno()
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", _PROGRAM, *map(str, descriptors)],
                pass_fds=descriptors,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=self._output,
                env=_environment(),
                start_new_session=True,
            )
        self._lock = threading.Lock()
        self._world, self._stamps, self._loaded = EMPTY, list[Stamp | None](), False
        self._ending = ""
        with suppress(OSError):  # the first `call` of a worker returns the error
            send(self._worlds, encode(robot))

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """True while the process runs. False if SIGSTOP has stopped it."""
        return self._process.poll() is None and not is_stopped(self.pid)

    def is_loading_other(self, world: World) -> bool:
        """Return True while the process loads a world that differs from the given one."""
        with self._lock:
            return not (self._has_loaded() or self._world in (EMPTY, world))

    def is_loading(self) -> bool:
        """Return True while the process loads a world that is not empty."""
        return self.is_loading_other(EMPTY)

    def load(self, world: World) -> None:
        """Let the process load a world, so that later workers know it. Return at once.

        Does nothing while the process loads another world, or if the computer has little memory.
        """
        with self._lock:
            stamps = mesh_stamps(world)
            known = world == self._world and stamps == self._stamps
            if not known and self._has_loaded() and has_spare_memory():
                self._world, self._stamps, self._loaded = world, stamps, False
                try:
                    send(self._worlds, encode(world), time.monotonic() + _SEND)
                except OSError:  # without the process, a worker loads the world
                    self.kill()

    def fork(self, *descriptors: int) -> None:
        """Ask for a worker; return at once.

        Args:
            descriptors: File descriptors for the worker; see `worker_main`.

        Raises:
            OSError: The process has ended.
        """
        socket.send_fds(self._forks, [b"\0"], descriptors, socket.MSG_DONTWAIT)

    def ending(self) -> str:
        """Wait for the end of a process that closed its sockets. Return how it ended."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_EXIT)
        self.close()
        return self._ending

    def kill(self) -> None:
        """Kill the process, and wait for its end."""
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Kill the process, and free its resources. Further calls do nothing."""
        self.kill()
        with self._lock:
            if not self._output.closed:
                self._ending = ending(self._process.returncode, self._output)
            for each in (self._worlds, self._forks, self._output):
                each.close()

    def _has_loaded(self) -> bool:
        """Return True if the process has loaded the last world. The caller has the lock."""
        is_open = self._worlds.fileno() >= 0
        if not self._loaded and is_open and is_readable(self._worlds):
            with suppress(EOFError, OSError, InvalidMessage):
                self._loaded = receive(self._worlds) is None
        return self._loaded and is_open


def ending(code: int, output: IO[bytes]) -> str:
    """Return how a process ended, with the last line of its output if there is one."""
    names = {each.value: each.name for each in signal.Signals}
    how = f"ended by {names.get(-code, -code)}" if code < 0 else f"ended with code {code}"
    output.seek(0)
    lines = output.read().decode(errors="replace").strip().splitlines()
    return f"{how} ({lines[-1].strip()})" if lines else how


def is_stopped(pid: int) -> bool:
    """Return True if SIGSTOP or a debugger has stopped a process."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:  # it ended meanwhile
        return False
    return stat.rpartition(")")[2].split()[0] in "Tt"


def is_readable(connection: socket.socket, timeout: float = 0.0) -> bool:
    """Return True if a socket has data or is closed within a timeout [s]."""
    poll = select.poll()
    poll.register(connection, select.POLLIN)
    return bool(poll.poll(1e3 * timeout))


def _environment() -> dict[str, str]:
    """Return the environment for the process and its workers.

    It is the environment of this process, with armtree on the Python path and with one thread for
    each numeric library.
    """
    rooms = str(Path(__file__).parents[3])
    paths = [rooms, *filter(None, [os.environ.get("PYTHONPATH")])]
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **single, "PYTHONPATH": os.pathsep.join(paths)}
