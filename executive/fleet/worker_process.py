"""The worker of `armtree serve --fleet`: its own process, and a client of the server."""

import logging
import os
import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from hardware import Clock, RealClock
from hardware.loading.dataclass import dataclass

from .errors import BadName, FleetError, check_name, without_login

logger = logging.getLogger(__name__)

_END_SECONDS = 5.0  # longest time for the last result
_FIRST_DELAY, _LONGEST_DELAY = 1.0, 60.0  # time before a new start [s]
_REFUSED = FleetError.exit_status, BadName.exit_status  # statuses after which no start succeeds


@dataclass(frozen=True, slots=True)
class FleetPlace:
    """The place of an arm in a fleet.

    Attributes:
        url: URL of the fleet.
        pool: Name of the pool.
        name: Name of the arm in the pool.

    Raises:
        BadName: A name is malformed.
    """

    url: str
    pool: str
    name: str

    def __post_init__(self) -> None:
        check_name("a pool", self.pool)
        check_name("an arm", self.name)


def machine_name() -> str:
    """Return the name of this machine in the form of an arm's name."""
    return re.sub(r"[^\w-]", "-", socket.gethostname(), flags=re.ASCII)[:32]


@contextmanager
def worker_of(place: FleetPlace, server: str, token: str, page: str) -> Iterator[None]:
    """Run the worker of a server during the context. It also ends if this process dies.

    This process never waits for the fleet.

    Args:
        place: Place of the arm in the fleet.
        server: URL of the server.
        token: Token of the server.
        page: URL of the page of the server, for other machines.
    """
    words = ["--server", server, "--pool", place.pool, "--name", place.name, "--page", page]
    command = ["fleet", "join", *words]
    by_hand = ["armtree", *command, "--fleet", without_login(place.url)]

    def start() -> "subprocess.Popen[bytes]":
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "armtree", *command, "--child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            # Every user of this machine can read the words of a command.
            env={**os.environ, "ARMTREE_TOKEN": token, "ARMTREE_FLEET": place.url},
            start_new_session=True,  # Ctrl-C is for this process, which then ends the worker
        )

    clock = RealClock()
    running = RunningWorker(start, shlex.join(by_hand), clock)
    clock.spawn(running.keep, "fleet worker")
    try:
        yield
    finally:
        running.end()


class RunningWorker:
    """A worker that starts again when it dies, or when it cannot be started.

    Args:
        start: Callback that starts its process, with a pipe to its standard input.
        command: The command of a person that starts it.
        clock: Time source.
    """

    def __init__(
        self, start: Callable[[], "subprocess.Popen[bytes]"], command: str, clock: Clock
    ) -> None:
        self._start, self._command, self._clock = start, command, clock
        self._signal, self._ended = clock.signal(), False
        self._process: subprocess.Popen[bytes] | None = None

    def keep(self) -> None:
        """Keep the worker running until `end`, or until the fleet refuses it.

        The delay before each new start grows.
        """
        delay = _FIRST_DELAY
        while True:
            begun, status = self._clock.now(), None
            try:
                status = self._run()
                why = f"ended with status {status}"
            except OSError as error:  # such as too many processes
                why = f"cannot be started ({error})"
            with self._signal:
                if self._ended:
                    return
                if status in _REFUSED:
                    words = "the worker %s, so this arm takes no more jobs. The server still runs. "
                    logger.error(f"FLEET: {words}To start a worker, type: %s", why, self._command)
                    return
                if self._clock.now() - begun > _LONGEST_DELAY:
                    delay = _FIRST_DELAY
                logger.warning("FLEET: the worker %s; it starts again in %g s", why, delay)
                end = self._clock.now() + delay
                while not self._ended and self._clock.now() < end:
                    self._signal.wait(end)
            delay = min(2 * delay, _LONGEST_DELAY)

    def _run(self) -> int | None:
        """Run the worker once. Return its exit status, or None if `end` was called before.

        Raises:
            OSError: The process cannot be started.
        """
        with self._signal:
            if self._ended:
                return None
            if self._process and self._process.stdin:
                self._process.stdin.close()
            self._process = None
            self._process = process = self._start()
        return process.wait()

    def end(self) -> None:
        """Ask the worker to end and leave the fleet. Otherwise a stop reports it as missing."""
        with self._signal:
            self._ended = True
            self._signal.notify()
        process = self._process
        if process is None:
            return
        assert process.stdin
        with suppress(BrokenPipeError):  # it has ended
            process.stdin.write(b".")
            process.stdin.flush()
        with suppress(BrokenPipeError):
            process.stdin.close()
        try:
            process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
