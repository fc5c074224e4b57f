"""Continuous collision checking of lines and curves in the joint space of one group.

It corresponds to OMPL's MotionValidator. A path is checked at sample points. Bounds on the travel
of every pair of links prove that the path between the samples is free; see
`robot_model/motion_bounds.py`.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from skills.motion.arrays import Array, Mask
from skills.motion.collision.broad_phase import BATCH
from skills.motion.collision.checker import CollisionChecker, Proximity
from skills.motion.deadline import Deadline
from skills.motion.robot_model.joint_group import JointGroup
from skills.motion.trajectory.curve import Curve

# Smallest distance between checked configurations, in metres of travel. If the margin is too small
# for a proof, contacts with less than half this depth can be missed.
MIN_STEP = 0.001

# A path is checked in sections of up to 16 steps, then of 4 steps, then of one step.
_LEVELS = 3
_REFINEMENT = 4
_CHUNK = 2**14  # section numbers generated at a time
_CACHED = 2**11  # largest number of sections with a cached order
_LONG = 1.0  # travel above which a line is first checked at a few points [m]
# Checked shares of a line between two free points, in this order.
_SAMPLES = np.array([3.0, 1.0, 5.0, 2.0, 4.0])[:, None] / 6.0
_SUBSECTIONS = np.arange(1.0 - _REFINEMENT, _REFINEMENT, 2.0)

Path = Callable[[Array], Array]  # shares of a path (N,) -> points (N, J) [rad]


@dataclass(frozen=True, eq=False)
class MotionValidator:
    """Checks motions of one group while all other joints stay at the start.

    Points are positions of the group's joints (J,) [rad].

    Attributes:
        checker: Checks configurations.
        group: The group.
        start: All actuated joints at the start (A,) [rad].
        margin: Distance to keep at each sample [m].
        guaranteed: Distance that is proved along the whole path, also between samples [m].
        deadline: Deadline of the query.
        proves: False to check lines and curves only at points: the middles of the longest sections.
    """

    checker: CollisionChecker
    group: JointGroup
    start: Array
    margin: float
    guaranteed: float
    deadline: Deadline
    proves: bool = True

    @cached_property
    def lever_arms(self) -> Array:
        """Bounds on the travel of each pair of links per unit of the group's joints [m/rad]."""
        lever_arms: Array = self.checker.scene.lever_arms[:, self.group.columns]
        return lever_arms

    @property
    def step(self) -> float:
        """Longest section for which a free middle proves the whole section [m of travel]."""
        return max(2.0 * (self.margin - self.guaranteed), MIN_STEP)

    def full(self, points: Array) -> Array:
        """Return all actuated joints (N, A) for points of the group (N, J) [rad]."""
        return self.group.full(self.start, points)

    def seems_free(self, a: Array, b: Array) -> bool:
        """Return True if samples of the line between two free points keep the margin. No proof."""
        return self.sampled_collision(a + _SAMPLES * (b - a)) is None

    def free_points(self, points: Array) -> Mask:
        """Return True for each point that keeps the margin (N, J) -> (N,)."""
        return ~self.checker.collisions(self.full(points), self.margin)

    def sampled_collision(self, points: Array) -> Array | None:
        """Return the first point that violates the margin (N, J) -> (J,) [rad], or None."""
        hit = self.checker.first_collision(self.full(points), self.margin)
        return None if hit is None else points[hit]

    def free_samples(self, a: Array, b: Array, count: int) -> int:
        """Return the number of samples of a line before the first one that violates the margin.

        Args:
            a: Start of the line (J,) [rad]. It is not one of the samples.
            b: End of the line (J,) [rad]. It is the last sample.
            count: Number of samples.
        """
        rows = self.full(a + np.arange(1.0, count + 1.0)[:, None] / count * (b - a))
        hit = self.checker.first_collision(rows, self.margin)
        return count if hit is None else hit

    def line_is_free(self, a: Array, b: Array) -> bool:
        """Return True if the line between two free points is free.

        A line that would need a long proof is first checked at a few points.
        """
        travels = self.lever_arms @ abs(b - a)
        is_long = travels.max(initial=0.0) > _LONG
        if (is_long or not self.proves) and not self.seems_free(a, b):
            return False
        return self.colliding_share(lambda shares: a + shares[:, None] * (b - a), travels) is None

    def curve_is_free(self, curve: Curve) -> bool:
        """Return True if a curve between two free points is free."""
        return self.collision_on(curve) is None

    def collision_on(self, curve: Curve) -> Array | None:
        """Return a point of a curve that is in collision (J,) [rad], or None if the curve is free.

        Args:
            curve: A curve between two free points.
        """
        lengths = np.diff(curve.breaks)
        before = abs(curve.linear)
        after = abs(curve.linear + 2.0 * lengths[:, None] * curve.quadratic)
        travels = (lengths[:, None] * np.maximum(before, after)) @ self.lever_arms.T
        parameter, travels = uniform_travel(curve.breaks, travels)
        share = self.colliding_share(lambda shares: curve.positions(parameter(shares)), travels)
        return None if share is None else curve.positions(parameter(np.array([share])))[0]

    def colliding_share(self, path: Path, travels: Array) -> float | None:
        """Return a share of a path at which two links are closer than the margin, or None.

        The path is cut into sections. Each section is checked at its middle. If the middle keeps
        the guaranteed distance plus the travel to the section's ends, the whole section is free.
        Else the section is cut into four, down to sections for which the margin is enough. Long
        sections are proved with convex hulls, and these short ones with exact shapes.

        Args:
            path: Points at shares in [0, 1] (N,) -> (N, J) [rad].
            travels: Upper bounds on the travel of each pair of links along the whole path, at an
                even rate (P,) [m].
        """
        travel, step = float(travels.max(initial=0.0)), self.step
        if not travel:
            return None
        level = next((k for k in range(_LEVELS) if step * _REFINEMENT**k >= travel), _LEVELS - 1)
        count = int(travel / (step * _REFINEMENT**level)) + 1
        half = 0.5 / count
        for order in _coarse_to_fine(count):
            middles = half * (2.0 * order + 1.0)
            if self.proves:
                share = self._refine(path, middles, half, travels, level)
            else:
                hit = self.checker.first_collision(self.full(path(middles)), self.margin)
                share = None if hit is None else float(middles[hit])
            if share is not None:
                return share
        return None

    def _refine(
        self, path: Path, middles: Array, half: float, travels: Array, level: int
    ) -> float | None:
        """Return the share of the first collision in sections of length 2 * `half`, or None."""
        pairs = self.checker.pairs
        while middles.size:
            near, close = list[Array](), set[int]()
            for begin in range(0, len(middles), BATCH):
                part = middles[begin : begin + BATCH]
                found = self._proximity(path(part), half * travels, pairs, level)
                if found.collision is not None:
                    return float(part[found.collision])
                near.append(part[found.near])
                close |= found.pairs
            half, pairs, level = half / _REFINEMENT, frozenset(close), level - 1
            middles = (np.concatenate(near)[:, None] + half * _SUBSECTIONS).ravel()
        return None

    def _proximity(
        self, points: Array, travels: Array, pairs: frozenset[int], level: int
    ) -> Proximity:
        """Find the points that are too close for sections with these half travels (P,) [m]."""
        self.deadline.check()
        rows = self.full(points)
        if not level:
            hit = self.checker.first_collision(rows, self.margin, pairs)
            return Proximity(hit, np.zeros(len(rows), bool), frozenset())
        margins = np.maximum(self.guaranteed + travels, self.margin)
        return self.checker.proximity(rows, margins, self.margin, pairs)


