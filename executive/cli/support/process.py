"""This process: its priority, and its end."""

import gc
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

NICE = -10  # niceness that the process requests
# Longest time that a busy thread keeps the interpreter from the streamer and from a stop [s].
_SWITCH = 0.0005
# File with the niceness of the session, if Linux schedules by sessions.
_GROUP = Path("/proc/self/autogroup")

end_process = os._exit  # ends the process at once, from any thread
_OWN = os.getpid()


def forbid_exit() -> None:
    """Make `os._exit` raise SystemExit in this process. Forked processes can still end.

    A skill then cannot end this process. Otherwise its goal would have no result, and the exit
    status would be 0.
    """
    os._exit = _refuse_exit


def _refuse_exit(status: int) -> NoReturn:
    if os.getpid() != _OWN:
        end_process(status)
    raise SystemExit(f"os._exit({status}) would end armtree without a result; raise an exception")


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
