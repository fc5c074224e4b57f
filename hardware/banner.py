"""What a board says when it has booted: who it is, and where its servos are."""

from .driver import WireFormat
from .frames import Frame
from .profiles import Firmware

# A line of ours is far shorter; what never ends a line is no banner.
_LONGEST = 200  # [bytes]


class Banner:
    """Listens to a board until it has said its boot line, `armtree 1 AVW? kept b090,…,`.

    Args:
        firmware: Whose line begins with its `banner`, and ends with the frame it holds.
        codec: Of the robot's frames.

    Attributes:
        frame: What the board holds; None until it has said so.
    """

    def __init__(self, firmware: Firmware, codec: WireFormat) -> None:
        self._begins, self._codec = firmware.banner, codec
        self._unfinished = b""
        self.frame: Frame | None = None

    def hear(self, data: bytes) -> None:
        """Take what the board said."""
        *lines, rest = (self._unfinished + data).split(b"\n")
        self._unfinished = rest[-_LONGEST:]
        for line in lines:
            if self._begins and line.startswith(self._begins):
                self._read(line)

    def _read(self, line: bytes) -> None:
        try:
            self.frame = self._codec.parse(line.split()[-1])
        except ValueError:
            return  # damaged on its way; whoever waits for it gives up in time
