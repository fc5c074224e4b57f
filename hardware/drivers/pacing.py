"""How fast the board digests frames, as a model: it never says so itself."""

import math

from hardware.link.link import BITS_PER_BYTE

from .driver import Frame
from .firmware import Firmware


class Pace:
    """Knows from what was sent when the next frame may go.

    A frame may go once the one before the last is done: one is carried out and one waits. Where
    the ring would then have no room for the hold frame of a stop, it may go only once the last is
    done. So a hold fits at any moment.

    Args:
        firmware: What the board runs.
        baud: Speed of the line [bit/s].
        frame: What the board holds now.
    """

    def __init__(self, firmware: Firmware, baud: int, frame: Frame) -> None:
        self._firmware = firmware
        self._wire_time = len(frame.data) * BITS_PER_BYTE / baud
        self._servos = frame.servos
        self._one_may_wait = unread_bytes(frame, waiting=2) <= firmware.ring
        self._done = self._done_before = -math.inf

    @property
    def earliest(self) -> float:
        """When the next frame may go [s]."""
        return self._done_before if self._one_may_wait else self._done

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


def unread_bytes(frame: Frame, waiting: int) -> int:
    """Bytes in the ring while a board turns the first servo of a frame and others wait.

    Args:
        frame: Any frame of the robot; they are all of one length.
        waiting: Whole frames behind it.
    """
    first_field = len(frame.data) // len(frame.servos)
    return len(frame.data) - first_field + waiting * len(frame.data)
