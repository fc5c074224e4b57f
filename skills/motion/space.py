"""Where a group may move while the rest stands: the free part of its joint space."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .contacts import Contacts
from .curve import Curve
from .deadline import Deadline

Array = NDArray[np.float64]

# Least distance between checked configurations, in metres of travel. With no margin to prove
# anything by, contacts shallower than half of it can pass unseen.
LEAST_STEP = 0.001


@dataclass(frozen=True, eq=False)
class Space:
    """Joint space of one group; points are the group's joints (J,) [rad].

    Attributes:
        contacts: Checks configurations.
        start: All actuated joints; those outside the group stay there (A,) [rad].
        columns: Which of them are the group's (J,).
        levers: Of the group's joints (J,) [m/rad]; see `reach`.
        margin: Distance to be kept [m].
        deadline: When the time is up.
    """

    contacts: Contacts
    start: Array
    columns: NDArray[np.intp]
    levers: Array
    margin: float
    deadline: Deadline

    def free(self, points: Array) -> bool:
        """Whether all points keep the margin (N, J), in one batch."""
        self.deadline.check()
        return self.contacts.first_hit(self.whole(points), self.margin) is None

    def whole(self, points: Array) -> Array:
        """All actuated joints where the group's are at points (N, J) -> (N, A) [rad]."""
        configurations = np.tile(self.start, (len(points), 1))
        configurations[:, self.columns] = points
        return configurations

    def edge(self, a: Array, b: Array) -> bool:
        """Whether the line from a free point to another keeps the margin."""
        return self.free(a + _coarse_to_fine(self._count(abs(b - a))) * (b - a))

    def curve(self, curve: Curve) -> Array:
        """Points along a curve, less than a step of travel apart (N, J)."""
        lengths = np.diff(curve.breaks)
        before, after = abs(curve.slope), abs(curve.slope + 2.0 * lengths[:, None] * curve.bend)
        spans = lengths[:, None] * np.maximum(before, after)
        s = [
            np.linspace(begin, end, self._count(span) + 1)
            for begin, end, span in zip(curve.breaks, curve.breaks[1:], spans, strict=False)
        ]
        return curve.positions(np.concatenate(s))

    def _count(self, span: Array) -> int:
        """Into how many steps a move is cut (J,)."""
        return int(span @ self.levers / max(self.margin, LEAST_STEP)) + 1


@lru_cache(maxsize=4096)
def _coarse_to_fine(count: int) -> Array:
    """1/count, 2/count ... 1 in the order 1, 1/2, 1/4, 3/4 ... (count, 1).

    A contact is met early in that order (J. G. van der Corput's sequence of 1935, run over the
    binary fractions).
    """
    bits = max(1, (count - 1).bit_length())
    place = [int(f"{i:0{bits}b}"[::-1], 2) for i in range(count)]
    order = np.array([0, *sorted(range(1, count), key=place.__getitem__)])
    fractions = ((count - order) / count)[:, None]
    fractions.setflags(write=False)
    return fractions
