"""Collision checks of many configurations at once, with coal.

Each check has two phases, as usual in collision checking. The broad phase compares the convex hulls
of links. The narrow phase compares the exact shapes of only those links with hulls closer than the
margin.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from skills.motion.arrays import Array, Mask
from skills.motion.deadline import Deadline
from skills.motion.errors import NotFinite

from .containment import ContainmentChecker
from .distance import SignedDistance
from .planning_scene import PlanningScene

BATCH = 500  # configurations per call
# Largest number of pairs per call, because a call cannot be interrupted: a few milliseconds for
# hulls around boxes and cylinders, and for hulls around meshes.
MAX_PRIMITIVE_PAIRS, MAX_MESH_PAIRS = 8000, 2000
_TREE_PAIRS = 16  # smallest number of pairs for which a tree of boxes is faster


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
        collision: First row with two links closer than the least distance, or None.
        near: True for each row with two links closer than their margin; valid if there is no
            collision (N,).
        pairs: All pairs of links that are closer than their margin in some row.
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
        self._deadline: Deadline | None = None
        self.pairs = frozenset(range(len(scene.hulls.collisionPairs)))
        self._broad = dict[tuple[bool, bool], BroadPhase]()
        self._narrow = dict[tuple[int, bool], NarrowPhase]()
        self._data = scene.kinematics.createData()

    def prepare(self) -> None:
        """Load everything that queries need. Otherwise the first query loads it."""
        for least in (True, False):
            self._broad_phase(self.pairs, least)

    # Loaded at their first use: large worlds take milliseconds for each of these.
    @cached_property
    def _placed(self) -> pin.GeometryData:
        return self.scene.exact.createData()

    @cached_property
    def _containment(self) -> ContainmentChecker:
        return ContainmentChecker(self.scene, self._data, self._placed)

    @cached_property
    def _distances(self) -> SignedDistance:
        return SignedDistance(self.scene, self._data, self._placed, self._containment)

    @cached_property
    def _touching(self) -> "TouchingShapes":
        return TouchingShapes(self.scene)

    @contextmanager
    def within(self, deadline: Deadline) -> Iterator[None]:
        """Apply a deadline to all checks inside the `with` block.

        Raises:
            PlanTimeout: A check inside the block passes the deadline.
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

    def first_invalid(self, configurations: Array, margin: float) -> int | None:
        """Return the first row that is not a valid start or end of a motion, or None.

        Unlike `first_collision`, it also finds shapes inside a mesh.

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to keep [m].

        Raises:
            NotFinite: A position is NaN or infinite.
        """
        hit = self.first_collision(configurations, margin)
        if not (self.scene.volumes and self._containment):
            return hit
        before = enumerate(self._coordinates(configurations[:hit]))
        return next((i for i, q in before if self._containment.pairs(q)), hit)

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
        names = [self.scene.link(geometry, i) for i in (pair.first, pair.second)]
        return Contact(names[0], names[1], distance)

    def proximity(
        self,
        configurations: Array,
        margins: Array,
        least: float,
        pairs: frozenset[int],
        exact: bool,
    ) -> Proximity:
        """Find the configurations in which two links are closer than their margin.

        Args:
            configurations: All actuated joints, at most `BATCH` rows (N, A) [rad].
            margins: Margin of each pair of `scene.hulls`, at least `least` (P,) [m].
            least: Distance below which a pair counts as a collision [m].
            pairs: Pairs of `scene.hulls` to check.
            exact: False to skip the narrow phase; rows with close hulls but distant shapes are then
                also near.

        Raises:
            NotFinite: A position is NaN or infinite.
        """
        q, wanted = self._coordinates(configurations), margins.tolist()
        broad = self._broad_phase(pairs, False)
        broad.set_margins(pairs, wanted)
        near = broad.collisions(q, stop=False)
        rows = near.nonzero()[0]
        if not rows.size:
            return Proximity(None, near, frozenset())
        if not exact:
            first, collides = self._first_doubt(q[rows], least, pairs)
            if collides:
                return Proximity(int(rows[first]), near, frozenset())
            return Proximity(None, near, broad.close_pairs(q[rows]))
        near, found, hit = np.zeros_like(near), set[int](), None
        for k in sorted(broad.close_pairs(q[rows])):
            doubtful = rows[self._hulls_of_pair_near(q[rows], k, wanted[k], False)]
            close = doubtful[
                self._narrow_phase(k, False).collisions(q[doubtful], wanted[k], stop=False)
            ]
            if close.size:
                near[close] = True
                found.add(k)
        if found:
            rows = near.nonzero()[0]
            hit = self._first_collision(q[rows], least, frozenset(found))
        return Proximity(None if hit is None else int(rows[hit]), near, frozenset(found))

    def close_pairs(self, configurations: Array, margin: float) -> frozenset[int]:
        """Return the pairs with hulls closer than a margin [m] in some configuration (N, A)."""
        q, broad = self._coordinates(configurations), self._broad_phase(self.pairs, True)
        broad.set_margin(self.pairs, margin)
        return broad.close_pairs(q[broad.collisions(q, stop=False)])

    def hulls_near(self, configurations: Array, margin: float, pairs: frozenset[int]) -> Mask:
        """Return True for each configuration with hulls closer than a margin (N,).

        Args:
            configurations: All actuated joints (N, A) [rad].
            margin: Distance to keep [m].
            pairs: Pairs of `scene.hulls` to check.
        """
        broad = self._broad_phase(pairs, True)
        broad.set_margin(pairs, margin)
        return broad.collisions(self._coordinates(configurations), stop=False)

    def _first_collision(self, q: Array, margin: float, pairs: frozenset[int]) -> int | None:
        """Return the first row in collision.

        A doubt is a row with hulls closer than the margin. The search takes one call if all rows
        are free, and few calls if the first doubt is a collision.
        """
        first, collides = self._first_doubt(q, margin, pairs)
        if collides:
            return first
        after, hit = q[first + 1 :], None
        if not len(after):
            return None
        broad = self._broad_phase(pairs, True)
        doubtful = first + 1 + broad.collisions(after, stop=False).nonzero()[0]
        for k in sorted(broad.close_pairs(q[doubtful])):
            rows = doubtful[self._hulls_of_pair_near(q[doubtful], k, margin, True)]
            hits = self._narrow_phase(k, True).collisions(q[rows], margin, stop=True)
            if hits.any():
                hit = int(rows[hits.argmax()])
                doubtful = doubtful[doubtful < hit]
        return hit

    def _first_doubt(self, q: Array, margin: float, pairs: frozenset[int]) -> tuple[int, bool]:
        """Return the index of the first doubtful configuration, and True if it collides.

        Without a doubtful configuration, the index is their number.
        """
        broad = self._broad_phase(pairs, True)
        broad.set_margin(pairs, margin)
        doubts = broad.collisions(q, stop=True).nonzero()[0]
        if not doubts.size:
            return len(q), False
        first = int(doubts[0])
        here = q[first : first + 1]
        self._check()
        # This finds contacts of any pair, so it decides only if all pairs are wanted.
        if pairs is self.pairs and self._touching.collides(here[0]):
            return first, True
        close = [self._narrow_phase(k, True) for k in broad.close_pairs_at(here)]
        touches = any(pair.meshes_touch(here[0]) for pair in close)
        collides = touches or any(pair.collisions(here, margin, stop=True)[0] for pair in close)
        return first, collides

    def _hulls_of_pair_near(self, q: Array, pair: int, margin: float, least: bool) -> Mask:
        pairs = frozenset((pair,))
        broad = self._broad_phase(pairs, least)
        broad.set_margin(pairs, margin)
        return broad.collisions(q, stop=False)

    def _broad_phase(self, pairs: frozenset[int], least: bool) -> "BroadPhase":
        # Switching many pairs on and off is slow. Therefore separate checkers serve all pairs and
        # chosen pairs, with margins and with the least distance.
        key = every, _ = pairs is self.pairs, least
        if key not in self._broad:
            chosen = self.pairs if every else frozenset[int]()
            self._broad[key] = BroadPhase(self.scene, chosen, self._check)
        return self._broad[key]

    def _narrow_phase(self, pair: int, least: bool) -> "NarrowPhase":
        checker = self._narrow.get((pair, least))
        if checker is None:
            checker = NarrowPhase(self.scene, self.scene.hulls.collisionPairs[pair], self._check)
            self._narrow[pair, least] = checker
        return checker

    def _coordinates(self, configurations: Array) -> Array:
        model = self.scene.robot_model
        if not np.isfinite(configurations).all():
            row, column = np.argwhere(~np.isfinite(configurations))[0]
            value = float(configurations[row, column])
            raise NotFinite(f"row {row}", model.joints[column], value)
        return model.coordinates(configurations).T


