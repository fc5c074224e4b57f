"""What a finished recording, and the time its goal took, amount to."""

from dataclasses import dataclass
from pathlib import Path

_AT_ONCE = 0.1  # a turn that comes sooner was not waited for [s]


def waited(turn: float, end: float, duration: float) -> float:
    """How long a goal waited for its turn [s]; 0 where that came at once.

    Args:
        turn: When it came, as the goal is recorded [s].
        end: When the goal ended, as the result is recorded [s].
        duration: From its acceptance to its end [s].
    """
    before = duration - (end - turn)
    return before if before > _AT_ONCE else 0.0


@dataclass(frozen=True, slots=True)
class Summary:
    """A finished recording.

    Attributes:
        path: The file.
        messages: How many messages it holds.
        bytes: Its size [bytes]; 0 where nothing had been recorded and the file was removed.
        whole: Whether what it was made of had its end and no damage.
        torn: How much at the end of that could not be kept [bytes].
        damaged: Where that is kept as it was; None where all of it could be kept.
    """

    path: Path
    messages: int
    bytes: int
    whole: bool
    torn: int
    damaged: Path | None = None

    def in_words(self) -> str:
        """What was recovered, for people."""
        if not self.bytes:
            return f"{self.path}: was removed, for it was empty: its run had not begun"
        if self.whole:
            return f"{self.path}: {self.messages} messages, nothing was lost"
        end = "the end of the run is missing"
        if self.damaged:
            end = f"the whole file is kept, as it was, as {self.damaged.name}"
        return (
            f"{self.path}: recovered {self.messages} messages; {self.torn} bytes behind them are "
            f"torn or damaged; {end}"
        )
