"""Acknowledgements: reports of the board about frames, which are compared with the sent frames.

`firmware/README.md` describes the protocol.
"""

import binascii
import math
import re
from collections import deque
from collections.abc import Iterable
from pathlib import Path

from hardware.drivers.board_protocol import BoardProtocol
from hardware.drivers.wire_format import Frame
from hardware.errors import BoardReset, BoardSilent, FrameLost, WrongFirmware

from .firmware_profile import ArduinoFirmware
from .frames import Codec

_LONGEST_LINE = 200  # longer input without a line end is noise [bytes]
_ACKNOWLEDGEMENT = re.compile(rb"k([0-9a-f]{4}),([0-9a-f]{2}),([0-9a-f]{2}),([0-9a-f]{4})")
# An answer takes 2 ms on the line. A USB adapter may delay it by another 16 ms.
ANSWER_TIMEOUT = 0.25  # [s]
# The timeout is counted in polls. A stall of the host, without any read, counts as one poll.
_POLLS = 5
_POLL_PERIOD = ANSWER_TIMEOUT / _POLLS  # [s]
_COUNTER_RANGE = 0x10000  # the board counts frames in 16 bits


class Acknowledgements(BoardProtocol):
    """Counts frames sent and acknowledged since the port was opened.

    A firmware without a banner acknowledges nothing. Then this class only searches the received
    bytes for the banner of another firmware.

    Args:
        codec: Wire format of the robot.
        firmware: Firmware that the robot file names.
        known: All firmwares. Those with banners are recognised.
        robot_file: The robot file, for messages.
    """

    def __init__(
        self,
        codec: Codec,
        firmware: ArduinoFirmware,
        known: Iterable[ArduinoFirmware],
        robot_file: Path,
    ) -> None:
        self._codec, self._firmware, self._robot_file = codec, firmware, robot_file
        self._known = tuple(known)
        self._banner = firmware.banner
        self.acknowledged = 0 if self._banner else None
        self._unfinished = b""
        self._sent = self._sum = 0
        self._pending = deque[int]()  # the checksum after each unacknowledged frame
        self._silent = 0  # number of polls without a new acknowledgement

    def check_booted(self, port: str, waited: float) -> None:
        """Check that the banner was received."""
        if self._banner and not self.boot_frame:
            what = f"that it runs the firmware {self._firmware.name}"
            advice = "Flash the board, or name its firmware in the robot file"
            resets = "opening the port must reset the board"
            raise BoardSilent(port, waited, what, f"{advice}; {resets}")

    def start_commands(self) -> bytes:
        """Return the command that makes a booted board acknowledge frames."""
        return self.boot_frame.data[:1] + b"A01;" if self.boot_frame else b""

    def note_sent(self, frame: Frame, now: float) -> None:
        """Count a frame before it is sent."""
        if self._banner:
            if not self._pending:
                self.next_poll, self._silent = now + _POLL_PERIOD, 0
            self._sent += 1
            self._sum = binascii.crc_hqx(bytes(frame.servos), self._sum)
            self._pending.append(self._sum)

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the board. Damaged lines are ignored.

        Raises:
            BoardReset: The board restarted, so its servos may have moved.
            FrameLost: The received frames differ from the sent ones.
            WrongFirmware: The robot file names another firmware.
        """
        *lines, rest = (self._unfinished + data).split(b"\n")
        self._unfinished = rest[-_LONGEST_LINE:]
        for line in lines:
            if self._banner and self._banner in line:  # a reset may cut the previous line short
                self._process_banner(line)
            elif self._banner and (match := _ACKNOWLEDGEMENT.fullmatch(line)):
                self._acknowledge(*(int(digits, 16) for digits in match.groups()))
            else:
                self._check_other_banners(line)

    def poll(self, now: float) -> bytes:
        """Check that the board still answers. Returns no bytes.

        Raises:
            FrameLost: The board did not acknowledge a frame in time.
        """
        self.next_poll, self._silent = now + _POLL_PERIOD, self._silent + 1
        if self._silent >= _POLLS:
            count = f"the board acknowledged {self.acknowledged} of {self._sent} frames"
            raise FrameLost(f"{count}, and then nothing for {ANSWER_TIMEOUT:g} s")
        return b""

    def _check_other_banners(self, line: bytes) -> None:
        for other in self._known:
            if other.banner and other.banner in line:
                raise WrongFirmware(other.name, self._firmware.name, self._robot_file)

    def _process_banner(self, line: bytes) -> None:
        if self.boot_frame:
            raise BoardReset(line.decode(errors="replace"))
        try:
            self.boot_frame = self._codec.parse(line.split()[-1])
        except ValueError:
            return  # damaged; activation then ends with BoardSilent

    def _acknowledge(self, count: int, refused: int, lost: int, total: int) -> None:
        assert self.acknowledged is not None
        new = (count - self.acknowledged) % _COUNTER_RANGE
        known = min(new, len(self._pending))
        expected = [self._pending.popleft() for _ in range(known)]
        self.acknowledged += new
        if new:
            self._silent = -1  # so that the next poll, which may come soon, does not count
        if not self._pending:
            self.next_poll = math.inf
        if new and (known < new or expected[-1] != total):
            counts = f"it refused {refused} bytes and lost {lost}"
            raise FrameLost(f"the received frames differ from the sent ones; {counts}")
