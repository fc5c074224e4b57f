"""The program of the planning processes: `python -P -m skills.motion.workers.worker_main FD FD`.

The process first is a fork server: it loads a robot and worlds, and forks a worker whenever the
parent process asks for one. A worker answers requests, one after the other, until the parent closes
its socket. The two FD are file descriptors of sockets to the parent:

    worlds  The server receives a Robot, and later worlds. It answers None when it has loaded one.
    forks   A byte asks for a worker. Three descriptors come with it: the sockets for the worker's
            requests and for reports about it, and a file for its output. The server reports the
            worker's process id with a descriptor of the process, and later its exit code. If the
            robot is unusable, a MotionError is the only report.

A request and its answer have the same number. If the world has meshes, a message says when they are
read, because the timeout of the request begins then. A MotionError is an answer, too. Any other
error ends the process, and so does too much memory. The parent then starts a new process.
"""

import gc
import os
import pickle
import select
import signal
import socket
import sys
from contextlib import suppress
from functools import partial

from hardware import RealClock
from skills.motion.errors import MotionError
from skills.motion.planner import Planner
from skills.motion.query import Request, Result
from skills.motion.world import EMPTY, World

from .memory import limit_memory
from .messages import MESHES_READ, encode, receive, send


def main(worlds: int, forks: int) -> None:
    """Fork workers until the parent process closes the sockets. In a worker, answer requests.

    Args:
        worlds: File descriptor of the socket for the robot and the worlds.
        forks: File descriptor of the socket on which the parent asks for workers.
    """
    limit_memory()
    if os.nice(0) < 0:  # the process that moves the arm has priority
        os.setpriority(os.PRIO_PROCESS, 0, 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only the parent ends the processes
    with (
        suppress(EOFError, ConnectionError),
        socket.socket(fileno=worlds) as parent,
        socket.socket(fileno=forks) as asked,
    ):
        robot = receive(parent)
        server = _ForkServer(parent, asked)
        try:
            planner = Planner(robot, RealClock())
        except MotionError as error:
            server.refuse(error)
        planner.prepare(EMPTY)
        send(parent, encode(None))
        requests = server.fork(planner)
        with suppress(EOFError, ConnectionError):
            _answer_requests(planner, requests)
        os._exit(0)  # to free the shared memory would copy it


def _load(planner: Planner, world: World) -> None:
    with suppress(MotionError):  # the first request in this world reports the error
        planner.prepare(world)


def _answer_requests(planner: Planner, requests: socket.socket) -> None:
    while True:
        number, request = receive(requests)
        planner.meshes_read = partial(send, requests, encode((number, MESHES_READ)))
        send(requests, encode((number, _answer(planner, request))))


def _answer(planner: Planner, request: Request) -> Result:
    try:
        return planner.answer(request)
    except MotionError as error:
        return error


class _ForkServer:
    """Forks workers when the parent process asks for them, and reports about them.

    Args:
        parent: Socket for worlds.
        asked: Socket on which the parent asks for workers.
    """

    def __init__(self, parent: socket.socket, asked: socket.socket) -> None:
        self._parent, self._asked = parent, asked
        # Process id and socket for reports of each worker, by the descriptor of the process.
        self._workers = dict[int, tuple[int, socket.socket]]()
        self._poll = select.poll()
        for each in (parent, asked):
            self._poll.register(each, select.POLLIN)

    def refuse(self, error: MotionError) -> None:
        """Report an error for each worker that the parent asks for.

        Raises:
            EOFError: Always, when the parent has closed its socket.
        """
        while True:
            requests, reports, output = self._order()
            with requests, reports, suppress(ConnectionError):
                os.close(output)
                reports.send(pickle.dumps(error))

    def fork(self, planner: Planner) -> socket.socket:
        """Fork workers and load worlds. Return in each worker: the socket for its requests.

        Raises:
            EOFError, ConnectionError: The parent has closed its socket.
        """
        while True:
            for ready, _ in self._poll.poll():
                if ready == self._parent.fileno():
                    _load(planner, receive(self._parent))
                    send(self._parent, encode(None))
                elif ready in self._workers:
                    self._report_end(ready)
                elif requests := self._fork():
                    return requests

    def _fork(self) -> socket.socket | None:
        """Fork a worker. Return None; in the worker, return the socket for its requests."""
        requests, reports, output = self._order()
        if _is_closed(requests):  # the parent has canceled meanwhile
            requests.close()
            reports.close()
            os.close(output)
            return None
        gc.freeze()  # a collection in the worker would copy the memory that the processes share
        worker = os.fork()
        if not worker:
            for stream in (sys.stdout, sys.stderr):
                os.dup2(output, stream.fileno())
            others = [report for _, report in self._workers.values()]
            for each in (self._parent, self._asked, reports, *others):
                each.close()
            for descriptor in (output, *self._workers):
                os.close(descriptor)
            return requests
        requests.close()
        os.close(output)
        process = os.pidfd_open(worker)
        self._workers[process] = worker, reports
        self._poll.register(process, select.POLLIN)
        with suppress(ConnectionError):  # the parent needs this worker no more
            socket.send_fds(reports, [pickle.dumps(worker)], [process])
        return None

    def _order(self) -> tuple[socket.socket, socket.socket, int]:
        """Return the sockets for requests and reports, and the output file, of a new worker."""
        data, descriptors, *_ = socket.recv_fds(self._asked, 1, 3)
        if not data:
            raise EOFError
        requests, reports, output = descriptors
        return socket.socket(fileno=requests), socket.socket(fileno=reports), output

    def _report_end(self, process: int) -> None:
        worker, reports = self._workers.pop(process)
        self._poll.unregister(process)
        os.close(process)
        code = os.waitstatus_to_exitcode(os.waitpid(worker, 0)[1])
        with reports, suppress(ConnectionError):
            reports.send(pickle.dumps(code))


def _is_closed(connection: socket.socket) -> bool:
    """Return True if the other process has closed a socket to which it has sent nothing."""
    try:
        connection.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except BlockingIOError:
        return False
    return True


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
