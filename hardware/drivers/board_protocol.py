"""The protocol of a board: all messages other than frames, and measurements."""

import math
from collections.abc import Sequence

from hardware.loading.dataclass import dataclass

from .wire_format import Frame


@dataclass(frozen=True, slots=True)
class Measurement:
    """Measured values: tuples with one value per actuated joint.

    A tuple is empty if the board does not measure its values.

    Attributes:
        position: Positions [rad].
        velocity: Velocities [rad/s].
        effort: Torques as parts of the largest torque of the servo, from -1 to 1.
        temperature: Temperatures of the servos [C].
        voltage: Supply voltages of the servos [V].
        current: Currents of the servos [A].
        lost: Numbers of lost answers of the servos since the port was opened.
    """

    position: tuple[float, ...]
    velocity: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()
    temperature: tuple[float, ...] = ()
    voltage: tuple[float, ...] = ()
    current: tuple[float, ...] = ()
    lost: tuple[float, ...] = ()


class BoardProtocol:
    """The protocol of a board, from opening its port to closing it.

    This class itself is the protocol of a board that sends nothing. A driver overrides the methods
    that its board needs. A protocol is pure: armtree passes bytes and times [s], one call at a
    time, and sends the returned bytes. Any exception is a fault of the arm.

    Attributes:
        boot_frame: Frame of the pose that the ready board reported, or None. The first motion
            starts in this pose. `torque_commands(True)` sets `boot_frame` again.
        acknowledged: Number of frames that the board has received; None if the board does not
            report it.
        measured: Last measurement; None before the first one. Each measurement is a new object.
            Only a board with `Ability.MEASURE` measures.
        free_at: Earliest time of the next frame [s]. A time after now means that the line must stay
            free for an answer. When the answer comes, this time may become earlier.
        next_poll: Time of the next `poll` [s]; inf if no poll is due before the next frame or
            the next received bytes.
    """

    boot_frame: Frame | None = None
    acknowledged: int | None = None
    measured: Measurement | None = None
    free_at: float = -math.inf
    next_poll: float = math.inf

    def check_booted(self, port: str, waited: float) -> None:
        """Check that the board has sent every report that the arm needs before it moves.

        Args:
            port: Name of the port.
            waited: Time since the port was opened [s].

        Raises:
            BoardError: A required report is missing.
        """

    def start_commands(self) -> bytes:
        """Return the bytes to send once when the arm becomes active. Default: no bytes."""
        return b""

    def hold_commands(self) -> bytes:
        """Return the bytes that hold the measured positions of the joints after a fault."""
        return b""

    def torque_commands(self, on: bool) -> Sequence[bytes]:
        """Return the commands that switch the torque of all servos, for `Ability.TORQUE`.

        The arm sends one command in each period of frames, so that the torque may rise slowly. The
        servos then hold their measured positions. A joint outside its limits, for example on a
        mechanical stop, then moves to its limit, and the first motion starts there. The arm
        switches the torque on when it becomes active. A deactivation does not switch it off.

        If a joint is too far outside its limits, the arm sends nothing. It then calls this method
        again with False, so that the protocol expects no torque.

        Args:
            on: True to hold the joints; False to release them.
        """
        return ()

    def note_sent(self, frame: Frame, now: float) -> None:
        """Note a frame that is about to be sent at this time [s]."""

    def receive(self, data: bytes, now: float) -> None:
        """Process received bytes: any number, in any pieces, possibly damaged.

        Raises:
            BoardError: The bytes show that something is wrong with the board or with a servo.
        """

    def poll(self, now: float) -> bytes:
        """Return a request to send now, or no bytes. Called at `next_poll` or later.

        Raises:
            BoardError: The board did not answer in time.
        """
        return b""
