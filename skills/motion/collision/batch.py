"""Many configurations looked at together, for contacts between hulls or between primitives."""

import math
from collections.abc import Callable, Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion.collision.scene import PlanningScene

Array = NDArray[np.float64]

BATCH = 500  # configurations looked at together
# Nothing can interrupt one call, so it gets no more than takes some milliseconds: so many pairs of
# hulls around boxes and cylinders, or of hulls around meshes.
SIMPLE, HULLS = 8000, 2000


class Hulls:
    """The hulls, and their memory.

    Args:
        model: Whose.
        pairs: Those of its pairs that are looked at to begin with.
        check: Called between calls that may take milliseconds.
    """

    def __init__(
        self, model: PlanningScene, pairs: frozenset[int], check: Callable[[], None]
    ) -> None:
        self._check, self._most = check, HULLS if model.solids else SIMPLE
        self._pool = pin.GeometryPool(model.kinematics, model.outer, 1)
        self._data = self._pool.getGeometryData(0)
        self._requests = _requests(model.outer, self._data)
        self._results = [self._data.collisionResults[k] for k in range(len(self._requests))]
        self._pairs, self._margin = pairs, math.nan
        for k in range(len(self._requests)):
            if k not in pairs:
                self._data.deactivateCollisionPair(k)

    def keep(self, pairs: frozenset[int], margins: Sequence[float]) -> None:
        """From now on look at these pairs, each with its distance to be kept (P,) [m]."""
        self._only(pairs)
        for k in pairs:
            self._requests[k].security_margin = margins[k]
        self._margin = math.nan

    def hold(self, pairs: frozenset[int], margin: float) -> None:
        """The same with one distance for all [m]."""
        new = pairs - self._pairs if margin == self._margin else pairs
        self._only(pairs)
        for k in new:
            self._requests[k].security_margin = margin
        self._margin = margin

    def _only(self, pairs: frozenset[int]) -> None:
        if pairs is self._pairs:
            return
        for k in self._pairs - pairs:
            self._data.deactivateCollisionPair(k)
        for k in pairs - self._pairs:
            self._data.activateCollisionPair(k)
        self._pairs = pairs

    def hits(self, q: Array, stop: bool) -> NDArray[np.bool_]:
        """Whether each row is a hit; after the first, if `stop`, the rest is not looked at."""
        rows = max(1, self._most // max(1, len(self._pairs)))
        return _collide(self._pool, q, stop, rows, self._check)

    def touching(self, q: Array) -> list[int]:
        """All pairs that are too near in the one row (1, nq)."""
        if len(self._pairs) == 1:
            return list(self._pairs)  # who asks knows that there is one
        pin.computeCollisionsInParallel(1, self._pool, q.T, False)
        return [k for k in sorted(self._pairs) if self._results[k].isCollision()]

    def near(self, q: Array) -> frozenset[int]:
        """All pairs that are too near in one row or another, each of which has such a pair."""
        pairs = self._pairs
        while len(q):
            left = self._pairs.difference(self.touching(q[:1]))
            self._only(left)
            if not left:
                break
            q = q[1:][self.hits(q[1:], stop=False)]
        found = pairs - self._pairs
        self._only(pairs)
        return found


class Primitives:
    """The primitives of two links, and their memory.

    Meshes are looked at one configuration at a time, as that may take milliseconds, and first
    whether they touch: whether they keep a margin takes up to a thousand times as long. A pool
    would copy them, which takes longer than most looks.
    """

    def __init__(
        self, model: PlanningScene, pair: pin.CollisionPair, check: Callable[[], None]
    ) -> None:
        self._kinematics, self._geometry, self._check = model.kinematics, model.between(pair), check
        shapes = [shape.geometry for shape in self._geometry.geometryObjects]
        self._meshed = any(isinstance(shape, coal.BVHModelBase) for shape in shapes)
        if self._meshed:
            self._data, self._bare = self._kinematics.createData(), self._geometry.createData()
            self._placed = placed = self._geometry.createData()
            _requests(self._geometry, self._bare)
        else:
            self._pool = pin.GeometryPool(self._kinematics, self._geometry, 1)
            placed = self._pool.getGeometryData(0)
        self._requests, self._margin = _requests(self._geometry, placed), 0.0

    def hits(self, q: Array, margin: float, stop: bool) -> NDArray[np.bool_]:
        """Whether two are nearer than a margin [m] in each row, as `Hulls.hits`."""
        if margin != self._margin:
            for request in self._requests:
                request.security_margin = margin
            self._margin = margin
        if not self._meshed:
            return _collide(self._pool, q, stop, BATCH, self._check)
        hits = np.zeros(len(q), bool)
        for i, row in enumerate(q):
            hits[i] = self._hit(row, self._bare) or (margin > 0.0 and self._hit(row, self._placed))
            if stop and hits[i]:
                break
        return hits

    def touch(self, q: Array) -> bool:
        """Whether meshes touch in one row (nq,); of others it is not asked."""
        return self._meshed and self._hit(q, self._bare)

    def _hit(self, q: Array, placed: pin.GeometryData) -> bool:
        self._check()
        model, data, geometry = self._kinematics, self._data, self._geometry
        return bool(pin.computeCollisions(model, data, geometry, placed, q, True))


def _collide(
    pool: pin.GeometryPool, q: Array, stop: bool, rows: int, check: Callable[[], None]
) -> NDArray[np.bool_]:
    """Whether each row is a hit; after the first, if `stop`, the rest is not looked at.

    Args:
        pool: Of what.
        q: (N, nq).
        stop: See above.
        rows: In one call.
        check: Called before each.
    """
    if 0 < len(q) <= rows:
        check()
        return np.asarray(pin.computeCollisionsInParallel(1, pool, q.T, True, stop), bool)
    hits = np.zeros(len(q), bool)
    for begin in range(0, len(q), rows):
        part = slice(begin, begin + rows)
        hits[part] = _collide(pool, q[part], stop, rows, check)
        if stop and hits[part].any():
            break
    return hits


def _requests(geometry: pin.GeometryModel, data: pin.GeometryData) -> list[coal.CollisionRequest]:
    """Of every pair, set so that answers do not depend on what was asked before."""
    requests = []
    for k, pair in enumerate(geometry.collisionPairs):
        shapes = [geometry.geometryObjects[i].geometry for i in (pair.first, pair.second)]
        request = data.collisionRequests[k]
        if any(isinstance(shape, coal.BVHModelBase) for shape in shapes):
            request.gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
        else:
            request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
        requests.append(request)
    return requests
