"""Where a group may move while the rest stands: the free part of its joint space."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skills.motion.collision.batch import BATCH
from skills.motion.collision.checker import CollisionChecker, Look
from skills.motion.deadline import Deadline

from .curve import Curve

Array = NDArray[np.float64]

# Least distance between checked configurations, in metres of travel. With no margin to prove
# anything by, contacts shallower than half of it can pass unseen.
LEAST_STEP = 0.001

# A way is looked at in stretches of up to 16 steps first, then of 4, then of one.
_LEVELS = 3
_FINER = 4
_PIECE = 2**14  # stretches cut at a time
_KEPT = 2**11  # stretches whose order is kept for the next way
_CUTS = np.arange(1.0 - _FINER, _FINER, 2.0)

Way = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Space:
    """Joint space of one group; points are the group's joints (J,) [rad].

    Attributes:
        checker: Checks configurations.
        start: All actuated joints; those outside the group stay there (A,) [rad].
        columns: Which of them are the group's (J,).
        levers: Of the group's joints, for each pair of links (P, J) [m/rad]; see `reach`.
        margin: Distance to be kept wherever a way is looked at [m].
        proved: Distance to be proved all along it, between the looks too [m].
        deadline: When the time is up.
    """

    checker: CollisionChecker
    start: Array
    columns: NDArray[np.intp]
    lever_arms: Array
    margin: float
    proved: float
    deadline: Deadline

    @property
    def step(self) -> float:
        """Longest stretch for which the margin in its middle proves enough [m]."""
        return max(2.0 * (self.margin - self.proved), LEAST_STEP)

    def whole(self, points: Array) -> Array:
        """All actuated joints where the group's are at points (N, J) -> (N, A) [rad]."""
        configurations = np.empty((len(points), len(self.start)))
        configurations[:] = self.start
        configurations[:, self.columns] = points
        return configurations

    def edge(self, a: Array, b: Array) -> bool:
        """Whether the line from a free point to another is free."""
        travels = self.lever_arms @ abs(b - a)
        return self.hit(lambda shares: a + shares[:, None] * (b - a), travels) is None

    def curve(self, curve: Curve) -> bool:
        """Whether a curve between free points is free."""
        return self.meets(curve) is None

    def meets(self, curve: Curve) -> Array | None:
        """A point of a curve between free points that is not free (J,) [rad]; None if all are."""
        lengths = np.diff(curve.breaks)
        before, after = abs(curve.slope), abs(curve.slope + 2.0 * lengths[:, None] * curve.bend)
        travels = (lengths[:, None] * np.maximum(before, after)) @ self.lever_arms.T
        places, travels = evenly(curve.breaks, travels)
        share = self.hit(lambda shares: curve.positions(places(shares)), travels)
        return None if share is None else curve.positions(places(np.array([share])))[0]

    def hit(self, at: Way, travels: Array) -> float | None:
        """Where on a way two links are nearer than the margin, as a share of it; None if nowhere.

        It is cut into stretches, each looked at in its middle. Where the middle keeps the distance
        to be proved and the travel to the ends of the stretch, it is proved for all of it; where it
        does not, the stretch is cut finer, until the margin is enough to prove it. See `reach`.

        Args:
            at: Its points at shares in [0, 1] (N,) -> (N, J) [rad].
            travels: For each pair of links, along all of it and no faster anywhere (P,) [m].
        """
        travel, step = float(travels.max(initial=0.0)), self.step
        if not travel:
            return None
        level = next((k for k in range(_LEVELS) if step * _FINER**k >= travel), _LEVELS - 1)
        count = int(travel / (step * _FINER**level)) + 1
        half = 0.5 / count
        for order in _coarse_to_fine(count):
            share = self._met(at, half * (2.0 * order + 1.0), half, travels, level)
            if share is not None:
                return share
        return None

    def _met(
        self, at: Way, middles: Array, half: float, travels: Array, level: int
    ) -> float | None:
        """As `hit`, in stretches around so many middles, of half a length each side."""
        pairs = self.checker.pairs
        while middles.size:
            near, close = list[Array](), set[int]()
            for begin in range(0, len(middles), BATCH):
                part = middles[begin : begin + BATCH]
                look = self._look(at(part), half * travels, pairs, level)
                if look.hit is not None:
                    return float(part[look.hit])
                near.append(part[look.near])
                close |= look.pairs
            half, pairs, level = half / _FINER, frozenset(close), level - 1
            middles = (np.concatenate(near)[:, None] + half * _CUTS).ravel()
        return None

    def _look(self, points: Array, around: Array, pairs: frozenset[int], level: int) -> Look:
        """Which points prove too little for some pair that far around (P,) [m]."""
        self.deadline.check()
        rows = self.whole(points)
        if not level:
            hit = self.checker.first_collision(rows, self.margin, pairs)
            return Look(hit, np.zeros(len(rows), bool), frozenset())
        margins = np.maximum(self.proved + around, self.margin)
        # Of the longest stretches primitives hardly ever know better than hulls.
        closely = level < _LEVELS - 1
        return self.checker.look(rows, margins, self.margin, pairs, closely)


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


def _coarse_to_fine(count: int) -> Iterable[Array]:
    """0 ... count - 1 as 0, 1/2, 1/4, 3/4 ... of the way, in pieces.

    A contact is met early in that order (J. G. van der Corput's sequence of 1935, run over the
    binary fractions). However many they are, what is not looked at yet takes no memory.
    """
    return (_kept(count),) if count <= _KEPT else _pieces(count)


@lru_cache(maxsize=1024)
def _kept(count: int) -> Array:
    (order,) = _pieces(count)
    order.setflags(write=False)
    return order


def _pieces(count: int) -> Iterator[Array]:
    """The numbers of so many binary digits, each read backwards, but those beyond the count."""
    digits = max(1, (count - 1).bit_length())
    for begin in range(0, 2**digits, _PIECE):
        numbers = np.arange(begin, min(begin + _PIECE, 2**digits))
        order = np.zeros(len(numbers))
        for place in range(int(numbers[-1]).bit_length()):
            order += (numbers >> place & 1) * 2.0 ** (digits - 1 - place)
        yield order[order < count]
