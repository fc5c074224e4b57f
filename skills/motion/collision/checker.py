"""Collision checks of many configurations at once, with coal.

Each check has two phases, as usual in collision checking. The broad phase compares the convex hulls
of links. The narrow phase compares the exact shapes of only those links with hulls closer than the
margin. In the broad phase, a hollow mesh of the world counts as a hull, although it is checked by
its triangles; see `PlanningScene.triangle_pairs`.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from skills.motion.arrays import Array, Mask
from skills.motion.deadline import Deadline
from skills.motion.errors import NotFinite

from .broad_phase import BATCH, FEW_SHAPES, BroadPhase
from .containment import ContainmentChecker
from .distance import SignedDistance
from .narrow_phase import NarrowPhase
from .planning_scene import PlanningScene


class Contact(NamedTuple):
    """The closest two links.

    Attributes:
        first: Name of one link or body, or `floor`.
        second: Name of the other link or body.
        distance: Distance between them [m]. If they overlap or one contains the other, it is minus
            the penetration depth; for meshes, minus an upper bound on the depth.
    """

    first: str
    second: str
    distance: float


class Proximity(NamedTuple):
    """Result of `CollisionChecker.proximity`.

    Attributes:
        collision: A row with two links closer than the least distance, or None if none was found.
        near: True for each row with two hulls closer than their margin (N,).
        pairs: All pairs of hulls that are closer than their margin in some row; valid if there is
            no collision.
    """

    collision: int | None
    near: Mask
    pairs: frozenset[int]


class CollisionChecker:
    """Checks configurations in a planning scene. Not thread-safe.

    Args:
        scene: The scene.

    Attributes:
        scene: The scene.
        pairs: Indices of all pairs of `scene.hulls`.
    """

    def __init__(self, scene: PlanningScene) -> None:
        self.scene = scene
        # A method as callback would be a reference cycle. The megabytes of an old scene would then
        # stay until Python's garbage collector runs.
        self._deadlines = list[Deadline]()
        self._check = partial(_check_all, self._deadlines)
        self.pairs = frozenset(range(len(scene.hulls.collisionPairs)))
        self._data = scene.kinematics.createData()

    def prepare(self) -> None:
        """Load everything that queries need. Otherwise the first query loads it."""
        for pairs in self.pairs, frozenset[int]():
            self._broad_phase(pairs)

    # Loaded at their first use: large worlds take milliseconds for each of these.
    @cached_property
    def _all_hulls(self) -> BroadPhase:
        return BroadPhase(self.scene, True, self._check)

    @cached_property
    def _some_hulls(self) -> BroadPhase:
        if len(self.scene.hulls.geometryObjects) <= FEW_SHAPES:
            return self._all_hulls
        return BroadPhase(self.scene, False, self._check)

    @cached_property
    def _placed(self) -> pin.GeometryData:
        return pin.GeometryData(self.scene.exact)

    @cached_property
    def _containment(self) -> ContainmentChecker:
        return ContainmentChecker(self.scene, self._data, self._placed, self._check)

    @cached_property
    def _distances(self) -> SignedDistance:
        return SignedDistance(self.scene, self._data, self._placed, self._containment, self._check)

    @cached_property
    def _narrow(self) -> NarrowPhase:
        return NarrowPhase(self.scene, self._data, self._placed, self._check)

    @contextmanager
    def within(self, deadline: Deadline) -> Iterator[None]:
        """Apply a deadline to all checks inside the `with` block.

        Raises:
            PlanTimeout: A check inside the block passes the deadline.
        """
        self._deadlines.append(deadline)
        try:
            yield
        finally:
            self._deadlines.pop()

    def first_collision(
        self, configurations: ArrayLike, margin: float, pairs: frozenset[int] | None = None
    ) -> int | None:
        """Return the first row with two links closer than a margin, or None.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to keep [m].
            pairs: Pairs of `scene.hulls` to check. Default: all.

        Raises:
            NotFinite: A position is NaN or infinite. pinocchio must not see it: its later answers
                would be wrong.
        """
        rows = np.asarray(configurations, dtype=np.float64)
        for begin in range(0, len(rows), BATCH):
            q = self._coordinates(rows[begin : begin + BATCH])
            row = self._first_collision(q, margin, self.pairs if pairs is None else pairs)
            if row is not None:
                return begin + row
        return None

    def collisions(self, configurations: Array, margin: float) -> Mask:
        """Return True for each configuration with two links closer than a margin (N,).

        Args:
            configurations: All actuated joints, at most `BATCH` rows (N, A) [rad].
            margin: Distance to keep [m].

        Raises:
            NotFinite: A position is NaN or infinite.
        """
        q, broad = self._coordinates(configurations), self._all_hulls
        broad.set_margin(self.pairs, margin)
        hits = broad.collisions(q, stop=False)
        for row in hits.nonzero()[0].tolist():
            hits[row] = self._collides(q[row], margin, self.pairs)
        return hits

    def first_invalid(self, configurations: Array, margin: float) -> int | None:
        """Return the first row that is not a valid start or end of a motion, or None.

        Unlike `first_collision`, it also finds shapes inside a mesh.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to keep [m].

        Raises:
            NotFinite: A position is NaN or infinite.
        """
        q, broad = self._coordinates(configurations), self._all_hulls
        broad.set_margin(self.pairs, margin)
        # A shape deep inside a solid mesh is in its hull, but may be far from its triangles.
        for row in broad.hull_collisions(q, stop=False).nonzero()[0].tolist():
            if self._collides(q[row], margin, self.pairs) or self._containment.pairs(q[row]):
                return int(row)
        return None

    def first_invalid_contact(
        self, configurations: Array, margin: float
    ) -> tuple[int, Contact] | None:
        """Return the row that `first_invalid` finds and its closest links, or None."""
        hit = self.first_invalid(configurations, margin)
        if hit is None:
            return None
        nearest = self.nearest(configurations[hit])
        assert nearest
        return hit, nearest

    def nearest(self, configuration: ArrayLike) -> Contact | None:
        """Return the closest two links that must not touch, or None if all links may touch.

        Args:
            configuration: All actuated joints (A,) [rad].
        """
        row, geometry = np.asarray(configuration, dtype=np.float64)[None, :], self.scene.exact
        if not len(geometry.collisionPairs):
            return None
        k, distance = self._distances.nearest(self._coordinates(row)[0])
        pair = geometry.collisionPairs[k]
        links = self.scene.exact_links
        return Contact(links[pair.first], links[pair.second], distance)

    def contacts(
        self, configuration: Array, margin: float, pairs: Iterable[int] | None = None
    ) -> dict[int, Contact]:
        """Return the links that are closer than a margin, by their pair of `scene.hulls`.

        Args:
            configuration: All actuated joints (A,) [rad].
            margin: Distance to keep [m].
            pairs: Pairs of `scene.hulls` to measure. Default: all.
        """
        (q,) = self._coordinates(configuration[None, :])
        distances = self._distances.below(q, margin, pairs)
        return {pair: self._contact(pair, distance) for pair, distance in distances.items()}

    def first_closer(
        self, configurations: Array, pair: int, least: float
    ) -> tuple[int, Contact] | None:
        """Return the first row in which two links are closer than a distance, and how close.

        Args:
            configurations: All actuated joints (N, A) [rad].
            pair: Pair of `scene.hulls`.
            least: The distance [m]. If negative, the links may overlap up to this depth.
        """
        q = self._coordinates(configurations)
        margin = max(least, 0.0)
        near = self._hulls_of_pair_near(q, pair, margin).nonzero()[0]
        near = near[self._narrow.collisions(q[near], pair, margin, stop=False)]
        for row in near.tolist():
            self._check()
            if closer := self._distances.below(q[row], least, [pair]):
                return row, self._contact(pair, closer[pair])
        return None

    def _contact(self, pair: int, distance: float) -> Contact:
        ends, links = self.scene.hulls.collisionPairs[pair], self.scene.hull_links
        return Contact(links[ends.first], links[ends.second], distance)

    def proximity(
        self, configurations: Array, margins: Array, least: float, pairs: frozenset[int]
    ) -> Proximity:
        """Find the configurations in which two hulls are closer than their margin.

        Of the rows with hulls closer than `least`, only the first one is checked for a collision.

        Args:
            configurations: All actuated joints, at most `BATCH` rows (N, A) [rad].
            margins: Margin of each pair of `scene.hulls`, at least `least` (P,) [m].
            least: Distance of shapes below which a pair counts as a collision [m].
            pairs: Pairs of `scene.hulls` to check.

        Raises:
            NotFinite: A position is NaN or infinite.
        """
        q, broad = self._coordinates(configurations), self._broad_phase(pairs)
        broad.set_margins(pairs, margins)
        near = broad.collisions(q, stop=False)
        rows = near.nonzero()[0]
        if not rows.size:
            return Proximity(None, near, frozenset())
        first = self._first_doubt(q[rows], least, pairs)
        if first is not None and self._collides(q[rows[first]], least, pairs):
            return Proximity(int(rows[first]), near, frozenset())
        broad.set_margins(pairs, margins)
        return Proximity(None, near, broad.close_pairs(q[rows]))

    def close_pairs(self, configurations: Array, margin: float) -> frozenset[int]:
        """Return the pairs with hulls closer than a margin [m] in some configuration (N, A)."""
        q, broad = self._coordinates(configurations), self._all_hulls
        broad.set_margin(self.pairs, margin)
        return broad.close_pairs(q)

    def hulls_near(self, configurations: Array, margin: float, pairs: frozenset[int]) -> Mask:
        """Return True for each configuration with hulls closer than a margin (N,).

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to keep [m].
            pairs: Pairs of `scene.hulls` to check.
        """
        broad = self._broad_phase(pairs)
        broad.set_margin(pairs, margin)
        return broad.collisions(self._coordinates(configurations), stop=False)

    def _first_collision(self, q: Array, margin: float, pairs: frozenset[int]) -> int | None:
        """Return the first row in collision.

        A doubt is a row with hulls closer than the margin. The search takes one call if all rows
        are free, and few calls if the first doubt is a collision.
        """
        first = self._first_doubt(q, margin, pairs)
        if first is None or self._collides(q[first], margin, pairs):
            return first
        after, hit = q[first + 1 :], None
        if not len(after):
            return None
        broad = self._broad_phase(pairs)
        doubtful = first + 1 + broad.collisions(after, stop=False).nonzero()[0]
        for k in sorted(broad.close_pairs(q[doubtful])):
            rows = doubtful[self._hulls_of_pair_near(q[doubtful], k, margin)]
            hits = self._narrow.collisions(q[rows], k, margin, stop=True)
            if hits.any():
                hit = int(rows[hits.argmax()])
                doubtful = doubtful[doubtful < hit]
        return hit

    def _first_doubt(self, q: Array, margin: float, pairs: frozenset[int]) -> int | None:
        """Return the first row with hulls closer than the margin, or None."""
        broad = self._broad_phase(pairs)
        broad.set_margin(pairs, margin)
        doubts = broad.collisions(q, stop=True).nonzero()[0]
        return int(doubts[0]) if doubts.size else None

    def _collides(self, doubt: Array, margin: float, pairs: frozenset[int]) -> bool:
        """Return True if a doubt (nq,) is a collision, after the broad phase got this margin."""
        self._check()
        broad, narrow = self._broad_phase(pairs), self._narrow
        if pairs is self.pairs:
            if narrow.touch(doubt):
                return True
            close = broad.close_pairs(doubt[None, :])
        else:
            close = broad.close_pairs(doubt[None, :])
            narrow.place(doubt)
            if narrow.meshes_touch(close):
                return True
        return narrow.are_close(close, margin)

    def _hulls_of_pair_near(self, q: Array, pair: int, margin: float) -> Mask:
        self._some_hulls.set_margin(frozenset((pair,)), margin)
        return self._some_hulls.collisions(q, stop=False)

    def _broad_phase(self, pairs: frozenset[int]) -> BroadPhase:
        return self._all_hulls if pairs is self.pairs else self._some_hulls

    def _coordinates(self, configurations: Array) -> Array:
        model = self.scene.robot_model
        if not np.isfinite(configurations).all():
            row, column = np.argwhere(~np.isfinite(configurations))[0]
            value = float(configurations[row, column])
            raise NotFinite(f"row {row}", model.joints[column], value)
        return model.coordinates(configurations).T


def _check_all(deadlines: list[Deadline]) -> None:
    for deadline in deadlines:
        deadline.check()
