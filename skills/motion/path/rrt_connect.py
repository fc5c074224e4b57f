"""Lazy RRT-Connect: searches for a path if no line and no single bend is free.

James J. Kuffner and Steven M. LaValle, "RRT-Connect: an efficient approach to single-query path
planning", ICRA 2000; lazy as Gildardo Sanchez and Jean-Claude Latombe, "A single-query
bi-directional probabilistic roadmap planner with lazy collision checking", ISRR 2001. Edges are
first checked at a few points. The edges of a path from start to goal are then checked completely.

The trees are balanced: the smaller one is extended, so a tree in a narrow place grows as far as the
other one (LaValle, "Planning Algorithms", 2006, section 5.5.3).

Several samples extend a tree at once. In a narrow place, most are in collision, and one check of
many points takes less time than many checks.

A failed search starts again with other samples: a few unlucky samples at its beginning can cost
more than a new start.
"""

from collections.abc import Iterator

import numpy as np

from skills.motion.arrays import Array
from skills.motion.errors import NoPath, PlanTimeout

from .motion_validator import MotionValidator

# Numbers of samples, not times, so equal queries give equal paths.
_FIRST_SAMPLES = 1_000  # samples of the first search; each further search has this many more
_MAX_SEARCHES = 16  # some goals in a shelf need more than ten; 16 take some seconds
_BATCH = 8  # samples that extend a tree at once; checks of many points take less time for each
_RANGE = 0.7  # longest edge of a tree [rad]
_POINTS = 6  # checked points of an edge
_SPREAD = 0.25  # standard deviation of samples near a root, as a share of the joint's range


def find_paths(
    validator: MotionValidator, start: Array, goals: Array, seed: int
) -> Iterator[Array]:
    """Yield paths from start to one of the goals (N, J) [rad], with edges that seem free.

    The caller needs another path only if an edge is not free. For a joint without limits, the
    search includes positions up to half a turn beyond start and goal.

    Args:
        validator: Checks motions of the group.
        start: A free point (J,) [rad].
        goals: Free points (G, J) [rad].
        seed: Random seed, at least 0. Equal seeds give equal paths.

    Raises:
        NoPath: No path was found within the limit of samples.
        PlanTimeout: The deadline passed. The error lists what was tried.
    """
    group, ends = validator.group, np.vstack((start, goals))
    lower = np.where(np.isfinite(group.lower), group.lower, ends.min(axis=0) - np.pi)
    upper = np.where(np.isfinite(group.upper), group.upper, ends.max(axis=0) + np.pi)
    drawn, reached = 0, np.zeros(2, int)
    for search in range(1, _MAX_SEARCHES + 1):
        random = np.random.default_rng((seed, search))
        trees = _Tree(validator, start[None, :]), _Tree(validator, goals)
        count, roots = search * _FIRST_SAMPLES, [goals, start[None, :]]
        samples = _samples(random, count, roots, (lower, upper))
        try:
            for begin in range(0, len(samples), _BATCH):
                validator.deadline.check()
                batch = samples[begin : begin + _BATCH]
                drawn += len(batch)
                here, there = trees if trees[0].size <= trees[1].size else trees[::-1]
                for new in here.extend(batch):
                    if (met := there.connect(here.points[new])) is None:
                        continue
                    ways = here.way(new), there.way(met)
                    one, other = ways if here is trees[0] else ways[::-1]
                    yield np.vstack((trees[0].points[one[::-1]], trees[1].points[other[1:]]))
                    here.verify(ways[0])
                    there.verify(ways[1])
        except PlanTimeout as late:
            reached += [tree.size for tree in trees]
            raise PlanTimeout(late.timeout, drawn, search, *reached.tolist()) from None
        reached += [tree.size for tree in trees]
    raise NoPath(drawn, _MAX_SEARCHES, *reached.tolist())


