"""This process: its priority, and its end."""

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

NICE = -10  # niceness that the process requests
# Longest time that a busy thread keeps the interpreter from the streamer and from a stop [s].
_SWITCH = 0.0005
# File with the niceness of the session, if Linux schedules by sessions.
_GROUP = Path("/proc/self/autogroup")

end_process = os._exit  # ends the process at once, from any thread
replace_process = os.execve  # puts another program in its place
_OWN = os.getpid()
_END = "would end armtree without a result; raise an exception"
_LEAVE = "would take armtree away from its files; give whole paths instead"
_FORBIDDEN = {"_exit": _END, "execv": _END, "execve": _END, "chdir": _LEAVE, "fchdir": _LEAVE}


@atexit.register  # the command line imports this file first, so Python calls this function last
def _ignore_signals() -> None:
    """Ignore signals: Python removes its handlers next, and a signal would change the status."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def protected_process() -> Iterator[None]:
    """Make functions raise SystemExit that end this process, or change its working folder.

    A skill that ends this process leaves its goal without a result, and the exit status can be 0.
    One that changes the folder takes the recording away. Forked processes can still do both, and
    so can C code.
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


def make_punctual() -> None:
    """Make frames and stops of this process punctual on a busy computer.

    The garbage collector then ignores the loaded modules: a collection of them would delay the
    streamer by 30 ms. Python switches between threads more often. The process gets a higher
    priority, if the operating system allows it, for example for root. A niceness that the user
    chose remains. Call this function before threads start, because they inherit the priority.
    """
    gc.freeze()
    sys.setswitchinterval(_SWITCH)
    if os.getpriority(os.PRIO_PROCESS, 0) == 0:
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, NICE)
            if os.getsid(0) == os.getpid():  # otherwise the session also has other programs
                _GROUP.write_text(str(NICE))
