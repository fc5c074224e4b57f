"""The interface to a leader: an arm that a person moves by hand, and that another arm follows."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from .errors import NoLeader


@dataclass(frozen=True, slots=True)
class Blocked:
    """Why the arm does not follow its leader.

    Attributes:
        contact: The two bodies that would come too near, and their distance, in words.
        free: Whether each joint may move from here by itself, by name: to smaller positions, and to
            larger ones.
    """

    contact: str
    free: Mapping[str, tuple[bool, bool]]


class Leader(Protocol):
    """An arm that is moved by hand. No method blocks."""

    def positions(self) -> tuple[float, ...] | None:
        """Return its measured positions, one per actuated joint [rad]; None to end the following.

        Raises:
            HardwareError: It is lost.
        """

    def show(self, blocked: Blocked | None) -> None:
        """Show why the arm does not follow; None if it does."""


class NobodyLeads:
    """No leader."""

    def positions(self) -> tuple[float, ...] | None:
        """Raise the error."""
        raise NoLeader("there is no arm to follow here; armtree teleop --leader PORT has one")

    def show(self, blocked: Blocked | None) -> None:
        """Do nothing."""
