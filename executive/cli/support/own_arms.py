"""Finds the arms of this user on this machine: of servers, and of commands such as `armtree run`.

Each of these commands has a file in the runtime folder, and locks this file. The kernel releases
the lock when the process ends. Therefore the process id in the name of a locked file is valid.
"""

import fcntl
import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TextIO
from urllib.parse import urlsplit

import click

from executive.api import token_file
from executive.cli.settings import find_setting
from hardware.loading.dataclass import dataclass

from .failures import Refusal
from .interrupts import STOP


@dataclass(frozen=True, slots=True)
class OwnRun:
    """A running command that moves an arm without a server.

    Attributes:
        pid: Process id of the command.
        command: Name of the command, such as `armtree run`.
        process: File descriptor of the process. It stays valid if the process id is used again.
    """

    pid: int
    command: str
    process: int

    def stop(self) -> None:
        """Send the command a signal to stop its arm and end."""
        with suppress(ProcessLookupError):  # it has just ended
            signal.pidfd_send_signal(self.process, STOP)

    def wait(self, deadline: float) -> bool:
        """Wait until the process has ended, at most until a monotonic time [s].

        Returns:
            True if the process has ended.
        """
        left = max(deadline - time.monotonic(), 0.0)
        return bool(select.select([self.process], [], [], left)[0])


@contextmanager
def stoppable(report: Callable[[str], None]) -> Iterator[None]:
    """Let `armtree stop` find the current command during this context.

    This context must be inside an `Interrupts` context, which handles the signal of the stop.

    Args:
        report: Callback for a message if `armtree stop` cannot find the command.
    """
    with ExitStack() as stack:
        try:
            path = token_file.make_folder() / f"run-{os.getpid()}.lock"
            new = path.with_suffix(".new")  # renamed when it is locked
            stream = stack.enter_context(new.open("w"))
            stack.callback(new.unlink, missing_ok=True)
            fcntl.lockf(stream, fcntl.LOCK_EX)
            stream.write(click.get_current_context().command_path)
            stream.flush()
            new.rename(path)
            stack.callback(path.unlink, missing_ok=True)
        except OSError as error:
            report(f"`armtree stop` cannot stop this command, only Ctrl-C can: {error}")
        yield


@contextmanager
def own_runs() -> Iterator[list[OwnRun]]:
    """Yield the running commands of this user on this machine that move an arm without a server.

    Raises:
        OSError: The system does not let this process watch a command.
    """
    with ExitStack() as stack:
        try:
            files = sorted(token_file.make_folder().glob("run-[0-9]*.lock"))
        except OSError:
            files = []  # no command could make a file
        yield [run for file in files if (run := _find(file, stack))]


def _find(file: Path, stack: ExitStack) -> OwnRun | None:
    """Return the command of a lock file, or None if the command has ended."""
    pid = file.stem.removeprefix("run-")
    if not pid.isdecimal():
        return None
    try:
        stream = stack.enter_context(file.open())
        if not _locked(stream):  # the command was killed
            file.unlink(missing_ok=True)
            return None
        process = os.pidfd_open(int(pid))
    except (FileNotFoundError, ProcessLookupError):  # it has just ended
        return None
    stack.callback(os.close, process)
    # If the lock is still held, `process` is not a later process with the same id.
    return OwnRun(int(pid), stream.read(), process) if _locked(stream) else None


def _locked(stream: TextIO) -> bool:
    """Return True if a command holds the lock of its file. Shared locks, as here, do not count."""
    try:
        fcntl.lockf(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):  # lockf(3) raises one or the other
        return True
    return False


def running_server() -> str | None:
    """Return the URL of the only running server of this user, or None if none runs.

    If several servers run, return the URL of the server at the TCP port that the user has set.

    Raises:
        Refusal: Several servers run, and none is at that port.
    """
    found = [info.url for info in token_file.running()]
    if len(found) > 1:
        port, place = find_setting(click.get_current_context(), "tcp_port")
        chosen = [url for url in found if place and urlsplit(url).port == port]
        if not chosen:
            raise Refusal(f"several servers run; give --server URL: {', '.join(found)}")
        found = chosen
    return found[0] if found else None


def server_at_port() -> str:
    """Return the URL of a server on this machine at the port of the settings."""
    port, _ = find_setting(click.get_current_context(), "tcp_port")
    return f"http://localhost:{port}"
