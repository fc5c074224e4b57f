"""The interface to a leader: an arm that a person moves by hand, and that another arm follows."""

from collections.abc import Mapping
from typing import Protocol

from hardware.loading.dataclass import dataclass

from .errors import NoLeader


@dataclass(frozen=True, slots=True)
class Blocked:
    """The reason that the arm does not follow its leader.

    Attributes:
        contact: Words that name the two bodies that would come too close, and their distance.
        free: Free directions of each joint, by name: True if the joint alone may move to smaller
            positions, and True if it alone may move to larger positions.
    """

    contact: str
    free: Mapping[str, tuple[bool, bool]]


class Leader(Protocol):
    """A hand-guided arm that another arm follows. No method blocks."""

    def positions(self) -> tuple[float, ...] | None:
        """Return the measured positions of the leader, one per actuated joint [rad].

        Returns None if the arm shall stop following.

        Raises:
            HardwareError: The connection to the leader is lost.
        """

    def show(self, blocked: Blocked | None) -> None:
        """Show people why the arm does not follow.

        Args:
            blocked: The reason; None if the arm follows.
        """


class NullLeader:
    """Replaces the leader if no hand-guided arm is connected."""

    def positions(self) -> tuple[float, ...] | None:
        """Raise NoLeader."""
        raise NoLeader("there is no arm to follow; type: armtree teleop --leader PORT")

    def show(self, blocked: Blocked | None) -> None:
        """Do nothing."""