# Broad phase --------------------------------------------------------------------------------------


class BroadPhase:
    """Checks of hulls, with their working memory.

    A tree of axis-aligned boxes finds the hulls that are close to each other. The floor has no
    bounded box, and the box of a very thin body has no volume. Pairs with such a shape are checked
    one after another. If few pairs are checked at first, all pairs are checked in this way, because
    a tree takes time for every shape.

    Args:
        scene: The scene.
        pairs: Pairs of `scene.hulls` that are checked at first.
        check: Callback between calls that may take milliseconds. It raises an exception to stop.
    """

    def __init__(
        self, scene: PlanningScene, pairs: frozenset[int], check: Callable[[], None]
    ) -> None:
        self._check = check
        self._max_pairs = MAX_MESH_PAIRS if scene.volumes else MAX_PRIMITIVE_PAIRS
        boxed = _boxed_pairs(scene.hulls)
        boxed = boxed if len(boxed & pairs) >= _TREE_PAIRS else frozenset()
        every = frozenset(range(len(scene.hulls.collisionPairs)))
        kinds = pin.BroadPhaseManagerPool_DynamicAABBTreeCollisionManager, pin.GeometryPool
        self._pools, self._places = [], dict[int, tuple[pin.GeometryData, int]]()
        self._requests = dict[int, coal.CollisionRequest]()
        for kind, own in zip(kinds, (boxed, every - boxed), strict=True):
            if own:
                geometry, numbers = _part(scene.hulls, own), sorted(own)
                pool = kind(scene.kinematics, geometry, 1)
                data = pool.getGeometryData(0)
                self._pools.append((pool, own))
                self._places |= {k: (data, place) for place, k in enumerate(numbers)}
                for k in own - pairs:
                    data.deactivateCollisionPair(self._places[k][1])
                requests = repeatable_requests(geometry, data)
                self._requests |= dict(zip(numbers, requests, strict=True))
        self._pairs, self._margin = pairs, math.nan

    # Many queries need no results, and in a large world they take milliseconds to list.
    @cached_property
    def _results(self) -> dict[int, coal.CollisionResult]:
        return {k: data.collisionResults[place] for k, (data, place) in self._places.items()}

    def set_margins(self, pairs: frozenset[int], margins: Sequence[float]) -> None:
        """Set the pairs to check, each with its own margin (P,) [m]."""
        self._activate(pairs)
        for k in pairs:
            self._requests[k].security_margin = margins[k]
        self._margin = math.nan

    def set_margin(self, pairs: frozenset[int], margin: float) -> None:
        """Set the pairs to check, all with one margin [m]."""
        new = pairs - self._pairs if margin == self._margin else pairs
        self._activate(pairs)
        for k in new:
            self._requests[k].security_margin = margin
        self._margin = margin

    def _activate(self, pairs: frozenset[int]) -> None:
        if pairs is self._pairs:
            return
        for k in self._pairs - pairs:
            data, place = self._places[k]
            data.deactivateCollisionPair(place)
        for k in pairs - self._pairs:
            data, place = self._places[k]
            data.activateCollisionPair(place)
        self._pairs = pairs

    def collisions(self, q: Array, stop: bool) -> Mask:
        """Return True for each row in collision. With `stop`, rows after the first may be False."""
        rows = max(1, self._max_pairs // max(1, len(self._pairs)))
        active = [pool for pool, own in self._pools if not own.isdisjoint(self._pairs)]
        parts = [collide(pool, q, stop, rows, self._check) for pool in active]
        if len(parts) == 1:
            return parts[0]
        return np.logical_or(*parts) if parts else np.zeros(len(q), bool)

    def close_pairs_at(self, q: Array) -> list[int]:
        """Return all pairs closer than the margin in one row (1, nq), which has at least one."""
        if len(self._pairs) == 1:
            return list(self._pairs)
        for k in self._pairs:
            self._results[k].clear()  # a tree does not reset the results of distant pairs
        for pool, own in self._pools:
            if not own.isdisjoint(self._pairs):
                pin.computeCollisionsInParallel(1, pool, q.T, False)
        return [k for k in sorted(self._pairs) if self._results[k].isCollision()]

    def close_pairs(self, q: Array) -> frozenset[int]:
        """Return all pairs closer than the margin in some row (N, nq). Each row has such a pair."""
        pairs = self._pairs
        while len(q):
            left = self._pairs.difference(self.close_pairs_at(q[:1]))
            self._activate(left)
            if not left:
                break
            q = q[1:][self.collisions(q[1:], stop=False)]
        found = pairs - self._pairs
        self._activate(pairs)
        return found


def _part(geometry: pin.GeometryModel, pairs: frozenset[int]) -> pin.GeometryModel:
    """Return a geometry of some of the pairs, in the same order, and only their shapes."""
    ends = [geometry.collisionPairs[k] for k in pairs]
    used = sorted({pair.first for pair in ends} | {pair.second for pair in ends})
    part, place = pin.GeometryModel(), {shape: i for i, shape in enumerate(used)}
    for shape in used:
        part.addGeometryObject(geometry.geometryObjects[shape])
    checked = np.zeros((len(used), len(used)), bool)
    for pair in ends:
        checked[place[pair.first], place[pair.second]] = True
    part.setCollisionPairs(checked, True)
    return part


def _boxed_pairs(geometry: pin.GeometryModel) -> frozenset[int]:
    """Return the pairs of shapes that both have a bounded box with a volume."""
    volumes = [shape.geometry.aabb_local.volume() for shape in geometry.geometryObjects]
    boxed = [0.0 < volume < math.inf for volume in volumes]
    pairs = enumerate(geometry.collisionPairs)
    return frozenset(k for k, pair in pairs if boxed[pair.first] and boxed[pair.second])


def collide(
    pool: pin.GeometryPool, q: Array, stop: bool, rows: int, check: Callable[[], None]
) -> Mask:
    """Return True for each row in collision. With `stop`, rows after the first may be False.

    Args:
        pool: Geometry to check.
        q: Coordinates (N, nq).
        stop: True to stop at the first collision.
        rows: Most rows per call.
        check: Callback before each call. It raises an exception to stop.
    """
    if 0 < len(q) <= rows:
        check()
        return np.asarray(pin.computeCollisionsInParallel(1, pool, q.T, True, stop), bool)
    hits = np.zeros(len(q), bool)
    for begin in range(0, len(q), rows):
        part = slice(begin, begin + rows)
        hits[part] = collide(pool, q[part], stop, rows, check)
        if stop and hits[part].any():
            break
    return hits


def repeatable_requests(
    geometry: pin.GeometryModel, data: pin.GeometryData
) -> list[coal.CollisionRequest]:
    """Return the request of each pair. Its settings make answers independent of earlier checks."""
    shapes, guess = geometry.geometryObjects, coal.GJKInitialGuess
    meshed = [isinstance(shape.geometry, coal.BVHModelBase) for shape in shapes]
    requests = list(data.collisionRequests)
    for request, pair in zip(requests, geometry.collisionPairs, strict=True):
        is_mesh = meshed[pair.first] or meshed[pair.second]
        request.gjk_initial_guess = guess.DefaultGuess if is_mesh else guess.BoundingVolumeGuess
    return requests


# Narrow phase -------------------------------------------------------------------------------------


class TouchingShapes:
    """Detects contacts of exact shapes. Holds its buffers.

    It is faster than a search for links closer than a margin.
    """

    def __init__(self, scene: PlanningScene) -> None:
        self._kinematics, self._data = scene.kinematics, scene.kinematics.createData()
        self._placed = scene.exact.createData()
        repeatable_requests(scene.exact, self._placed)
        kind = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager
        self._tree = kind(scene.kinematics, scene.exact, self._placed)

    def collides(self, q: Array) -> bool:
        """Return True if shapes with a bounded box touch in a configuration (nq,)."""
        return bool(pin.computeCollisions(self._kinematics, self._data, self._tree, q, True))


class NarrowPhase:
    """Checks of the exact shapes of two links, with their working memory.

    Meshes are checked one configuration at a time, because one check may take milliseconds.
    Contacts are checked first: a check of a margin takes up to a thousand times as long. A pool of
    coal would copy the meshes, which takes longer than most checks.
    """

    def __init__(
        self, scene: PlanningScene, pair: pin.CollisionPair, check: Callable[[], None]
    ) -> None:
        self._kinematics, self._check = scene.kinematics, check
        self._geometry = scene.exact_pairs_of(pair)
        shapes = [shape.geometry for shape in self._geometry.geometryObjects]
        self._meshed = any(isinstance(shape, coal.BVHModelBase) for shape in shapes)
        if self._meshed:
            self._data, self._touching = self._kinematics.createData(), self._geometry.createData()
            self._near = near = self._geometry.createData()
            repeatable_requests(self._geometry, self._touching)
        else:
            self._pool = pin.GeometryPool(self._kinematics, self._geometry, 1)
            near = self._pool.getGeometryData(0)
        self._requests, self._margin = repeatable_requests(self._geometry, near), 0.0

    def collisions(self, q: Array, margin: float, stop: bool) -> Mask:
        """Return True for each row with shapes closer than a margin [m]. See `BroadPhase`."""
        if margin != self._margin:
            for request in self._requests:
                request.security_margin = margin
            self._margin = margin
        if not self._meshed:
            return collide(self._pool, q, stop, BATCH, self._check)
        hits = np.zeros(len(q), bool)
        for i, row in enumerate(q):
            touches = self._collides(row, self._touching)
            hits[i] = touches or (margin > 0.0 and self._collides(row, self._near))
            if stop and hits[i]:
                break
        return hits

    def meshes_touch(self, q: Array) -> bool:
        """Return True if meshes touch in one row (nq,). False if the links have no meshes."""
        return self._meshed and self._collides(q, self._touching)

    def _collides(self, q: Array, placed: pin.GeometryData) -> bool:
        self._check()
        model, data, geometry = self._kinematics, self._data, self._geometry
        return bool(pin.computeCollisions(model, data, geometry, placed, q, True))
