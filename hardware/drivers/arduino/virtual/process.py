"""The process of a virtual Arduino.

It serves a pseudo-terminal that it inherits, answers every line on its standard input with a line
of JSON that tells its state, and ends when its standard input does. As with an Uno, opening the
port resets the board.
"""

import contextlib
import json
import os
import select
import sys
from dataclasses import asdict

from hardware.clock import RealClock
from hardware.drivers.firmware import Firmware

from .board import Board

# While nobody has the port open a poll on it returns at once, so the wait for an opener is naps.
_NAP_MS = 5


class _Shell:
    """Drives a board in real time: bytes from the pseudo-terminal in, what it says out."""

    def __init__(self, board: Board, master: int) -> None:
        self._board, self._clock = board, RealClock()
        self._master, self._opened = master, False
        os.set_blocking(master, False)

    def run(self) -> None:
        """Serve until the standard input ends."""
        watch = select.poll()
        watch.register(sys.stdin, select.POLLIN)
        while True:
            self._look()
            self._say()
            if self._opened:
                watch.register(self._master, select.POLLIN)
            events = dict(watch.poll(self._nap()))
            if self._opened:
                watch.unregister(self._master)
            if sys.stdin.fileno() in events and not self._answer():
                return

    def _look(self) -> None:
        """See what came, and whether a client came or went."""
        hung_up = bool(self._events() & select.POLLHUP)
        if self._opened:
            while self._listen() and hung_up:
                pass  # what is left of the client that went is not for the next one
        if self._opened is hung_up:
            self._opened = not hung_up
            if self._opened:
                self._board.reset(self._clock.now())
                self._board.says(self._clock.now())  # what came before nobody heard
                self._listen()

    def _events(self) -> int:
        probe = select.poll()
        probe.register(self._master, select.POLLIN)
        return dict(probe.poll(0)).get(self._master, 0)

    def _nap(self) -> float | None:
        """How long nothing can happen but what a poll tells [ms]."""
        if not self._opened:
            return _NAP_MS
        due = self._board.says_next()
        return None if due is None else max(0.0, (due - self._clock.now()) * 1000)

    def _listen(self) -> bool:
        """Take what came; false when nothing did."""
        try:
            data = os.read(self._master, 4096)
        except OSError:  # nothing there, or the client has gone
            return False
        self._board.receive(data, self._clock.now())
        return True

    def _say(self) -> None:
        data = self._board.says(self._clock.now())
        if data and self._opened:
            with contextlib.suppress(BlockingIOError):  # nobody reads: it is lost, as on a wire
                os.write(self._master, data)

    def _answer(self) -> bool:
        if not sys.stdin.readline():
            return False
        state = asdict(self._board.state(self._clock.now()))
        sys.stdout.write(json.dumps(state) + "\n")
        sys.stdout.flush()
        return True


def main() -> None:
    """Run a board; the arguments are those of `VirtualArduino` as JSON."""
    master, board = sys.argv[1:]
    letters, angles, firmware, baud = json.loads(board)
    firmware["banner"] = firmware["banner"].encode("latin-1")
    _Shell(Board(letters, angles, Firmware(**firmware), baud), int(master)).run()


if __name__ == "__main__":
    main()
