"""Acknowledgements: compares what the board reports with the frames it was sent.

`drivers/arduino/firmware/README.md` describes the protocol.
"""

import binascii
import re
import threading
from collections import deque

from hardware.description.robot import Robot
from hardware.drivers.driver import Frame
from hardware.errors import BoardReset, FrameLost, WrongFirmware

_LONGEST_LINE = 200  # longer input without a line end is noise [bytes]
_ACKNOWLEDGEMENT = re.compile(rb"k([0-9a-f]{4}),([0-9a-f]{2}),([0-9a-f]{2}),([0-9a-f]{4})")
# An answer takes 2 ms on the line, and a USB adapter may keep it for another 16 ms.
ANSWER_TIMEOUT = 0.25  # [s]
# The timeout is counted in checks, so that a stall of the host, which reads nothing meanwhile,
# counts as one check only.
_CHECKS = 5
_CHECK_PERIOD = ANSWER_TIMEOUT / _CHECKS  # [s]
_COUNTER_RANGE = 0x10000  # the board counts frames in 16 bits


class Acknowledgements:
    """Frames sent and acknowledged since the port was opened. Thread-safe.

    If the firmware has no banner, the board acknowledges nothing. Its bytes are then only searched
    for the banner of another firmware.

    Args:
        robot: The robot.

    Attributes:
        boot_frame: Frame that the board reported to hold after booting, or None before that.
        sent: Number of frames sent.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._banner = robot, robot.firmware.banner
        self._lock = threading.RLock()  # a signal handler may stop the arm
        self._unfinished = b""
        self._acknowledged = self._sum = 0
        self._pending = deque[int]()  # for each unacknowledged frame, the checksum after it
        self._next_check, self._silent = 0.0, 0  # [s]; number of checks without news
        self.boot_frame: Frame | None = None
        self.sent = 0

    @property
    def acknowledged(self) -> int:
        """Number of frames that the board has received; all sent frames if it reports none."""
        return self._acknowledged if self._banner else self.sent

    @property
    def enable_command(self) -> bytes:
        """Command that makes a booted board acknowledge frames; empty if it cannot."""
        return self.boot_frame.data[:1] + b"A01;" if self.boot_frame else b""

    def note_sent(self, frame: Frame, now: float) -> None:
        """Count a frame that is about to be sent.

        Args:
            frame: The frame.
            now: Current time [s].
        """
        with self._lock:
            self.sent += 1
            if self._banner:
                if not self._pending:
                    self._next_check, self._silent = now + _CHECK_PERIOD, 0
                self._sum = binascii.crc_hqx(bytes(frame.servos), self._sum)
                self._pending.append(self._sum)

    def receive(self, data: bytes) -> None:
        """Process bytes from the board. Damaged lines are ignored.

        Raises:
            BoardReset: The board restarted, so it holds a pose that was not commanded.
            FrameLost: The board received other frames than were sent.
            WrongFirmware: The board runs another firmware than the robot file names.
        """
        *lines, rest = (self._unfinished + data).split(b"\n")
        self._unfinished = rest[-_LONGEST_LINE:]
        for line in lines:
            if self._banner and self._banner in line:  # a reset may cut the line before it short
                self._process_banner(line)
            elif self._banner and (match := _ACKNOWLEDGEMENT.fullmatch(line)):
                self._acknowledge(*(int(digits, 16) for digits in match.groups()))
            else:
                self._check_other_banners(line)

    @property
    def next_check(self) -> float | None:
        """Time of the next `check` [s], or None if no frame is unacknowledged."""
        with self._lock:
            return self._next_check if self._pending else None

    def check(self, now: float) -> None:
        """Check that the board still answers. Does nothing before `next_check`.

        Args:
            now: Current time [s].

        Raises:
            FrameLost: The board did not acknowledge a frame in time.
        """
        with self._lock:
            if not self._pending or now < self._next_check:
                return
            self._next_check, self._silent = now + _CHECK_PERIOD, self._silent + 1
            if self._silent < _CHECKS:
                return
        count = f"the board acknowledged {self._acknowledged} of {self.sent} frames"
        raise FrameLost(f"{count}, and then nothing for {ANSWER_TIMEOUT:g} s")

    def all_acknowledged(self) -> bool:
        """Return whether the board has received every frame that was sent."""
        return self.acknowledged == self.sent

    def _check_other_banners(self, line: bytes) -> None:
        for other in self._robot.driver.firmwares.values():
            if other.banner and other.banner in line:
                raise WrongFirmware(other.name, self._robot.firmware.name, self._robot.path)

    def _process_banner(self, line: bytes) -> None:
        if self.boot_frame:
            raise BoardReset(line.decode(errors="replace"))
        try:
            self.boot_frame = self._robot.wire_format.parse(line.split()[-1])
        except ValueError:
            return  # damaged; activation then ends with BoardSilent

    def _acknowledge(self, count: int, refused: int, lost: int, total: int) -> None:
        with self._lock:
            new = (count - self._acknowledged) % _COUNTER_RANGE
            known = min(new, len(self._pending))
            expected = [self._pending.popleft() for _ in range(known)]
            self._acknowledged += new
            if new:
                self._silent = -1  # the next check may come too soon to count
            if new and (known < new or expected[-1] != total):
                counts = f"it refused {refused} bytes and lost {lost}"
                raise FrameLost(f"the board received other frames than were sent; {counts}")
