"""Does the arm touch anything? Many configurations at a time."""

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from .errors import NotFinite
from .model import Model

Array = NDArray[np.float64]

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
    """Working memory to check a model's configurations; for one thread.

    What is asked of many configurations is asked of the hulls first, and of the primitives only
    where two hulls are too near, and only of the primitives of those two.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self._outer = _Outer(model)
        self._exact = dict[int, _Exact]()
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
        self._outer.keep(np.full(len(self._outer.margins), margin))
        for begin in range(0, q.shape[1], _BATCH):
            column = self._first_hit(q[:, begin : begin + _BATCH])
            if column is not None:
                return begin + column
        return None

    def doubtful(self, configurations: Array, margins: Array) -> NDArray[np.bool_]:
        """Which rows have two hulls nearer than their margin, so that their links may be.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margins: For each pair of `Model.outer` (P,) [m].

        Returns:
            (N,).
        """
        self._outer.keep(margins)
        return self._outer.hits(self._coordinates(configurations), stop=False)

    def near(self, configurations: Array, margins: Array) -> NDArray[np.bool_]:
        """Which rows have two links nearer than their margin, none being beyond doubt.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margins: For each pair of `Model.outer` (P,) [m].

        Returns:
            (N,).
        """
        q = self._coordinates(configurations)
        self._outer.keep(margins)
        return np.array([self._touches(q[:, i : i + 1]) for i in range(q.shape[1])], dtype=bool)

    def _first_hit(self, q: Array) -> int | None:
        """Column of the first hit. One call if it is free; few looks if the first doubt is one."""
        doubtful, seen = np.flatnonzero(self._outer.hits(q, stop=True)), 0
        while doubtful.size:
            for column in doubtful.tolist():
                seen = column + 1
                if self._touches(q[:, column:seen]):
                    return column
            doubtful = seen + np.flatnonzero(self._outer.hits(q[:, seen:], stop=False))
        return None

    def _touches(self, q: Array) -> bool:
        """Whether the primitives of two links are too near where their hulls may be (nq, 1)."""
        return any(
            self._of(pair).hit(q[:, 0], self._outer.margins[pair]) for pair in self._outer.pairs(q)
        )

    def _of(self, pair: int) -> "_Exact":
        """Made when it is first needed, as it takes a millisecond."""
        if pair not in self._exact:
            self._exact[pair] = _Exact(self._model, self._model.outer.collisionPairs[pair])
        return self._exact[pair]

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


class _Outer:
    """The hulls, and their memory.

    Attributes:
        margins: For each pair (P,) [m].
    """

    def __init__(self, model: Model) -> None:
        self._pool = pin.GeometryPool(model.kinematics, model.outer, 1)
        data = self._pool.getGeometryData(0)
        self._requests = _requests(model.outer, data)
        self._results = [data.collisionResults[k] for k in range(len(self._requests))]
        self.margins = [0.0] * len(self._requests)

    def keep(self, margins: Array) -> None:
        """Set the distances to be kept from now on (P,) [m]."""
        self.margins = margins.tolist()
        for request, margin in zip(self._requests, self.margins, strict=True):
            request.security_margin = margin

    def hits(self, q: Array, stop: bool) -> NDArray[np.bool_]:
        """Whether each column is a hit; after the first, if `stop`, the rest is not looked at."""
        if not q.size:
            return np.zeros(0, bool)
        return np.asarray(pin.computeCollisionsInParallel(1, self._pool, q, True, stop), bool)

    def pairs(self, q: Array) -> list[int]:
        """All pairs that are hit where the joints are (nq, 1)."""
        pin.computeCollisionsInParallel(1, self._pool, q, False, False)
        return [k for k, result in enumerate(self._results) if result.isCollision()]


class _Exact:
    """The primitives of two links, and their memory."""

    def __init__(self, model: Model, pair: pin.CollisionPair) -> None:
        self._kinematics, self._data = model.kinematics, model.kinematics.createData()
        self._geometry = model.between(pair)
        self._shapes = self._geometry.createData()
        self._requests = _requests(self._geometry, self._shapes)
        self._margin = 0.0

    def hit(self, q: Array, margin: float) -> bool:
        """Whether two are nearer than a margin [m] where the joints are (nq,)."""
        if margin != self._margin:
            for request in self._requests:
                request.security_margin = margin
            self._margin = margin
        return bool(
            pin.computeCollisions(
                self._kinematics, self._data, self._geometry, self._shapes, q, True
            )
        )


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
