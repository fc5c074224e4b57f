"""The virtual Arduino: the board's model in a process of its own, behind a real pseudo-terminal.

Started as a module, it prints one line of JSON with the port to open, answers every line on its
standard input with its state, and ends when its standard input does. As with an Uno, opening the
port resets the board.
"""

import argparse
import json
import os
import pty
import select
import subprocess
import sys
import tty
from dataclasses import asdict
from typing import Any

from .board import Board, BoardState
from .clock import RealClock
from .errors import LinkError
from .firmware import FIRMWARES, Firmware
from .serial_link import SerialLink

# While nobody has the port open a poll returns at once, so the wait for an opener is a short nap.
_NAP_MS = 1


class VirtualArduino:
    """A virtual Arduino process.

    Args:
        letters: The fields of a frame, in order.
        boot_angles: Where a reset puts the servos [deg].
        firmware: What it runs.
        baud: Speed of its line [bit/s].

    Attributes:
        port: The pseudo-terminal to open.

    Raises:
        LinkError: The process did not start.
    """

    def __init__(
        self, letters: str, boot_angles: tuple[int, ...], firmware: Firmware, baud: int
    ) -> None:
        angles = ",".join(map(str, boot_angles))
        command = [sys.executable, "-P", "-m", __name__, letters, angles, firmware.name, str(baud)]
        # A session of its own: Ctrl-C at the terminal is for the one who drives the arm.
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        first = self._answer()
        self.port: str = first["port"]

    def state(self) -> BoardState:
        """What the board is doing now.

        Raises:
            LinkError: The process has ended.
        """
        assert self._process.stdin
        try:
            self._process.stdin.write("state\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise LinkError("virtual", "the virtual Arduino has ended") from None
        answer = self._answer()
        return BoardState(**{**answer, "servos": tuple(answer["servos"])})

    def close(self) -> None:
        """End the process. Harmless when it has ended."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout
        line = self._process.stdout.readline()
        if not line:
            raise LinkError("virtual", "the virtual Arduino has ended")
        answer: dict[str, Any] = json.loads(line)
        return answer


class VirtualLink:
    """A serial link to a virtual Arduino, which it starts when it opens.

    Args:
        letters: The fields of a frame, in order.
        boot_angles: Where a reset puts the servos [deg].
        firmware: What the board runs.
        baud: [bit/s].
    """

    port = "virtual"

    def __init__(
        self, letters: str, boot_angles: tuple[int, ...], firmware: Firmware, baud: int
    ) -> None:
        self._board = (letters, boot_angles, firmware, baud)
        self._baud = baud
        self.arduino: VirtualArduino | None = None
        self._serial: SerialLink | None = None

    def open(self) -> None:
        """Start the board and open its port.

        Raises:
            LinkError: It did not start.
        """
        self.arduino = VirtualArduino(*self._board)
        self._serial = SerialLink(self.arduino.port, self._baud)
        self._serial.open()

    def write(self, data: bytes) -> None:
        """Send bytes; raises as `SerialLink.write`."""
        self._opened().write(data)

    def read(self) -> bytes:
        """Wait for bytes; raises as `SerialLink.read`."""
        return self._serial.read() if self._serial else b""

    def close(self) -> None:
        """Close the port and end the board."""
        if self._serial:
            self._serial.close()
            self._serial = None
        if self.arduino:
            self.arduino.close()
            self.arduino = None

    def _opened(self) -> SerialLink:
        if self._serial is None:
            raise LinkError(self.port, "the virtual Arduino is not open")
        return self._serial


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
