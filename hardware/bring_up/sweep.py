"""The sweep of joints by hand: how far each servo was turned, and whether over its seam."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(slots=True)
class Swept:
    """How far one servo was turned. Positions count over the seam: 4100 is 4 after a turn.

    Attributes:
        turn: Number of positions of a turn [ticks].
        now: Where it is [ticks].
        least: Smallest position so far [ticks].
        most: Largest position so far [ticks].
    """

    turn: int
    now: int
    least: int
    most: int

    def move(self, position: int) -> None:
        """Note where it is now [ticks], less than half a turn from where it was."""
        half = self.turn // 2
        self.now += (position - self.now + half) % self.turn - half
        self.least, self.most = min(self.least, self.now), max(self.most, self.now)

    @property
    def range(self) -> int:
        """How far it was turned [ticks]."""
        return self.most - self.least

    @property
    def whole_turn(self) -> bool:
        """Whether it was turned by a whole turn or more."""
        return self.range >= self.turn

    @property
    def seam_inside(self) -> bool:
        """Whether it passed the seam, where the position jumps from the last one to 0."""
        return self.least // self.turn != self.most // self.turn

    def kept(self, homing: int | None, centre: bool) -> dict[str, int]:
        """Return the values to store in the servo for this range, by their names in `ServoReport`.

        Args:
            homing: Stored offset [ticks]; None if the servo has none.
            centre: True to change the offset, so that the seam is opposite to the middle of the
                range.
        """
        begin = self.least - self.least % self.turn  # of the turn in which the range begins
        if homing is None:
            return {"least": self.least - begin, "most": self.most - begin}
        shift = (self.least + self.most) // 2 - self.turn // 2 if centre else begin
        half = self.turn // 2
        # A whole turn more or less is the same offset; the memory holds at most half a turn.
        offset = (homing + shift - begin + half) % self.turn - half if centre else homing
        return {
            "homing": max(offset, 1 - half),
            "least": self.least - shift,
            "most": self.most - shift,
        }


class Sweep:
    """The sweep of all servos.

    Args:
        turn: Number of positions of a turn [ticks].
    """

    def __init__(self, turn: int) -> None:
        self._turn = turn
        self.servos = dict[int, Swept]()

    def move(self, positions: Mapping[int, int]) -> None:
        """Note where servos are, by id [ticks]."""
        for servo, position in positions.items():
            if servo in self.servos:
                self.servos[servo].move(position)
            else:
                self.servos[servo] = Swept(self._turn, position, position, position)
