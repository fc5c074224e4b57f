"""The process of a virtual board.

The process serves a pseudo-terminal that it inherits. Every line on the standard input is the name
of a method of the board with arguments, pickled in base64. The process answers with the result in
the same form. The process ends when the standard input ends.
"""

import base64
import contextlib
import os
import pickle
import select
import sys
import termios

from hardware.clock import RealClock

from .model import BoardModel

# A wait for a port that is not open returns at once, so the process sleeps between two checks.
_SLEEP = 0.005  # [s]


class _Server:
    """Runs a board in real time. It transfers bytes between the pseudo-terminal and the board."""

    def __init__(self, board: BoardModel, master: int, baud: int) -> None:
        self._board, self._clock = board, RealClock()
        self._speed = getattr(termios, f"B{baud}", 0)  # code of termios; 0 for any speed
        self._master, self._opened = master, False
        os.set_blocking(master, False)

    def run(self) -> None:
        """Serve until the standard input ends."""
        stdin = sys.stdin.fileno()
        while True:
            self._check_port()
            self._write()
            watched = [stdin, self._master] if self._opened else [stdin]
            # Not `poll`: it waits for whole milliseconds, and a bus answers several times in one.
            readable, _, _ = select.select(watched, [], [], self._timeout())
            if stdin in readable and not self._answer():
                return

    def _check_port(self) -> None:
        """Read bytes, and detect whether a client opened or closed the port."""
        hung_up = bool(self._events() & select.POLLHUP)
        if self._opened:
            while self._read() and hung_up:
                pass  # read the rest of a disconnected client; the next one must not get it
        if self._opened is hung_up:
            self._opened = not hung_up
            if self._opened:
                self._board.open(self._clock.now())
                self._read()

    def _events(self) -> int:
        probe = select.poll()
        probe.register(self._master, select.POLLIN)
        return dict(probe.poll(0)).get(self._master, 0)

    def _timeout(self) -> float | None:
        """Return the longest time to wait for bytes [s]; None for no limit."""
        if not self._opened:
            return _SLEEP
        due = self._board.next_output()
        return None if due is None else max(0.0, due - self._clock.now())

    def _read(self) -> bool:
        """Pass bytes to the board. Return False if there are no bytes."""
        try:
            data = os.read(self._master, 4096)
        except OSError:  # no bytes, or the client has disconnected
            return False
        speed = termios.tcgetattr(self._master)[5]
        if self._speed in (0, speed):
            self._board.receive(data, self._clock.now())
        return True

    def _write(self) -> None:
        data = self._board.read_output(self._clock.now())
        if data and self._opened:
            # Without a reader, bytes are lost, as on a line.
            with contextlib.suppress(BlockingIOError):
                os.write(self._master, data)

    def _answer(self) -> bool:
        if not (line := sys.stdin.readline()):
            return False
        method, arguments = pickle.loads(base64.b64decode(line))
        returned = getattr(self._board, method)(self._clock.now(), *arguments)
        sys.stdout.write(base64.b64encode(pickle.dumps(returned)).decode() + "\n")
        sys.stdout.flush()
        return True


def main() -> None:
    """Run a board. Arguments: handle of the pseudo-terminal, model in base64, speed [bit/s]."""
    # Real time, so that the board answers in time on a busy host. With a niceness of -10 instead,
    # Linux delayed its threads that carry the bytes by up to 0.2 s (measured).
    with contextlib.suppress(AttributeError, OSError):  # not on macOS; only for root
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    master, model, baud = sys.argv[1:]
    _Server(pickle.loads(base64.b64decode(model)), int(master), int(baud)).run()


if __name__ == "__main__":
    main()
