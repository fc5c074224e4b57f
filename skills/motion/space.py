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
        configurations = np.empty((len(points), len(self.start)))
        configurations[:] = self.start
        configurations[:, self.columns] = points
        return configurations

    def edge(self, a: Array, b: Array) -> bool:
        """Whether the line from a free point to another is free."""
        travel = float(abs(b - a) @ self.levers)
        if not travel:
            return True
        return self._clear(lambda places: a + (places / travel)[:, None] * (b - a), travel)

    def curve(self, curve: Curve) -> bool:
        """Whether a curve between free points is free."""
        lengths = np.diff(curve.breaks)
        before, after = abs(curve.slope), abs(curve.slope + 2.0 * lengths[:, None] * curve.bend)
        travels = (lengths[:, None] * np.maximum(before, after)) @ self.levers
        reach = np.concatenate(([0.0], np.cumsum(travels)))
        return self._clear(
            lambda places: curve.positions(np.interp(places, reach, curve.breaks)), float(reach[-1])
        )

    def _clear(self, at: Callable[[Array], Array], travel: float) -> bool:
        """Whether a way is free, given its points at places in [0, travel] [m] on it.

        It is cut into stretches, each looked at in its middle. Where the middle keeps half the
        margin and the travel to the ends of the stretch, half the margin is proved for all of it;
        where it may not, the stretch is cut finer, down to steps of the margin. See `reach`.
        """
        step = max(self.margin, LEAST_STEP)
        level = next((k for k in range(_LEVELS) if step * _FINER**k >= travel), _LEVELS - 1)
        count = int(travel / (step * _FINER**level)) + 1
        half = 0.5 * travel / count
        middles = half * (2.0 * _coarse_to_fine(count) + 1.0)
        while True:
            self.deadline.check()
            points = self.whole(at(middles))
            if not level:
                return self.contacts.first_hit(points, self.margin) is None
            radius = 0.5 * step * _FINER**level
            near = self.contacts.near(points, 0.5 * self.margin + radius)
            middles = middles[near]
            if not middles.size:
                return True
            if self.contacts.first_hit(points[near], self.margin) is not None:
                return False
            half, level = half / _FINER, level - 1
            middles = (middles[:, None] + half * _CUTS).ravel()


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
