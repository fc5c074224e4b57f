"""The protocol of a board: what it and armtree tell each other beside frames."""

import math

from .measurement import Measurement
from .wire_format import Frame


class BoardProtocol:
    """The protocol of a board, from opening its port to closing it.

    This class itself is the protocol of a board that sends nothing. A driver overrides what its
    board does. A protocol is pure: armtree passes bytes and times [s], one call at a time, and
    sends the bytes that it returns. Any exception is a fault of the arm.

    Attributes:
        boot_frame: Frame of the pose that the board reported when it was ready, or None. The first
            motion starts there.
        acknowledged: Number of frames that the board has received, or None if it does not report
            that.
        measured: Last measurement; None before the first one. Each one is another object. Only the
            protocol of a firmware with `measures` sets it.
        free_at: Earliest time of the next frame [s]. Later than now if the line must stay free for
            an answer; the answer itself may make it free sooner.
        next_poll: Time of the next `poll` [s]; inf if only a frame or received bytes change it.
    """

    boot_frame: Frame | None = None
    acknowledged: int | None = None
    measured: Measurement | None = None
    free_at: float = -math.inf
    next_poll: float = math.inf

    def check_booted(self, port: str, waited: float) -> None:
        """Check that the board has reported what it must report before the arm may move.

        Args:
            port: Name of the port.
            waited: Time since the port was opened [s].

        Raises:
            BoardError: It has not.
        """

    def start_commands(self) -> bytes:
        """Return bytes that are sent once, when the arm becomes active; empty for none."""
        return b""

    def fault_commands(self, torque_off: bool) -> bytes:
        """Return bytes that are sent once after a fault, if the port still works; empty for none.

        Args:
            torque_off: True to let the joints go; False to hold them where they are measured.
        """
        return b""

    def note_sent(self, frame: Frame, now: float) -> None:
        """Account for a frame that is about to be sent."""

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes: any number of them, in any pieces, and maybe damaged.

        Raises:
            BoardError: The board misbehaves.
        """

    def poll(self, now: float) -> bytes:
        """Return a request to send now, or no bytes. Called at `next_poll` or later.

        Raises:
            BoardError: The board did not answer in time.
        """
        return b""
