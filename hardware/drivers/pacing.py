"""The pacing model: computes when a board can receive the next frame."""

import math

from hardware.link.link import BITS_PER_BYTE

from .firmware_profile import Firmware
from .wire_format import Frame


class PacingModel:
    """Computes the earliest time of the next frame, which no board reports, from the sent frames.

    The next frame may be sent when the board has executed all frames except the last one. The next
    frame then waits in the board's buffer. A hold frame of a stop must also fit into the buffer. If
    it would not fit, the next frame may be sent only when the board has executed all frames.

    Args:
        firmware: Firmware of the board.
        baud: Speed of the line [bit/s].
        frame: Frame that the board holds now.
    """

    def __init__(self, firmware: Firmware, baud: int, frame: Frame) -> None:
        self._firmware = firmware
        self._wire_time = len(frame.data) * BITS_PER_BYTE / baud
        self._servos = frame.servos
        self._one_may_wait = unread_bytes(frame, waiting=2) <= firmware.ring
        self._done = self._done_before = -math.inf

    @property
    def earliest(self) -> float:
        """Earliest time for the next frame [s]."""
        return self._done_before if self._one_may_wait else self._done

    @property
    def done(self) -> float:
        """Time at which the board has executed all frames [s]."""
        return self._done

    def step(self, frame: Frame) -> int:
        """Return the total turn of all servos by a frame, in the unit of the servos."""
        return sum(abs(b - a) for a, b in zip(self._servos, frame.servos, strict=True))

    def note_sent(self, frame: Frame, now: float) -> None:
        """Account for a frame that was sent.

        Args:
            frame: The frame.
            now: Time at which it was sent [s].
        """
        begins = max(now + self._wire_time, self._done)
        self._done_before = self._done
        self._done = begins + self._firmware.service_time(self._servos, frame.servos)
        self._servos = frame.servos


def unread_bytes(frame: Frame, waiting: int) -> int:
    """Return the number of bytes in the board's buffer while the first servo of a frame turns.

    Args:
        frame: Any frame of the robot; all have the same length.
        waiting: Number of whole frames in the buffer after this frame.
    """
    first_field = len(frame.data) // len(frame.servos)
    return len(frame.data) - first_field + waiting * len(frame.data)