def uniform_travel(breaks: Array, travels: Array) -> tuple[Path, Array]:
    """Reparametrise a path of pieces so that no pair of links moves faster than its mean rate.

    Args:
        breaks: Parameters of the pieces' ends (M + 1,).
        travels: Upper bounds on the travel of each pair of links on each piece, at an even rate (M,
            P) [m].

    Returns:
        A function from shares of the path to parameters, and an upper bound on the travel of each
        pair along the whole path (P,) [m].
    """
    tops = travels.max(axis=1, initial=0.0)
    ends = np.concatenate(([0.0], np.cumsum(tops)))
    moving = tops > 0.0
    rates = (travels[moving] / tops[moving, None]).max(axis=0, initial=0.0)
    return lambda shares: np.interp(ends[-1] * shares, ends, breaks), ends[-1] * rates


def _coarse_to_fine(count: int) -> Iterable[Array]:
    """Yield the numbers below `count` in the order 0, 1/2, 1/4, 3/4 ... of the path, in chunks.

    This order finds a collision early (J. G. van der Corput's sequence of 1935). Chunks limit the
    memory for very long paths.
    """
    return (_cached_order(count),) if count <= _CACHED else _bit_reversed(count)


@lru_cache(maxsize=1024)
def _cached_order(count: int) -> Array:
    (order,) = _bit_reversed(count)
    order.setflags(write=False)
    return order


def _bit_reversed(count: int) -> Iterator[Array]:
    """Yield all numbers below `count`, by their reversed binary digits."""
    digits = max(1, (count - 1).bit_length())
    for begin in range(0, 2**digits, _CHUNK):
        numbers = np.arange(begin, min(begin + _CHUNK, 2**digits))
        order = np.zeros(len(numbers))
        for place in range(int(numbers[-1]).bit_length()):
            order += (numbers >> place & 1) * 2.0 ** (digits - 1 - place)
        yield order[order < count]
