"""Does the arm touch anything? Many configurations at a time."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skills.motion.collision.scene import PlanningScene
from skills.motion.deadline import Deadline
from skills.motion.errors import NotFinite

from .batch import BATCH, Hulls, Primitives
from .depth import Depths
from .inside import Insides

Array = NDArray[np.float64]


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


class CollisionChecker:
    """Working memory to check a model's configurations; for one thread.

    What is asked of many configurations is asked of the hulls first, and of the primitives only
    where two hulls are too near, and only of the primitives of those two.

    Attributes:
        model: Whose.
        pairs: All of `PlanningScene.outer`, by number.
    """

    def __init__(self, model: PlanningScene) -> None:
        self.model = model
        self._deadline: Deadline | None = None
        self.pairs = frozenset(range(len(model.outer.collisionPairs)))
        self._outers = {
            (every, least): Hulls(model, self.pairs if every else frozenset(), self._check)
            for every in (True, False)
            for least in (True, False)
        }
        self._exact = dict[tuple[int, bool], Primitives]()
        self._data = model.kinematics.createData()
        self._shapes = model.exact.createData()
        self._insides = Insides(model, self._data, self._shapes)
        self._depths = Depths(model, self._data, self._shapes, self._insides)

    @contextmanager
    def within(self, deadline: Deadline) -> Iterator[None]:
        """Inside, all that looks at many configurations looks at a deadline too.

        Raises:
            PlanTimeout: The time is up, told by whatever is asked then.
        """
        self._deadline = deadline
        try:
            yield
        finally:
            self._deadline = None

    def _check(self) -> None:
        if self._deadline:
            self._deadline.check()

    def first_collision(
        self, configurations: ArrayLike, margin: float, pairs: frozenset[int] | None = None
    ) -> int | None:
        """Row of the first configuration where two links are nearer than a margin.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to be kept [m].
            pairs: Those of `PlanningScene.outer` to be looked at; None for all.

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

    def first_invalid_contact(
        self, configurations: Array, margin: float
    ) -> tuple[int, Contact] | None:
        """As `first_invalid`, and why."""
        hit = self.first_invalid(configurations, margin)
        if hit is None:
            return None
        nearest = self.nearest(configurations[hit])
        assert nearest
        return hit, nearest

    def first_invalid(self, configurations: Array, margin: float) -> int | None:
        """Row of the first configuration that can be no end of a motion.

        Unlike `first_collision` it sees what is inside a mesh.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to be kept [m].

        Raises:
            NotFinite: As `first_collision`.
        """
        hit = self.first_collision(configurations, margin)
        if not self._insides:
            return hit
        before = enumerate(self._coordinates(configurations[:hit]))
        return next((i for i, q in before if self._insides.pairs(q)), hit)

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
            margins: For each pair of `PlanningScene.outer`, at least `least` (P,) [m].
            least: Distance below which there is nothing more to be asked [m].
            pairs: Those to be looked at; the others may be at any distance.
            closely: Whether to ask the primitives too which rows are near; if not, some may only
                seem to be.

        Raises:
            NotFinite: As `first_collision`.
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
            pairs: Those of `PlanningScene.outer` to be looked at.
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
        close = [self._of(k, True) for k in outer.touching(here)]
        touch = any(pair.touch(here[0]) for pair in close)
        return first, touch or any(pair.hits(here, margin, stop=True)[0] for pair in close)

    def _near_by(self, q: Array, pair: int, margin: float, least: bool) -> NDArray[np.bool_]:
        """In which rows the hulls of a pair are nearer than a margin [m]."""
        pairs = frozenset((pair,))
        outer = self._outer(pairs, least)
        outer.hold(pairs, margin)
        return outer.hits(q, stop=False)

    def _outer(self, pairs: frozenset[int], least: bool) -> Hulls:
        """As turning many pairs on and off takes its time: one for all and one for some.

        Of each one for the least distance, which hardly ever changes.
        """
        return self._outers[pairs is self.pairs, least]

    def _of(self, pair: int, least: bool) -> Primitives:
        """Made when it is first needed; one for the least distance, as above."""
        checker = self._exact.get((pair, least))
        if checker is None:
            checker = Primitives(self.model, self.model.outer.collisionPairs[pair], self._check)
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
