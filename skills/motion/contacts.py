"""Does the arm touch anything? Many configurations at a time."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from .depth import Depths
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
        distance: Between them; negative where they overlap, or one is inside the other: how far
            one of them would have to move to be free, of meshes at most that [m].
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

    Attributes:
        model: Whose.
        pairs: All of `Model.outer`, by number.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.pairs = frozenset(range(len(model.outer.collisionPairs)))
        self._outers = {
            (every, least): _Outer(model, self.pairs if every else frozenset())
            for every in (True, False)
            for least in (True, False)
        }
        self._exact = dict[tuple[int, bool], _Exact]()
        self._data = model.kinematics.createData()
        self._shapes = model.exact.createData()
        self._insides = Insides(model, self._data, self._shapes)
        self._depths = Depths(model, self._data, self._shapes, self._insides)

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
        if self._insides:
            before = enumerate(self._coordinates(configurations[:hit]))
            hit = next((i for i, q in before if self._insides.pairs(q)), hit)
        if hit is None:
            return None
        nearest = self.nearest(configurations[hit])
        assert nearest
        return hit, nearest

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
        outer = self._outer(pairs, False)
        outer.keep(pairs, wanted)
        near = outer.hits(q, stop=False)
        rows = near.nonzero()[0]
        if not rows.size:
            return Look(None, near, frozenset())
        if not closely:
            first, touches = self._first_doubt(q[rows], least, pairs)
            if touches:
                return Look(int(rows[first]), near, frozenset())
            return Look(None, near, outer.near(q[rows]))
        near, found, hit = np.zeros_like(near), set[int](), None
        for k in sorted(outer.near(q[rows])):
            doubtful = rows[self._near_by(q[rows], k, wanted[k], False)]
            close = doubtful[self._of(k, False).hits(q[doubtful], wanted[k], stop=False)]
            if close.size:
                near[close] = True
                found.add(k)
        if found:
            rows = near.nonzero()[0]
            hit = self._first_hit(q[rows], least, frozenset(found))
        return Look(None if hit is None else int(rows[hit]), near, frozenset(found))

    def close(self, configurations: Array, margin: float) -> frozenset[int]:
        """Pairs whose hulls are nearer than a margin [m] in some of the configurations (N, A)."""
        q, outer = self._coordinates(configurations), self._outer(self.pairs, True)
        outer.hold(self.pairs, margin)
        return outer.near(q[outer.hits(q, stop=False)])

    def doubtful(
        self, configurations: Array, margin: float, pairs: frozenset[int]
    ) -> NDArray[np.bool_]:
        """In which configurations the hulls of some of these pairs are nearer than a margin (N,).

        Args:
            configurations: All actuated joints, at most `BATCH` rows (N, A) [rad].
            margin: Distance to be kept [m].
            pairs: Those of `Model.outer` to be looked at.
        """
        outer = self._outer(pairs, True)
        outer.hold(pairs, margin)
        return outer.hits(self._coordinates(configurations), stop=False)

    def _first_hit(self, q: Array, margin: float, pairs: frozenset[int]) -> int | None:
        """Row of the first hit. One call if it is free; few looks if the first doubt is one."""
        first, touches = self._first_doubt(q, margin, pairs)
        if touches:
            return first
        after, hit = q[first + 1 :], None
        if not len(after):
            return None
        outer = self._outer(pairs, True)
        doubtful = first + 1 + outer.hits(after, stop=False).nonzero()[0]
        for k in sorted(outer.near(q[doubtful])):
            rows = doubtful[self._near_by(q[doubtful], k, margin, True)]
            hits = self._of(k, True).hits(q[rows], margin, stop=True)
            if hits.any():
                hit = int(rows[hits.argmax()])
                doubtful = doubtful[doubtful < hit]
        return hit

    def _first_doubt(self, q: Array, margin: float, pairs: frozenset[int]) -> tuple[int, bool]:
        """Row of the first where hulls are too near, N if none; and whether primitives are."""
        outer = self._outer(pairs, True)
        outer.hold(pairs, margin)
        doubts = outer.hits(q, stop=True).nonzero()[0]
        if not doubts.size:
            return len(q), False
        first = int(doubts[0])
        here = q[first : first + 1]
        close = outer.touching(here)
        return first, any(self._of(k, True).hits(here, margin, stop=True)[0] for k in close)

    def _near_by(self, q: Array, pair: int, margin: float, least: bool) -> NDArray[np.bool_]:
        """In which rows the hulls of a pair are nearer than a margin [m]."""
        pairs = frozenset((pair,))
        outer = self._outer(pairs, least)
        outer.hold(pairs, margin)
        return outer.hits(q, stop=False)

    def _outer(self, pairs: frozenset[int], least: bool) -> "_Outer":
        """As turning many pairs on and off takes its time: one for all and one for some.

        Of each one for the least distance, which hardly ever changes.
        """
        return self._outers[pairs is self.pairs, least]

    def _of(self, pair: int, least: bool) -> "_Exact":
        """Made when it is first needed; one for the least distance, as above."""
        checker = self._exact.get((pair, least))
        if checker is None:
            checker = _Exact(self.model, self.model.outer.collisionPairs[pair])
            self._exact[pair, least] = checker
        return checker

    def nearest(self, configuration: ArrayLike) -> Contact | None:
        """The nearest two links that may not touch (A,) [rad]; None where all may."""
        row, geometry = np.asarray(configuration, dtype=np.float64)[None, :], self.model.exact
        if not len(geometry.collisionPairs):
            return None
        k, distance = self._depths.nearest(self._coordinates(row)[0])
        pair = geometry.collisionPairs[k]
        names = [self.model.link(geometry, i) for i in (pair.first, pair.second)]
        return Contact(names[0], names[1], distance)

    def _coordinates(self, configurations: Array) -> Array:
        if not np.isfinite(configurations).all():
            row, column = np.argwhere(~np.isfinite(configurations))[0]
            value = float(configurations[row, column])
            raise NotFinite(f"row {row}", self.model.joints[column], value)
        return self.model.coordinates(configurations).T


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
        return _collide(self._pool, q, stop)

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


class _Exact:
    """The primitives of two links, and their memory."""

    def __init__(self, model: Model, pair: pin.CollisionPair) -> None:
        geometry = model.between(pair)
        self._pool = pin.GeometryPool(model.kinematics, geometry, 1)
        self._requests = _requests(geometry, self._pool.getGeometryData(0))
        self._margin = 0.0

    def hits(self, q: Array, margin: float, stop: bool) -> NDArray[np.bool_]:
        """Whether two are nearer than a margin [m] in each row, as `_Outer.hits`."""
        if margin != self._margin:
            for request in self._requests:
                request.security_margin = margin
            self._margin = margin
        return _collide(self._pool, q, stop)


def _collide(pool: pin.GeometryPool, q: Array, stop: bool) -> NDArray[np.bool_]:
    """Whether each row is a hit; after the first, if `stop`, the rest is not looked at."""
    if not len(q):
        return np.zeros(0, bool)
    return np.asarray(pin.computeCollisionsInParallel(1, pool, q.T, True, stop), bool)


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
