"""How fast the board digests frames, as a model: it never says so itself."""

from .board import BITS_PER_BYTE
from .firmware import Firmware
from .frames import Frame


class Pace:
    """Knows from what was sent when the next frame may go.

    A frame may go once the one before the last is done. Then one frame is at most being carried
    out and one waits, and the board's ring has room for the hold frame of a stop at any moment.

    Args:
        firmware: What the board runs.
        baud: Speed of the line [bit/s].
        frame: What the board holds now.
    """

    def __init__(self, firmware: Firmware, baud: int, frame: Frame) -> None:
        self._firmware = firmware
        self._wire_time = len(frame.data) * BITS_PER_BYTE / baud
        self._servos = frame.servos
        self._done = self._done_before = float("-inf")

    @property
    def earliest(self) -> float:
        """When the next frame may go [s]."""
        return self._done_before

    @property
    def done(self) -> float:
        """When the board is done with all it was sent [s]."""
        return self._done

    def step(self, frame: Frame) -> int:
        """How far a frame would turn the servos, summed [deg]."""
        return sum(abs(b - a) for a, b in zip(self._servos, frame.servos, strict=True))

    def sent(self, frame: Frame, now: float) -> None:
        """Note that a frame went out at a time [s]."""
        begins = max(now + self._wire_time, self._done)
        self._done_before = self._done
        self._done = begins + self._firmware.service_time(self._servos, frame.servos)
        self._servos = frame.servos
