"""The worker process: `python -P -m skills.motion.workers.worker_main FD`, FD being its socket.

It receives a Robot and a World, and answers None when it has loaded them. Then it answers requests,
one after the other, until the other end closes. Request and answer have the same number. A
MotionError is an answer; if the robot is unusable, it is the first and only one. Any other error
ends the process, as does using too much memory, and the parent starts a new one.
"""

import os
import signal
import socket
import sys
from contextlib import suppress

from hardware import RealClock
from skills.motion.errors import MotionError
from skills.motion.planner import Planner
from skills.motion.query import Request, Result

from .memory import limit_memory
from .messages import encode, receive, send


def main(descriptor: int) -> None:
    """Serve until the other end closes."""
    limit_memory()
    if os.nice(0) < 0:  # the process that moves the arm comes first
        os.setpriority(os.PRIO_PROCESS, 0, 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides when the worker ends
    with socket.socket(fileno=descriptor) as parent:
        try:
            _serve(parent)
        except (EOFError, ConnectionError):
            return


def _serve(parent: socket.socket) -> None:
    robot, world = receive(parent)
    try:
        planner = Planner(robot, RealClock())
    except MotionError as error:
        send(parent, encode(error))
        receive(parent)  # wait until the other end closes
        return
    with suppress(MotionError):  # a request in this world reports it
        planner.prepare(world)
    send(parent, encode(None))
    while True:
        number, request = receive(parent)
        send(parent, encode((number, _answer(planner, request))))


def _answer(planner: Planner, request: Request) -> Result:
    try:
        return planner.answer(request)
    except MotionError as error:
        return error


if __name__ == "__main__":
    main(int(sys.argv[1]))
