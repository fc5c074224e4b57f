"""The profile of a firmware: what the host must know of the program on a board."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Firmware:
    """The profile of a firmware.

    Attributes:
        name: Name in a robot file.
        rate: Rate at which motions are sampled into frames [Hz].
        degree_time: Time for which one degree of one servo blocks the board [s]; 0 if it does not
            block.
        max_step: Largest change of one frame, total of all servos [deg].
        ring: Size of the receive buffer for unread bytes [bytes].
        boot_time: Time from a reset until the board reads from its line [s].
        banner: First bytes of the line that the board sends after booting. The line ends with the
            frame that the board holds, which a reset does not change. A firmware with a banner also
            acknowledges frames, as `arduino/firmware/README.md` describes. Empty if the board
            sends no such line.
        turn_time: Time for which a servo blocks the board in addition to its degrees [s].
        letters: Letters of its frames' fields, in order; empty if they depend on the robot.
        baud: Speed of its line [bit/s]; 0 if any speed is possible.
    """

    name: str
    rate: float
    degree_time: float
    max_step: int
    ring: int
    boot_time: float
    banner: bytes
    turn_time: float = 0.0
    letters: str = ""
    baud: int = 0

    @property
    def reset_effect(self) -> str:
        """What the arm does when the board is reset, for messages."""
        return "stays where it is" if self.banner else "moves to its boot pose"

    def service_time(self, before: Sequence[int], after: Sequence[int]) -> float:
        """Return for how long a frame blocks the board [s].

        Args:
            before: Servo angles before the frame [deg].
            after: Servo angles of the frame [deg].
        """
        steps = [abs(b - a) + 1 for a, b in zip(before, after, strict=True)]
        return self.degree_time * sum(steps) + self.turn_time * len(steps)
