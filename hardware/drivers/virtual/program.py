"""The process of a virtual board.

It serves a pseudo-terminal that it inherits. It answers every line on its standard input with its
state, pickled in one line of base64, and ends when its standard input ends.
"""

import base64
import contextlib
import os
import pickle
import select
import sys

from hardware.clock import RealClock

from .model import BoardModel

# While the port is not open a poll on it returns at once, so the process sleeps between polls.
_SLEEP_MS = 5


class _Server:
    """Runs a board in real time: transfers bytes between the pseudo-terminal and the board."""

    def __init__(self, board: BoardModel, master: int) -> None:
        self._board, self._clock = board, RealClock()
        self._master, self._opened = master, False
        os.set_blocking(master, False)

    def run(self) -> None:
        """Serve until the standard input ends."""
        watch = select.poll()
        watch.register(sys.stdin, select.POLLIN)
        while True:
            self._check_port()
            self._write()
            if self._opened:
                watch.register(self._master, select.POLLIN)
            events = dict(watch.poll(self._poll_timeout()))
            if self._opened:
                watch.unregister(self._master)
            if sys.stdin.fileno() in events and not self._answer():
                return

    def _check_port(self) -> None:
        """Read bytes, and detect whether a client opened or closed the port."""
        hung_up = bool(self._events() & select.POLLHUP)
        if self._opened:
            while self._read() and hung_up:
                pass  # the rest from a client that has gone must not reach the next one
        if self._opened is hung_up:
            self._opened = not hung_up
            if self._opened:
                self._board.open(self._clock.now())
                self._read()

    def _events(self) -> int:
        probe = select.poll()
        probe.register(self._master, select.POLLIN)
        return dict(probe.poll(0)).get(self._master, 0)

    def _poll_timeout(self) -> float | None:
        """Return the longest time that a poll may wait [ms], or None for no limit."""
        if not self._opened:
            return _SLEEP_MS
        due = self._board.next_output()
        return None if due is None else max(0.0, (due - self._clock.now()) * 1000)

    def _read(self) -> bool:
        """Pass bytes to the board. Return False if there are none."""
        try:
            data = os.read(self._master, 4096)
        except OSError:  # no bytes, or the client has gone
            return False
        self._board.receive(data, self._clock.now())
        return True

    def _write(self) -> None:
        data = self._board.read_output(self._clock.now())
        if data and self._opened:
            with contextlib.suppress(BlockingIOError):  # lost without a reader, as on a line
                os.write(self._master, data)

    def _answer(self) -> bool:
        if not sys.stdin.readline():
            return False
        state = pickle.dumps(self._board.state(self._clock.now()))
        sys.stdout.write(base64.b64encode(state).decode() + "\n")
        sys.stdout.flush()
        return True


def main() -> None:
    """Run a board. The arguments are its pseudo-terminal, and its model in base64."""
    master, model = sys.argv[1:]
    _Server(pickle.loads(base64.b64decode(model)), int(master)).run()


if __name__ == "__main__":
    main()
