"""The worker process: `python -P -m skills.motion.worker FD`, FD being its end of a socket.

It is sent a pickled Robot, answers None when it has loaded it, and then answers every request that
it is sent, in turn, until the other end closes. Errors of ours are answers, that there is no
planning with this Robot to every request; any other ends the process, and the parent starts a new
one. So does taking too much memory.
"""

import resource
import signal
import socket
import sys
from typing import Any

from hardware import RealClock

from .errors import MotionError
from .planner import Planner
from .wire import packed, receive

_MEMORY = 4 * 2**30  # of address space; a worker needs a tenth of it [bytes]


def main(descriptor: int) -> None:
    """Serve until the other end closes."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # when to end is for the parent to say
    with socket.socket(fileno=descriptor) as parent:
        try:
            _serve(parent)
        except (EOFError, ConnectionError):
            return


def _serve(parent: socket.socket) -> None:
    robot = receive(parent)
    try:
        planner = Planner(robot, RealClock())
    except MotionError as error:
        parent.sendall(packed(error))
        while True:
            receive(parent)
            parent.sendall(packed(error))
    parent.sendall(packed(None))
    while True:
        parent.sendall(packed(_answered(planner, receive(parent))))


def _answered(planner: Planner, request: Any) -> Any:
    try:
        return planner.answer(request)
    except MotionError as error:
        return error


if __name__ == "__main__":
    main(int(sys.argv[1]))