def _samples(
    random: np.random.Generator, count: int, roots: list[Array], bounds: tuple[Array, Array]
) -> Array:
    """Return samples (count, J) [rad]: half are uniform, half are near the roots in turn.

    Samples near a root help to leave a narrow place around it.
    """
    samples, spread = random.uniform(*bounds, (count, len(bounds[0]))), _SPREAD * np.ptp(bounds, 0)
    for i, ends in enumerate(roots):
        local = np.arange(i, count, 4)
        near = ends[np.arange(len(local)) % len(ends)]
        samples[local] = near + spread * random.normal(size=near.shape)
    return np.clip(samples, *bounds)


class _Tree:
    """Points that edges connect to the roots.

    Args:
        validator: Checks motions of the group.
        roots: The roots (R, J) [rad].

    Attributes:
        points: The points, then space for more (M, J) [rad]. Removed points are infinite.
    """

    def __init__(self, validator: MotionValidator, roots: Array) -> None:
        self._validator, self.points = validator, roots.copy()
        self._parents, self._verified = [-1] * len(roots), [True] * len(roots)

    @property
    def size(self) -> int:
        """Number of added points, with roots and removed points."""
        return len(self._parents)

    def way(self, number: int) -> list[int]:
        """Return the numbers of the points from a point to its root, along edges of the tree."""
        way = []
        while number >= 0:
            way.append(number)
            number = self._parents[number]
        return way

    def extend(self, targets: Array) -> Iterator[int]:
        """Yield the number of each target (N, J), or of a new point towards it, if it seems free.

        Edges begin at the points of the tree before the first target.
        """
        near, begins, steps, lengths = self._nearest(targets)
        shares = np.minimum(1.0, _RANGE / np.maximum(lengths, _RANGE))
        ends = begins + shares[:, None] * steps
        for i in np.flatnonzero(self._validator.free_points(ends)).tolist():
            if not np.isfinite(self.points[near[i], 0]):
                continue  # removed since the first target
            if not lengths[i]:
                yield near[i]
            elif self._validator.seems_free(begins[i], ends[i]):
                yield self._add(ends[i], near[i])

    def connect(self, target: Array) -> int | None:
        """Add points towards a target (J,) as far as the edges seem free.

        Returns:
            Number of the point at the target, or None if it is not reached.
        """
        (last,), (begin,), (step,), (length,) = self._nearest(target[None, :])
        edges = int(length / _RANGE) + 1
        ends = begin + np.arange(1.0, edges + 1.0)[:, None] / edges * step
        free = self._validator.free_samples(begin, target, edges * _POINTS) // _POINTS
        for end in ends[:free]:
            last = self._add(end, last)
        return last if free == edges else None

    def verify(self, way: list[int]) -> None:
        """Check all edges of a way. Remove the points after the first edge that is not free.

        Args:
            way: Result of the method `way`.
        """
        for number in way[-2::-1]:
            parent = self._parents[number]
            line = self.points[parent], self.points[number]
            if not (self._verified[number] or self._validator.line_is_free(*line)):
                self._remove(number)
                return
            self._verified[number] = True

    def _remove(self, number: int) -> None:
        removed = {number}
        for i in range(number + 1, len(self._parents)):
            if self._parents[i] in removed:
                removed.add(i)
        self.points[sorted(removed)] = np.inf

    def _add(self, point: Array, parent: int) -> int:
        number = len(self._parents)
        if number == len(self.points):
            self.points = np.vstack((self.points, np.empty_like(self.points)))
        self.points[number] = point
        self._parents.append(parent)
        self._verified.append(False)
        return number

    def _nearest(self, targets: Array) -> tuple[list[int], Array, Array, Array]:
        """Return number and position of the nearest point of each target (N, J), step, length."""
        steps = targets[:, None, :] - self.points[: len(self._parents)]
        squares = (steps**2).sum(axis=2)
        numbers = squares.argmin(axis=1)
        rows = np.arange(len(targets))
        lengths = np.sqrt(squares[rows, numbers])
        return numbers.tolist(), self.points[numbers], steps[rows, numbers], lengths
