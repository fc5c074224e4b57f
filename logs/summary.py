"""What a finished recording amounts to."""

from dataclasses import dataclass
from pathlib import Path


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
