"""The virtual Arduino: a board in a process of its own, behind a real pseudo-terminal."""

import json
import subprocess
import sys
from typing import Any

from .board import BoardState
from .errors import LinkError
from .firmware import Firmware
from .serial_link import SerialLink

_PROGRAM = f"{__package__}.board_process"


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
        command = [sys.executable, "-P", "-m", _PROGRAM, letters, angles, firmware.name, str(baud)]
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
