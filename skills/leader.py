"""The interface to a leader: a hand-guided arm that another arm follows."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from .errors import NoLeader


@dataclass(frozen=True, slots=True)
class Blocked:
    """The reason that the arm does not follow its leader.

    Attributes:
        contact: The two bodies that would come too close, and their distance, in words.
        free: Free directions by joint: True if it alone may move to smaller positions, and True for
            larger ones.
    """

    contact: str
    free: Mapping[str, tuple[bool, bool]]


class Leader(Protocol):
    """A hand-guided arm. No method blocks."""

    def positions(self) -> tuple[float, ...] | None:
        """Return its measured positions, one per actuated joint [rad], or None to stop following.

        Raises:
            HardwareError: The arm is lost.
        """

    def show(self, blocked: Blocked | None) -> None:
        """Show the reason that the arm does not follow, or None if it follows."""


class NullLeader:
    """Takes the place of a leader if there is none."""

    def positions(self) -> tuple[float, ...] | None:
        """Raise the error."""
        raise NoLeader("there is no arm to follow; type: armtree teleop --leader PORT")

    def show(self, blocked: Blocked | None) -> None:
        """Do nothing."""
