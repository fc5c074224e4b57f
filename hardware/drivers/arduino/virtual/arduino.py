"""The virtual Arduino: a virtual board in its own process, behind a pseudo-terminal."""

import json
import os
import pty
import subprocess
import sys
import threading
import tty
from dataclasses import asdict
from typing import Any

from hardware.drivers.arduino.firmware_profile import ArduinoFirmware
from hardware.drivers.firmware_profile import Firmware
from hardware.errors import LinkError, PortLost
from hardware.link.serial_link import SerialLink

from .board import BoardState

_PROGRAM = f"{__package__}.process"


class VirtualArduino:
    """The process of a virtual board. Its port can be opened at once, while the process starts.

    Args:
        letters: Letters of the fields of a frame, in order.
        boot_angles: Servo angles after a reset [deg].
        firmware: Firmware of the board.
        baud: Speed of the line [bit/s].

    Attributes:
        port: Name of the pseudo-terminal.
        pid: Process id.
    """

    def __init__(
        self, letters: str, boot_angles: tuple[int, ...], firmware: Firmware, baud: int
    ) -> None:
        master, slave = pty.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        # The master can detect a client only while no slave is open here.
        os.close(slave)
        assert isinstance(firmware, ArduinoFirmware)
        profile = {**asdict(firmware), "banner": firmware.banner.decode("latin-1")}
        board = json.dumps([letters, boot_angles, profile, baud])
        # In its own session, so that Ctrl-C at the terminal does not reach it.
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
        """Return the state of the board.

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
        """End the process, as if the cable was disconnected. Does nothing if it has ended."""
        with self._closing:
            self._process.kill()  # it has no state to save
            self._process.communicate()


class VirtualLink:
    """A serial link to a virtual Arduino, which is started when the link opens.

    Args:
        letters: Letters of the fields of a frame, in order.
        boot_angles: Servo angles after a reset [deg].
        firmware: Firmware of the board.
        baud: Speed of the line [bit/s].

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
            LinkError: The port cannot be opened.
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
        """Send bytes. Raises what `SerialLink.write` raises."""
        link = self._serial
        if link is None:
            raise PortLost(self.port, "The virtual Arduino is not open")
        link.write(data)

    def read(self) -> bytes:
        """Wait for bytes. Raises what `SerialLink.read` raises."""
        link = self._serial
        return link.read() if link else b""

    def close(self, discard: bool = False) -> None:
        """Close the port as `SerialLink.close` does, and end the process."""
        link, self._serial = self._serial, None
        arduino, self.arduino = self.arduino, None
        try:
            if link:
                link.close(discard)
        finally:
            if arduino:
                arduino.close()
