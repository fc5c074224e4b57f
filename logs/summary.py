"""What a finished recording amounts to."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Summary:
    """A finished recording.

    Attributes:
        path: The file.
        messages: How many messages it holds.
        bytes: Its size [bytes].
    """

    path: Path
    messages: int
    bytes: int
