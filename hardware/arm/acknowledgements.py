"""What the board says, held against what it was sent. The protocol is in `firmware/README.md`."""

import binascii
import re
import threading
from collections import deque

from hardware.description.robot import Robot
from hardware.drivers.driver import Frame
from hardware.errors import BoardReset, FrameLost, WrongFirmware

# A line of ours is shorter; what never ends a line is none [bytes].
_LONGEST = 200
_ACK = re.compile(rb"k([0-9a-f]{4}),([0-9a-f]{2}),([0-9a-f]{2}),([0-9a-f]{4})")
# An answer takes 2 ms on the line, and an adapter keeps it for up to 16 ms more.
ANSWER = 0.25  # [s]
# It is counted in looks. A stall of the host, in which nobody reads, is one look and no more.
_LOOKS = 5
_LOOK = ANSWER / _LOOKS  # [s]
_WRAP = 0x10000  # the board counts frames in 16 bits


class Acknowledgements:
    """What is known of a board since its port was opened. Threads may share it.

    Args:
        robot: Whose board. One whose firmware has no banner says nothing that is understood here,
            unless it is another's banner.

    Attributes:
        holds: What the board said, when it had booted, that it holds; None until then.
        sent: Frames that went out.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._banner = robot, robot.firmware.banner
        self._lock = threading.RLock()  # a signal's handler may stop the arm
        self._unfinished = b""
        self._taken = self._sum = 0
        self._waiting = deque[int]()  # of each frame that it has not acknowledged, its sum after it
        self._look, self._silent = 0.0, 0  # when to look next [s]; looks that found nothing new
        self.holds: Frame | None = None
        self.sent = 0

    @property
    def taken(self) -> int:
        """Frames that the board has; all that were sent where it tells nothing."""
        return self._taken if self._banner else self.sent

    @property
    def greeting(self) -> bytes:
        """What to send a board that has booted, so that it acknowledges frames."""
        return self.holds.data[:1] + b"A01;" if self.holds else b""

    def sends(self, frame: Frame, now: float) -> None:
        """Note a frame that is about to go out at a time [s]."""
        with self._lock:
            self.sent += 1
            if self._banner:
                if not self._waiting:
                    self._look, self._silent = now + _LOOK, 0
                self._sum = binascii.crc_hqx(bytes(frame.servos), self._sum)
                self._waiting.append(self._sum)

    def hear(self, data: bytes) -> None:
        """Take what the board said; what is damaged on its way is passed over.

        Raises:
            BoardReset: It has started anew, so it holds what nobody commanded.
            FrameLost: It took other frames than were sent.
            WrongFirmware: It runs another firmware than the robot file names.
        """
        *lines, rest = (self._unfinished + data).split(b"\n")
        self._unfinished = rest[-_LONGEST:]
        for line in lines:
            if self._banner and self._banner in line:  # a reset may have cut the line before short
                self._start(line)
            elif self._banner and (match := _ACK.fullmatch(line)):
                self._acknowledge(*(int(digits, 16) for digits in match.groups()))
            else:
                self._refuse(line)

    @property
    def due(self) -> float | None:
        """When to look whether the board has answered [s]; None where nothing waits for that."""
        with self._lock:
            return self._look if self._waiting else None

    def check(self, now: float) -> None:
        """Look, if it is time to, whether the board has answered.

        Args:
            now: The time [s].

        Raises:
            FrameLost: It leaves a frame without an answer.
        """
        with self._lock:
            if not self._waiting or now < self._look:
                return
            self._look, self._silent = now + _LOOK, self._silent + 1
            if self._silent < _LOOKS:
                return
        taken = f"the board acknowledged {self._taken} of {self.sent} frames"
        raise FrameLost(f"{taken}, and then nothing for {ANSWER:g} s")

    def settled(self) -> bool:
        """Whether the board has all that was sent."""
        return self.taken == self.sent

    def _refuse(self, line: bytes) -> None:
        """Refuse the banner of another firmware; pass over all else."""
        for other in self._robot.driver.firmwares.values():
            if other.banner and other.banner in line:
                raise WrongFirmware(other.name, self._robot.firmware.name, self._robot.path)

    def _start(self, line: bytes) -> None:
        if self.holds:
            raise BoardReset(line.decode(errors="replace"))
        try:
            self.holds = self._robot.wire_format.parse(line.split()[-1])
        except ValueError:
            return  # damaged; whoever waits for it gives up in time

    def _acknowledge(self, count: int, refused: int, lost: int, total: int) -> None:
        with self._lock:
            new = (count - self._taken) % _WRAP
            known = min(new, len(self._waiting))
            expected = [self._waiting.popleft() for _ in range(known)]
            self._taken += new
            if new:
                self._silent = -1  # the next look may come too soon to count
            if new and (known < new or expected[-1] != total):
                counts = f"it refused {refused} bytes and lost {lost}"
                raise FrameLost(f"the board took other frames than were sent; {counts}")
