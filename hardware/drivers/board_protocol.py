"""The protocol of a board: messages in both directions, other than frames, and what it measures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from .wire_format import Frame


@dataclass(frozen=True, slots=True)
class Measurement:
    """Measured values, one per actuated joint. What the board does not measure is empty.

    Attributes:
        position: Positions [rad].
        velocity: Velocities [rad/s].
        effort: Parts of the largest torque of the servo, from -1 to 1.
        temperature: Temperatures of the servos [C].
        voltage: Voltages of their supply [V].
    """

    position: tuple[float, ...]
    velocity: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()
    temperature: tuple[float, ...] = ()
    voltage: tuple[float, ...] = ()


class BoardProtocol:
    """The protocol of a board, from opening its port to closing it.

    This class itself is the protocol of a board that sends nothing. A driver overrides what its
    board does. A protocol is pure: armtree passes bytes and times [s], one call at a time, and
    sends the bytes that it returns. Any exception is a fault of the arm.

    Attributes:
        boot_frame: Frame of the pose that the board reported when it was ready, or None. The first
            motion starts there. `torque_commands` sets it again when it switches the torque on.
        acknowledged: Number of frames that the board has received, or None if it does not report
            that.
        measured: Last measurement; None before the first one. Each one is a new object. Only a
            board with `Ability.MEASURE` has any.
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

    def hold_commands(self) -> bytes:
        """Return bytes that hold the joints where they are measured, after a fault."""
        return b""

    def torque_commands(self, on: bool) -> Sequence[bytes]:
        """Return the commands that switch the torque of all servos, for `Ability.TORQUE`.

        They are sent one after another, one in each period of frames, so that torque may rise
        slowly. The servos then hold where they are measured. The arm does this when it becomes
        active; a deactivation does not switch the torque off.

        Args:
            on: False to let the joints go.
        """
        return ()

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
