"""The virtual Arduino: a board in a process of its own, behind a real pseudo-terminal."""

import json
import os
import pty
import subprocess
import sys
import threading
import tty
from dataclasses import asdict
from typing import Any

from hardware.drivers.firmware import Firmware
from hardware.errors import LinkError, PortLost
from hardware.link.serial_link import SerialLink

from .board import BoardState

_PROGRAM = f"{__package__}.process"


class VirtualArduino:
    """A virtual Arduino process. Its port can be opened at once, while the process still loads.

    Args:
        letters: The fields of a frame, in order.
        boot_angles: Where a reset puts the servos [deg].
        firmware: What it runs.
        baud: Speed of its line [bit/s].

    Attributes:
        port: The pseudo-terminal to open.
        pid: Of the process.
    """

    def __init__(
        self, letters: str, boot_angles: tuple[int, ...], firmware: Firmware, baud: int
    ) -> None:
        master, slave = pty.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        # Only while no slave is open does the master tell that a client came or went.
        os.close(slave)
        runs = {**asdict(firmware), "banner": firmware.banner.decode("latin-1")}
        board = json.dumps([letters, boot_angles, runs, baud])
        # A session of its own: Ctrl-C at the terminal is for the one who drives the arm.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", _PROGRAM, str(master), board],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=[master],
            start_new_session=True,
        )
        os.close(master)
        self.pid = self._process.pid
        self._closing = threading.Lock()

    def state(self) -> BoardState:
        """What the board is doing now.

        Raises:
            LinkError: The process has ended.
        """
        assert self._process.stdin
        assert self._process.stdout
        try:
            self._process.stdin.write("state\n")
            self._process.stdin.flush()
            answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        except (OSError, ValueError):  # a broken or closed pipe, or no answer
            raise LinkError(self.port, "the virtual Arduino has ended") from None
        return BoardState(**{**answer, "servos": tuple(answer["servos"])})

    def close(self) -> None:
        """End the process, as if the cable was pulled. Harmless when it has ended."""
        with self._closing:
            self._process.kill()  # it has nothing to save
            self._process.communicate()


class VirtualLink:
    """A serial link to a virtual Arduino, which it starts when it opens.

    Args:
        letters: The fields of a frame, in order.
        boot_angles: Where a reset puts the servos [deg].
        firmware: What the board runs.
        baud: [bit/s].

    Attributes:
        arduino: The virtual Arduino while the link is open.
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
            LinkError: The port cannot be had.
        """
        self.arduino = VirtualArduino(*self._board)
        link = SerialLink(self.arduino.port, self._baud)
        try:
            link.open()
        except LinkError:
            self.close()
            raise
        self._serial = link

    def write(self, data: bytes) -> None:
        """Send bytes; raises as `SerialLink.write`."""
        link = self._serial
        if link is None:
            raise PortLost(self.port, "The virtual Arduino is not open")
        link.write(data)

    def read(self) -> bytes:
        """Wait for bytes; raises as `SerialLink.read`."""
        link = self._serial
        return link.read() if link else b""

    def close(self, discard: bool = False) -> None:
        """Close the port and end the board; does and raises as `SerialLink.close`."""
        link, self._serial = self._serial, None
        arduino, self.arduino = self.arduino, None
        try:
            if link:
                link.close(discard)
        finally:
            if arduino:
                arduino.close()
