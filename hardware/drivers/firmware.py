"""What runs on the board, as far as the host must know it.

Figures for `stock` are those of the published sketch: it turns one servo after the other in steps
of one degree, waits about 5 ms after each (the first, of zero degrees, included), reads nothing
meanwhile, and its serial ring holds 63 bytes. `armtree` stores a frame and lets timers move the
servos, so a frame costs it no more than its time on the wire.
"""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Firmware:
    """The profile of a firmware.

    Attributes:
        name: As written in a robot file.
        rate: Grid on which motions are sampled into frames [Hz].
        degree_time: Time that one degree of one servo blocks the board [s]; 0 if it never blocks.
        max_step: Largest change that one frame may ask for, summed over the servos [deg].
        ring: Unread bytes the board can hold.
        boot_time: From reset until it reads its line [s].
        banner: How the line begins that it says when it has booted; the line ends with the frame
            it holds, which a reset leaves alone. Who has one also acknowledges frames, as
            `firmware/README.md` says. Empty for a board that says nothing of the kind.
        turn_time: Time that one servo's turn blocks the board beside its degrees [s].
        letters: Of its frames' fields, in order; empty for a sketch that is made for the robot.
        baud: Speed of its line [bit/s]; 0 for a sketch that may have any.
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
        """What the arm does when the board is reset, as when its port is opened."""
        return "stays where it is" if self.banner else "moves to its boot pose"

    def service_time(self, before: Sequence[int], after: Sequence[int]) -> float:
        """How long the board is deaf after a frame [s].

        Args:
            before: Servo angles the board holds [deg].
            after: Servo angles the frame asks for [deg].
        """
        steps = [abs(b - a) + 1 for a, b in zip(before, after, strict=True)]
        return self.degree_time * sum(steps) + self.turn_time * len(steps)
