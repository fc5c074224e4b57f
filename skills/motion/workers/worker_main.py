"""The program of a worker process: `python -P -m skills.motion.workers.worker_main FD`.

FD is the file descriptor of the socket to the parent process. The worker receives a Robot and a
World, and answers None when it has loaded them. Then it answers requests, one after the other,
until the parent closes the socket. A request and its answer have the same number. A MotionError is
an answer, too. If the robot is unusable, a MotionError is the first and only answer. Any other
error ends the process, and so does too much memory. The parent then starts a new process.
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
    """Answer requests until the parent process closes the socket.

    Args:
        descriptor: File descriptor of the socket.
    """
    limit_memory()
    if os.nice(0) < 0:  # the process that moves the arm has priority
        os.setpriority(os.PRIO_PROCESS, 0, 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the parent ends the worker
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
        receive(parent)  # wait until the parent process closes the socket
        return
    with suppress(MotionError):  # the first request in this world reports the error
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
