"""The worker process: `python -P -m skills.motion.worker FD`, FD being its end of a socket.

It is sent a pickled Robot, answers None when it has loaded it, and then answers every request that
it is sent, in turn, until the other end closes. Meanwhile it loads TOPP-RA, and says when it has;
a request that comes before waits for it only if it needs it, or if its time was too short to be
answered beside it. Errors of ours are answers, that there
is no planning with this Robot to every request; any other ends the process, and the parent starts a
new one. So does taking too much memory.
"""

import contextlib
import resource
import signal
import sys
from multiprocessing.connection import Connection
from threading import Lock, Thread
from typing import Any

from hardware import RealClock

from .errors import MotionError, PlanTimeout
from .planner import Planner
from .process import LOADED, receive, send
from .timing import load

_MEMORY = 4 * 2**30  # of address space; a worker needs a tenth of it [bytes]


def main(descriptor: int) -> None:
    """Serve until the other end closes."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # when to end is for the parent to say
    with Connection(descriptor) as connection:
        try:
            _serve(connection)
        except (EOFError, ConnectionError):
            return


def _serve(connection: Connection) -> None:
    robot = receive(connection)
    try:
        planner = Planner(robot, RealClock())
    except MotionError as error:
        send(connection, error)
        while True:
            receive(connection)
            send(connection, error)
    send(connection, None)
    lock = Lock()
    loading = Thread(target=_load, args=(connection, lock), daemon=True)
    loading.start()
    while True:
        answer = answered(planner, receive(connection), loading)
        with lock:
            send(connection, answer)


def _load(connection: Connection, lock: Lock) -> None:
    load()
    with lock, contextlib.suppress(OSError):  # who would be told is gone
        send(connection, LOADED)


def answered(planner: Planner, request: Any, loading: Thread) -> Any:
    """The answer to a request; one that ran out of time beside the loading is asked once more."""
    busy = loading.is_alive()
    try:
        return planner.answer(request)
    except MotionError as error:
        if not (busy and isinstance(error, PlanTimeout)):
            return error
    loading.join()
    return answered(planner, request, loading)


if __name__ == "__main__":
    main(int(sys.argv[1]))
