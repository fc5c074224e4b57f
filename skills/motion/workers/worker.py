"""The worker process: `python -P -m skills.motion.workers.worker FD`, FD being its end of a socket.

It is sent a Robot, answers None when it has loaded it, and then answers every request that it is
sent, in turn, until the other end closes; both come with the number of the request. A MotionError
is an answer; where the Robot cannot be planned with, it is the first and the last. Any other error
ends the process, as too much memory does, and the parent starts a new one.
"""

import resource
import signal
import socket
import sys
from typing import Any

from hardware import RealClock
from skills.motion.errors import MotionError
from skills.motion.planner import Planner
from skills.motion.timing import toppra_timing as toppra_timing  # load it before the first goal

from .wire import packed, receive, send

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
        send(parent, packed(error))
        receive(parent)  # nothing; it is there until the other end closes
        return
    send(parent, packed(None))
    while True:
        number, request = receive(parent)
        send(parent, packed((number, _answered(planner, request))))


def _answered(planner: Planner, request: Any) -> Any:
    try:
        return planner.answer(request)
    except MotionError as error:
        return error


if __name__ == "__main__":
    main(int(sys.argv[1]))
