"""Does the arm touch anything? Many configurations at a time."""

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from .errors import NotFinite
from .model import Model

Array = NDArray[np.float64]

_KEPT = 32  # margins at a time; planning itself needs few
_BATCH = 500  # configurations in one call, which nothing can interrupt: about 1 ms


class Contact(NamedTuple):
    """The nearest two links.

    Attributes:
        first: One, or `floor`.
        second: The other.
        distance: Between them, negative where they overlap [m].
    """

    first: str
    second: str
    distance: float


class Contacts:
    """Working memory to check a model's configurations; for one thread."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._checkers: dict[tuple[bool, float], _Checker] = {}
        self._data = model.kinematics.createData()
        self._shapes = model.exact.createData()

    def first_hit(self, configurations: ArrayLike, margin: float) -> int | None:
        """Row of the first configuration where two links are nearer than a margin.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to be kept [m].

        Raises:
            NotFinite: pinocchio must never see a NaN: it would answer wrongly ever after.
        """
        q = self._coordinates(np.asarray(configurations, dtype=np.float64))
        for begin in range(0, q.shape[1], _BATCH):
            row = self._first_hit(q[:, begin : begin + _BATCH], margin)
            if row is not None:
                return begin + row
        return None

    def near(self, configurations: Array, margin: float) -> NDArray[np.bool_]:
        """Which rows may have two links nearer than a margin (N, A) [rad] -> (N,).

        All that do, and some that only seem to, since hulls are looked at.
        """
        q = self._coordinates(configurations)
        return self._outer(margin).hits(q, stop=False)

    def _first_hit(self, q: Array, margin: float) -> int | None:
        """Column of the first hit. One call if it is free; few looks if the first doubt is one."""
        outer = self._outer(margin)
        doubtful = np.flatnonzero(outer.hits(q, stop=True))
        while doubtful.size:
            hits = self._exact(margin).hits(np.asfortranarray(q[:, doubtful]), stop=True)
            if hits.any():
                return int(doubtful[int(hits.argmax())])
            rest = int(doubtful[-1]) + 1
            doubtful = rest + np.flatnonzero(outer.hits(q[:, rest:], stop=False))
        return None

    def _outer(self, margin: float) -> "_Checker":
        return self._checker(False, margin)

    def _exact(self, margin: float) -> "_Checker":
        return self._checker(True, margin)

    def _checker(self, exact: bool, margin: float) -> "_Checker":
        """Kept, as setting the margin of every pair costs as much as a small batch."""
        checker = self._checkers.get((exact, margin))
        if checker is None:
            if len(self._checkers) >= _KEPT:
                self._checkers.clear()
            geometry = self._model.exact if exact else self._model.outer
            checker = _Checker(self._model.kinematics, geometry, margin)
            self._checkers[exact, margin] = checker
        return checker

    def nearest(self, configuration: ArrayLike) -> Contact | None:
        """The nearest two links that may not touch (A,) [rad]; None where all may."""
        row = np.asarray(configuration, dtype=np.float64)[None, :]
        geometry = self._model.exact
        if not len(geometry.collisionPairs):
            return None
        coordinates = self._coordinates(row)[:, 0]
        pin.computeDistances(
            self._model.kinematics, self._data, geometry, self._shapes, coordinates
        )
        distances = [result.min_distance for result in self._shapes.distanceResults]
        k = int(np.argmin(distances))
        pair = geometry.collisionPairs[k]
        names = [self._model.link(geometry, i) for i in (pair.first, pair.second)]
        return Contact(names[0], names[1], distances[k])

    def _coordinates(self, configurations: Array) -> Array:
        if not np.isfinite(configurations).all():
            row, column = np.argwhere(~np.isfinite(configurations))[0]
            value = float(configurations[row, column])
            raise NotFinite(f"row {row}", self._model.joints[column], value)
        return self._model.coordinates(configurations)


class _Checker:
    """One geometry, one margin, and their memory."""

    def __init__(self, kinematics: pin.Model, geometry: pin.GeometryModel, margin: float) -> None:
        self._pool = pin.GeometryPool(kinematics, geometry, 1)
        requests = self._pool.getGeometryData(0).collisionRequests
        for k, pair in enumerate(geometry.collisionPairs):
            shapes = [geometry.geometryObjects[i].geometry for i in (pair.first, pair.second)]
            # Answers must not depend on what was asked before, as they do with a cached guess.
            if any(isinstance(shape, coal.BVHModelBase) for shape in shapes):
                requests[k].gjk_initial_guess = coal.GJKInitialGuess.DefaultGuess
            else:
                requests[k].gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
            requests[k].security_margin = margin

    def hits(self, q: Array, stop: bool) -> NDArray[np.bool_]:
        """Whether each column is a hit; after the first, if `stop`, the rest is not looked at."""
        if not q.size:
            return np.zeros(0, bool)
        return np.asarray(pin.computeCollisionsInParallel(1, self._pool, q, True, stop), bool)
