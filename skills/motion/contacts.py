"""Does the arm touch anything? Many configurations at a time."""

from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from .errors import NotFinite
from .inside import Insides
from .model import Model

Array = NDArray[np.float64]

BATCH = 500  # configurations in one call, which nothing can interrupt: about 1 ms


class Contact(NamedTuple):
    """The nearest two links.

    Attributes:
        first: One, or `floor`.
        second: The other.
        distance: Between them, negative where they overlap, or one is inside the other [m].
    """

    first: str
    second: str
    distance: float


class Look(NamedTuple):
    """What a look at some configurations found.

    Attributes:
        hit: Row of the first where two links are nearer than the least distance; None where there
            is none.
        near: Which rows have two links nearer than their margin, when there is no hit (N,).
        pairs: All pairs of links that are, in one row or another.
    """

    hit: int | None
    near: NDArray[np.bool_]
    pairs: frozenset[int]


class Contacts:
    """Working memory to check a model's configurations; for one thread.

    What is asked of many configurations is asked of the hulls first, and of the primitives only
    where two hulls are too near, and only of the primitives of those two.
    """

    def __init__(self, model: Model) -> None:
        self._model = model
        self.pairs = frozenset(range(len(model.outer.collisionPairs)))
        self._all, self._some = _Outer(model, self.pairs), _Outer(model, frozenset())
        self._exact = dict[tuple[int, bool], _Exact]()
        self._data = model.kinematics.createData()
        self._shapes = model.exact.createData()
        self._insides = Insides(model, self._data, self._shapes)

    def first_hit(
        self, configurations: ArrayLike, margin: float, pairs: frozenset[int] | None = None
    ) -> int | None:
        """Row of the first configuration where two links are nearer than a margin.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to be kept [m].
            pairs: Those of `Model.outer` to be looked at; None for all.

        Raises:
            NotFinite: pinocchio must never see a NaN: it would answer wrongly ever after.
        """
        rows = np.asarray(configurations, dtype=np.float64)
        for begin in range(0, len(rows), BATCH):
            q = self._coordinates(rows[begin : begin + BATCH])
            row = self._first_hit(q, margin, self.pairs if pairs is None else pairs)
            if row is not None:
                return begin + row
        return None

    def blocked(self, configurations: Array, margin: float) -> tuple[int, Contact] | None:
        """Row of the first configuration that can be no end of a motion, and why.

        Unlike `first_hit` it sees what is inside a mesh.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to be kept [m].

        Raises:
            NotFinite: As `first_hit`.
        """
        hit = self.first_hit(configurations, margin)
        before = self._coordinates(configurations[:hit]).T
        row = next((i for i, q in enumerate(before) if self._insides.pairs(q)), hit)
        if row is None:
            return None
        nearest = self.nearest(configurations[row])
        assert nearest
        return row, nearest

    def look(
        self,
        configurations: Array,
        margins: Array,
        least: float,
        pairs: frozenset[int],
        closely: bool,
    ) -> Look:
        """Which configurations are near to a contact.

        Args:
            configurations: All actuated joints, at most `BATCH` rows (N, A) [rad].
            margins: For each pair of `Model.outer`, at least `least` (P,) [m].
            least: Distance below which there is nothing more to be asked [m].
            pairs: Those to be looked at; the others may be at any distance.
            closely: Whether to ask the primitives too which rows are near; if not, some may only
                seem to be.

        Raises:
            NotFinite: As `first_hit`.
        """
        q, wanted = self._coordinates(configurations), margins.tolist()
        outer = self._outer(pairs)
        outer.keep(pairs, wanted)
        near, found = outer.hits(q, stop=False), set[int]()
        rows = np.flatnonzero(near)
        if not rows.size:
            return Look(None, near, frozenset())
        hit = self._first_hit(q[:, rows], least, pairs)
        if hit is not None:
            return Look(int(rows[hit]), near, frozenset())
        outer.keep(pairs, wanted)
        for row in rows.tolist():
            here = q[:, row]
            close = outer.touching(here)
            if closely:
                close = [k for k in close if self._of(k, False).hit(here, wanted[k])]
            near[row] = bool(close)
            found.update(close)
        return Look(None, near, frozenset(found))

    def close(self, configurations: Array, margin: float) -> frozenset[int]:
        """Pairs whose hulls are nearer than a margin [m] in some of the configurations (N, A)."""
        q = self._coordinates(configurations)
        self._all.keep(self.pairs, [margin] * len(self.pairs))
        return frozenset(k for column in q.T for k in self._all.touching(column))

    def doubtful(
        self, configurations: Array, margin: float, pairs: frozenset[int]
    ) -> NDArray[np.bool_]:
        """In which configurations the hulls of some of these pairs are nearer than a margin (N,).

        Args:
            configurations: All actuated joints, at most `BATCH` rows (N, A) [rad].
            margin: Distance to be kept [m].
            pairs: Those of `Model.outer` to be looked at.
        """
        self._some.keep(pairs, [margin] * len(self.pairs))
        return self._some.hits(self._coordinates(configurations), stop=False)

    def _first_hit(self, q: Array, margin: float, pairs: frozenset[int]) -> int | None:
        """Column of the first hit. One call if it is free; few looks if the first doubt is one."""
        outer = self._outer(pairs)
        outer.keep(pairs, [margin] * len(self.pairs))
        doubtful, seen = np.flatnonzero(outer.hits(q, stop=True)), 0
        while doubtful.size:
            for column in doubtful.tolist():
                here, seen = q[:, column], column + 1
                if any(self._of(k, True).hit(here, margin) for k in outer.touching(here)):
                    return column
            doubtful = seen + np.flatnonzero(outer.hits(q[:, seen:], stop=False))
        return None

    def _outer(self, pairs: frozenset[int]) -> "_Outer":
        """Two, as turning many pairs on and off takes its time too."""
        return self._all if pairs is self.pairs else self._some

    def _of(self, pair: int, least: bool) -> "_Exact":
        """Made when it is first needed; one for the least distance, which hardly ever changes."""
        checker = self._exact.get((pair, least))
        if checker is None:
            checker = _Exact(self._model, self._model.outer.collisionPairs[pair])
            self._exact[pair, least] = checker
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
        for k in self._insides.pairs(coordinates):
            distances[k] = -abs(distances[k])
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

    Args:
        model: Whose.
        pairs: Those of its pairs that are looked at to begin with.
    """

    def __init__(self, model: Model, pairs: frozenset[int]) -> None:
        self._pool = pin.GeometryPool(model.kinematics, model.outer, 1)
        self._data = self._pool.getGeometryData(0)
        self._requests = _requests(model.outer, self._data)
        self._results = [self._data.collisionResults[k] for k in range(len(self._requests))]
        self._pairs = pairs
        for k in range(len(self._requests)):
            if k not in pairs:
                self._data.deactivateCollisionPair(k)

    def keep(self, pairs: frozenset[int], margins: Sequence[float]) -> None:
        """From now on look at these pairs, each with its distance to be kept (P,) [m]."""
        for k in self._pairs - pairs:
            self._data.deactivateCollisionPair(k)
        for k in pairs - self._pairs:
            self._data.activateCollisionPair(k)
        for k in pairs:
            self._requests[k].security_margin = margins[k]
        self._pairs = pairs

    def hits(self, q: Array, stop: bool) -> NDArray[np.bool_]:
        """Whether each column is a hit; after the first, if `stop`, the rest is not looked at."""
        if not q.size:
            return np.zeros(q.shape[1], bool)
        columns = np.asfortranarray(q)
        return np.asarray(pin.computeCollisionsInParallel(1, self._pool, columns, True, stop), bool)

    def touching(self, q: Array) -> list[int]:
        """All pairs that are too near where the joints are (nq,)."""
        if len(self._pairs) == 1:
            return list(self._pairs)  # who asks knows that there is one
        pin.computeCollisionsInParallel(1, self._pool, q[:, None], False)
        return [k for k in sorted(self._pairs) if self._results[k].isCollision()]


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
