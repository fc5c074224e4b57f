"""The process of a virtual Arduino.

It prints one line of JSON with the port to open, answers every line on its standard input with its
state, and ends when its standard input does. As with an Uno, opening the port resets the board.
"""

import argparse
import json
import os
import pty
import select
import sys
import tty
from dataclasses import asdict

from .board import Board
from .clock import RealClock
from .firmware import FIRMWARES

# While nobody has the port open a poll returns at once, so the wait for an opener is a short nap.
_NAP_MS = 1


class _Shell:
    """Drives a board in real time: bytes from the pseudo-terminal in, what it says out."""

    def __init__(self, board: Board) -> None:
        self._board, self._clock = board, RealClock()
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        # Only while no slave is open does the master tell that a client came or went.
        os.close(slave)
        os.set_blocking(self._master, False)

    def run(self) -> None:
        """Serve until the standard input ends."""
        self._print({"port": self.port})
        watch = select.poll()
        watch.register(sys.stdin, select.POLLIN)
        opened = False
        while True:
            self._say(opened)
            hung_up = bool(self._events() & select.POLLHUP)
            if opened == hung_up:
                opened = not hung_up
                if opened:
                    self._board.reset(self._clock.now())
            if opened:
                self._listen()
            if opened:
                watch.register(self._master, select.POLLIN)
            events = dict(watch.poll(self._nap(opened)))
            if opened:
                watch.unregister(self._master)
            if sys.stdin.fileno() in events and not self._answer():
                return

    def _events(self) -> int:
        probe = select.poll()
        probe.register(self._master, select.POLLIN)
        return dict(probe.poll(0)).get(self._master, 0)

    def _nap(self, opened: bool) -> float | None:
        if not opened:
            return _NAP_MS
        due = self._board.says_next()
        return None if due is None else max(0.0, (due - self._clock.now()) * 1000)

    def _listen(self) -> None:
        try:
            data = os.read(self._master, 4096)
        except BlockingIOError:
            return
        except OSError:  # the client closed; the next look at the events tells
            return
        self._board.receive(data, self._clock.now())

    def _say(self, opened: bool) -> None:
        data = self._board.says(self._clock.now())
        if data and opened:
            os.write(self._master, data)

    def _answer(self) -> bool:
        if not sys.stdin.readline():
            return False
        self._print(asdict(self._board.state(self._clock.now())))
        return True

    def _print(self, answer: dict[str, object]) -> None:
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


def main() -> None:
    """Run a board; the arguments are those of `VirtualArduino`."""
    parser = argparse.ArgumentParser(description="A virtual Arduino behind a pseudo-terminal.")
    parser.add_argument("letters", help="fields of a frame, such as bseg")
    parser.add_argument("angles", help="boot angles [deg], such as 90,90,90,0")
    parser.add_argument("firmware", choices=FIRMWARES)
    parser.add_argument("baud", type=int)
    given = parser.parse_args()
    angles = [int(angle) for angle in given.angles.split(",")]
    _Shell(Board(given.letters, angles, FIRMWARES[given.firmware], given.baud)).run()


if __name__ == "__main__":
    main()
