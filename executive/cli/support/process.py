"""This process: its priority, its end, and calls that it does not allow."""

import atexit
import gc
import os
import posix
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from executive.api.codes import INTERRUPTED_EXIT

NICE = -10  # niceness that the process requests
# Longest time that a busy thread runs before the streamer or a stop gets the interpreter [s].
_SWITCH = 0.0005
_ALLOCATIONS = 10_000  # new objects until garbage is collected: 2 ms each time
# File with the niceness of the session, if Linux schedules by sessions.
_GROUP = Path("/proc/self/autogroup")

end_process = os._exit  # ends the process at once, from any thread
replace_process = os.execve  # replaces this process with another program
_OWN = os.getpid()
_END = "would end armtree without a result; raise an exception"
_LEAVE = "would change the folder of armtree's relative paths; use absolute paths instead"
_FORBIDDEN = {"_exit": _END, "execv": _END, "execve": _END, "chdir": _LEAVE, "fchdir": _LEAVE}


@atexit.register  # the command line imports this file first, so Python calls this function last
def _ignore_signals() -> None:
    """Ignore signals: when Python has removed its handlers, a signal would change the status."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def protected_process() -> Iterator[None]:
    """Make functions raise SystemExit instead of ending this process or changing its folder.

    A skill that ends this process leaves its goal without a result, and the exit status can be 0.
    A skill that changes the working folder makes relative paths wrong, such as that of the
    recordings. Forked processes and C code can still do both.
    """
    calls = {name: getattr(os, name) for name in _FORBIDDEN}
    for name, call in calls.items():
        _replace(name, _refusing(name, call, _FORBIDDEN[name]))
    try:
        yield
    finally:
        for name, call in calls.items():
            _replace(name, call)


def _replace(name: str, call: Callable[..., Any]) -> None:
    for module in (os, posix):
        setattr(module, name, call)


def _refusing(name: str, call: Callable[..., Any], why: str) -> Callable[..., Any]:
    def refuse(*words: Any, **more: Any) -> Any:
        if os.getpid() != _OWN:
            return call(*words, **more)
        raise SystemExit(f"os.{name} {why}")

    return refuse


def signal_status(number: int) -> int:
    r"""Return the exit status of a command that a signal ends. Ctrl-\ has the status of Ctrl-C."""
    return INTERRUPTED_EXIT if number == signal.SIGQUIT else 128 + number


def make_punctual() -> None:
    """Make frames and stops of this process punctual on a busy computer.

    The garbage collector then ignores the loaded modules: to collect them would delay the
    streamer by 30 ms. Python switches between threads more often. The process gets a higher
    priority, if the operating system allows it, for example for root. A niceness that the user
    chose remains. Call this function before threads start, because they inherit the priority.
    """
    gc.freeze()
    gc.set_threshold(_ALLOCATIONS)
    sys.setswitchinterval(_SWITCH)
    if os.getpriority(os.PRIO_PROCESS, 0) == 0:
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, NICE)
            if os.getsid(0) == os.getpid():  # otherwise the session also has other programs
                _GROUP.write_text(str(NICE))
