"""The sweep of joints by hand: the range of each servo, and the check for its seam."""

from dataclasses import dataclass


@dataclass(slots=True)
class Swept:
    """The swept range of one servo. Positions count on past the seam: 4095, 4096, 4097.

    Attributes:
        turn: Number of positions in a turn [ticks].
        now: Present position [ticks].
        least: Smallest position so far [ticks].
        most: Largest position so far [ticks].
    """

    turn: int
    now: int
    least: int
    most: int

    def move(self, position: int) -> None:
        """Store a position [ticks]. It must be less than half a turn from the previous one."""
        half = self.turn // 2
        self.now += (position - self.now + half) % self.turn - half
        self.least, self.most = min(self.least, self.now), max(self.most, self.now)

    @property
    def range(self) -> int:
        """Largest position minus smallest position [ticks]."""
        return self.most - self.least

    @property
    def whole_turn(self) -> bool:
        """True if the servo was turned by a whole turn or more."""
        return self.range >= self.turn

    @property
    def seam_inside(self) -> bool:
        """True if the servo passed the seam, where its position jumps to 0."""
        return self.least // self.turn != self.most // self.turn

    def kept(self, homing: int | None, centre: bool) -> dict[str, int]:
        """Return the values to store in the servo for this range, by their names in `ServoReport`.

        Args:
            homing: Stored offset [ticks]; None if the servo has none.
            centre: True to change the offset, so that the seam is opposite to the middle of the
                range.
        """
        # Start of the turn that contains the start of the range.
        begin = self.least - self.least % self.turn
        if homing is None:
            return {"least": self.least - begin, "most": self.most - begin}
        shift = (self.least + self.most) // 2 - self.turn // 2 if centre else begin
        half = self.turn // 2
        # Offsets that differ by a whole turn are equal. The memory holds at most half a turn.
        offset = (homing + shift - begin + half) % self.turn - half if centre else homing
        return {
            "homing": max(offset, 1 - half),
            "least": self.least - shift,
            "most": self.most - shift,
        }
