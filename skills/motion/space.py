"""Where a group may move while the rest stands: the free part of its joint space."""

from collections.abc import Callable
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

# A way is looked at in stretches of up to 16 steps first, then of 4, then of one.
_LEVELS = 3
_FINER = 4
_CUTS = np.arange(1.0 - _FINER, _FINER, 2.0)

Way = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Space:
    """Joint space of one group; points are the group's joints (J,) [rad].

    Attributes:
        contacts: Checks configurations.
        start: All actuated joints; those outside the group stay there (A,) [rad].
        columns: Which of them are the group's (J,).
        levers: Of the group's joints, for each pair of links (P, J) [m/rad]; see `reach`.
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
        configurations = np.empty((len(points), len(self.start)))
        configurations[:] = self.start
        configurations[:, self.columns] = points
        return configurations

    def edge(self, a: Array, b: Array) -> bool:
        """Whether the line from a free point to another is free."""
        travels = self.levers @ abs(b - a)
        return self.hit(lambda shares: a + shares[:, None] * (b - a), travels) is None

    def curve(self, curve: Curve) -> bool:
        """Whether a curve between free points is free."""
        lengths = np.diff(curve.breaks)
        before, after = abs(curve.slope), abs(curve.slope + 2.0 * lengths[:, None] * curve.bend)
        travels = (lengths[:, None] * np.maximum(before, after)) @ self.levers.T
        places, travels = evenly(curve.breaks, travels)
        return self.hit(lambda shares: curve.positions(places(shares)), travels) is None

    def hit(self, at: Way, travels: Array) -> float | None:
        """Where on a way two links are nearer than the margin, as a share of it; None if nowhere.

        It is cut into stretches, each looked at in its middle. Where the middle keeps half the
        margin and the travel to the ends of the stretch, half the margin is proved for all of it;
        where it does not, the stretch is cut finer, down to steps of the margin. See `reach`.

        Args:
            at: Its points at shares in [0, 1] (N,) -> (N, J) [rad].
            travels: For each pair of links, along all of it and no faster anywhere (P,) [m].
        """
        travel, step = float(travels.max(initial=0.0)), max(self.margin, LEAST_STEP)
        if not travel:
            return None
        level = next((k for k in range(_LEVELS) if step * _FINER**k >= travel), _LEVELS - 1)
        count = int(travel / (step * _FINER**level)) + 1
        half = 0.5 / count
        middles = half * (2.0 * _coarse_to_fine(count) + 1.0)
        while middles.size:
            self.deadline.check()
            points = self.whole(at(middles))
            if level:
                margins = np.maximum(0.5 * self.margin + half * travels, self.margin)
                doubtful = self.contacts.doubtful(points, margins)
                middles, points = middles[doubtful], points[doubtful]
            hit = self.contacts.first_hit(points, self.margin)
            if hit is not None:
                return float(middles[hit])
            if not level:
                return None
            middles = middles[self.contacts.near(points, margins)]
            half, level = half / _FINER, level - 1
            middles = (middles[:, None] + half * _CUTS).ravel()
        return None


def evenly(breaks: Array, travels: Array) -> tuple[Way, Array]:
    """How to run along pieces so that no pair of links ever moves faster than on average.

    Args:
        breaks: Where the pieces begin, and the end of the last (M + 1,).
        travels: For each pair of links on each piece, at a steady rate or less (M, P) [m].

    Returns:
        Places at shares of the way, and the travels to be reckoned with along all of it (P,) [m].
    """
    tops = travels.max(axis=1, initial=0.0)
    ends = np.concatenate(([0.0], np.cumsum(tops)))
    moving = tops > 0.0
    rates = (travels[moving] / tops[moving, None]).max(axis=0, initial=0.0)
    return lambda shares: np.interp(ends[-1] * shares, ends, breaks), ends[-1] * rates


@lru_cache(maxsize=1024)
def _coarse_to_fine(count: int) -> Array:
    """0 ... count - 1 as 0, 1/2, 1/4, 3/4 ... of the way (count,).

    A contact is met early in that order (J. G. van der Corput's sequence of 1935, run over the
    binary fractions).
    """
    bits = max(1, (count - 1).bit_length())
    order = np.argsort([int(f"{i:0{bits}b}"[::-1], 2) for i in range(count)]).astype(float)
    order.setflags(write=False)
    return order
