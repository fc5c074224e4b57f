"""Checks the convex hulls of links for collision: many pairs at many configurations at once.

An arm in a room is always inside the hull of the room. Therefore triangles of such meshes are
checked where hulls are too close; see `PlanningScene.triangle_pairs`.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from skills.motion.arrays import Array, Mask

from .planning_scene import BroadPairs, PlanningScene

BATCH = 500  # configurations per call
# Largest number of pairs per call, because a call cannot be interrupted: a few milliseconds for
# hulls around boxes and cylinders, for hulls around meshes, and for triangles of most meshes.
MAX_PRIMITIVE_PAIRS, MAX_MESH_PAIRS, MAX_TRIANGLE_PAIRS = 8000, 2000, 20
# Smaller margins count as this one: at 0, coal misses overlaps of shapes with parallel axes [m].
LEAST_MARGIN = 1e-6
# Largest number of shapes for which a comparison of all boxes is faster than a tree of boxes.
FEW_SHAPES = 64
_FEW_PAIRS = 12  # largest number of pairs that are checked without boxes in a small scene
_ROWS = 32  # most rows between two checks of the deadline, if all boxes are compared


class BroadPhase:
    """Checks of hulls and hollow meshes, with their working memory.

    Axis-aligned boxes around the hulls show which hulls may be close to each other. In a small
    scene, all boxes are compared. In a large scene, a tree of boxes finds them. The floor has no
    bounded box, and coal does not see the box of a flat mesh, which has no volume. Therefore pairs
    with such a shape are checked one after another, beside a tree. If few pairs are checked at a
    time, they are also checked one after another, because boxes take time for every shape.

    A filter of spheres in NumPy in front of coal would not help. Measured on 27 November 2026 (AMD
    EPYC, 2 cores, NumPy 2.4, coal 3.0) for a Panda in a cage, with 101 pairs: forward kinematics
    and four spheres for each link took 100, 29, 18 and 17 us per configuration for batches of 1, 6,
    24 and 48. A tree of hulls took 8, 6, 6 and 7 us.

    Args:
        scene: The scene.
        boxes: True to use boxes; False if few pairs will be checked at a time.
        check: Callback between calls that may take milliseconds. It raises an exception to stop.
        shapes: The pairs to check. Default: `scene.hull_pairs`, and where these are too close,
            `scene.triangle_pairs`.
    """

    def __init__(
        self,
        scene: PlanningScene,
        boxes: bool,
        check: Callable[[], None],
        shapes: BroadPairs | None = None,
    ) -> None:
        self._check = check
        self._max_pairs = MAX_MESH_PAIRS if scene.volumes else MAX_PRIMITIVE_PAIRS
        self._triangles: BroadPhase | None = None
        if shapes:
            self._max_pairs = MAX_TRIANGLE_PAIRS
        elif scene.triangle_pairs:
            self._triangles = BroadPhase(scene, boxes, check, scene.triangle_pairs)
        shapes = shapes or scene.hull_pairs
        count, model, self._parts = len(scene.hull_pairs.ends), scene.kinematics, list[_Part]()
        if not boxes:
            self._parts.append(_Pool(model, shapes, pin.GeometryPool))
        elif len(shapes.geometry.geometryObjects) <= FEW_SHAPES and not _is_any_flat(shapes):
            self._parts.append(_AllBoxes(model, shapes))
        else:
            boxed = _boxed_pairs(shapes)
            tree = pin.BroadPhaseManagerPool_DynamicAABBTreeCollisionManager
            for kind, own in (tree, boxed), (pin.GeometryPool, ~boxed):
                if own.any():
                    part = shapes if own.all() else shapes.part(own)
                    self._parts.append(_Pool(model, part, kind))
        self._margins, self._margin, self._count = np.zeros(count), math.nan, count
        self._pairs = frozenset(range(count))

    def set_margins(self, pairs: frozenset[int], margins: Array) -> None:
        """Set the pairs to check, and the margin of each pair of the scene (P,) [m]."""
        self._activate(pairs)
        if margins is not self._margins:
            for part in self._parts:
                part.set_margins(margins)
            if self._triangles:
                self._triangles.set_margins(pairs, margins)
            self._margins, self._margin = margins, math.nan

    def set_margin(self, pairs: frozenset[int], margin: float) -> None:
        """Set the pairs to check, all with one margin [m]."""
        if margin != self._margin:
            self.set_margins(pairs, np.full(self._count, margin))
            self._margin = margin
        self._activate(pairs)

    def _activate(self, pairs: frozenset[int]) -> None:
        if pairs is self._pairs:
            return
        active = np.zeros(self._count, bool)
        active[list(pairs)] = True
        for part in self._parts:
            part.activate(active)
        if self._triangles:
            self._triangles._activate(pairs)
        self._pairs = pairs

    def collisions(self, q: Array, stop: bool) -> Mask:
        """Return True for each row in collision. With `stop`, rows after the first may be False."""
        hits = self.hull_collisions(q, stop)
        rows = hits.nonzero()[0]
        if self._triangles and rows.size:
            hits[rows] = self._triangles.collisions(q[rows], stop=False)
            if stop and not hits[rows[0]]:
                after = slice(rows[0] + 1, None)
                hits[after] = self.collisions(q[after], stop=False)
        return hits

    def hull_collisions(self, q: Array, stop: bool) -> Mask:
        """Return True for each row with hulls in collision. See `collisions`."""
        active = [part for part in self._parts if part.active]
        parts = [part.collisions(q, stop, self._rows, self._check) for part in active]
        if len(parts) == 1:
            return parts[0]
        return np.any(parts, axis=0) if parts else np.zeros(len(q), bool)

    def close_pairs(self, q: Array) -> frozenset[int]:
        """Return all checked pairs closer than the margin in some row (N, nq)."""
        if self._triangles:
            return self._triangles.close_pairs(q)
        active = [part for part in self._parts if part.active]
        return frozenset[int]().union(
            *(part.close_pairs(q, self._rows, self._check) for part in active)
        )

    @property
    def _rows(self) -> int:
        """Most rows per call."""
        return max(1, self._max_pairs // max(1, len(self._pairs)))


class _Part(ABC):
    """Some pairs of shapes, with the working memory of their checks.

    Attributes:
        active: True if some of the pairs are checked.

    Args:
        shapes: The shapes and these pairs of them.
        data: Working memory of the geometry.
    """

    def __init__(self, shapes: BroadPairs, data: pin.GeometryData) -> None:
        self._geometry, self._data, self._numbers = shapes.geometry, data, shapes.numbers
        self._ends, size = tuple(shapes.ends.T), len(shapes.geometry.geometryObjects)
        self._margins, self._checked = np.zeros((size, size)), np.zeros((size, size), bool)
        self._own = np.ones(len(shapes.numbers), bool)  # True for each pair that is checked
        self.active = True

    def set_margins(self, margins: Array) -> None:
        """Set the margin of each pair of the scene (P,) [m]."""
        self._margins[self._ends] = np.maximum(margins[self._numbers], LEAST_MARGIN)
        self._data.setSecurityMargins(self._geometry, self._margins, True, False)

    def activate(self, active: Mask) -> None:
        """Set the pairs of the scene that are checked (P,)."""
        self._checked[self._ends] = self._own = active[self._numbers]
        self._data.setActiveCollisionPairs(self._geometry, self._checked, True)
        self.active = bool(self._own.any())

    @abstractmethod
    def collisions(self, q: Array, stop: bool, rows: int, check: Callable[[], None]) -> Mask:
        """Return True for each row in collision. See `collide`."""

    def close_pairs(self, q: Array, rows: int, check: Callable[[], None]) -> list[int]:
        """Return all checked pairs closer than their margins in some row. See `collide`.

        Pairs that were found are not checked in later rows.
        """
        found = list[int]()
        try:
            self._find_close(q, found, rows, check)
        finally:
            for place in found:
                self._data.activateCollisionPair(place)
        return [int(self._numbers[place]) for place in found]

    @abstractmethod
    def _find_close(self, q: Array, found: list[int], rows: int, check: Callable[[], None]) -> None:
        """Deactivate the close pairs, and append their indices in the geometry to `found`."""


class _Pool(_Part):
    """Checks of many rows in one call, with a tree of boxes or without boxes."""

    def __init__(self, model: pin.Model, shapes: BroadPairs, kind: type[pin.GeometryPool]) -> None:
        self._pool = _pool(kind, model, shapes.geometry)
        super().__init__(shapes, self._pool.getGeometryData(0))

    # Many queries need no results, and in a large world they take milliseconds to list.
    @cached_property
    def _results(self) -> list[coal.CollisionResult]:
        return list(self._data.collisionResults)

    def collisions(self, q: Array, stop: bool, rows: int, check: Callable[[], None]) -> Mask:
        return collide(self._pool, q, stop, rows, check)

    def _find_close(self, q: Array, found: list[int], rows: int, check: Callable[[], None]) -> None:
        places = self._own.nonzero()[0].tolist()
        while len(q):
            check()
            results = [self._results[place] for place in places]
            for result in results:
                result.clear()  # a check with boxes does not reset the results of distant pairs
            pin.computeCollisionsInParallel(1, self._pool, q[:1].T, False)
            pairs = zip(places, results, strict=True)
            new = {place for place, result in pairs if result.isCollision()}
            found += new
            for place in new:
                self._data.deactivateCollisionPair(place)
            places = [place for place in places if place not in new]
            q = q[1:][self.collisions(q[1:], False, rows, check)]


class _AllBoxes(_Pool):
    """Compares the boxes of all shapes, row by row. For few shapes, it is faster than a tree.

    `pin.computeCollisions` does a row's three steps in one call, but takes longer to find out which
    kind of boxes it has. Few pairs are checked without boxes, because boxes take time for every
    shape.
    """

    def __init__(self, model: pin.Model, shapes: BroadPairs) -> None:
        super().__init__(model, shapes, pin.GeometryPool)
        geometry, data = shapes.geometry, self._data
        self._meshed = any(_is_mesh(shape.geometry) for shape in geometry.geometryObjects)
        self._placed = model, model.createData(), geometry, data
        self._boxes = pin.BroadPhaseManager_NaiveCollisionManager(model, geometry, data)
        self._first = pin.CollisionCallBackDefault(geometry, data, True)

    def collisions(self, q: Array, stop: bool, rows: int, check: Callable[[], None]) -> Mask:
        if np.count_nonzero(self._own) <= _FEW_PAIRS:
            return super().collisions(q, stop, rows, check)
        place, placed, first = pin.updateGeometryPlacements, self._placed, self._first
        update, collide = self._boxes.update, self._boxes.collide
        hits, period = np.zeros(len(q), bool), min(rows, _ROWS)
        for i, row in enumerate(q):
            if not i % period:
                check()
            place(*placed, row)
            update(False)
            collide(first)
            if first.collision:
                hits[i] = True
                if stop:
                    break
        return hits

    def _find_close(self, q: Array, found: list[int], rows: int, check: Callable[[], None]) -> None:
        if self._meshed:
            super()._find_close(q, found, rows, check)
            return
        # Each check finds one pair. To read the results of all pairs would take longer.
        first, period = self._first, min(rows, _ROWS)
        for i, row in enumerate(q):
            if not i % period:
                check()
            pin.updateGeometryPlacements(*self._placed, row)
            self._boxes.update(False)
            self._boxes.collide(first)
            while first.collision:
                found.append(first.collisionPairIndex)
                self._data.deactivateCollisionPair(found[-1])
                self._boxes.collide(first)


def _is_any_flat(shapes: BroadPairs) -> bool:
    objects = shapes.geometry.geometryObjects
    return not all(shape.geometry.aabb_local.volume() for shape in objects)


def _boxed_pairs(shapes: BroadPairs) -> Mask:
    """Return True for each pair of shapes that both have a bounded box with a volume (P,).

    A mesh counts as not boxed, because it is replaced after a tree was built; see `_pool`.
    """
    geometries = [shape.geometry for shape in shapes.geometry.geometryObjects]
    volumes = [0.0 if _is_mesh(each) else each.aabb_local.volume() for each in geometries]
    boxed = np.array([0.0 < volume < math.inf for volume in volumes], bool)
    first, second = shapes.ends.T
    both: Mask = boxed[first] & boxed[second]
    return both


def _pool(
    kind: type[pin.GeometryPool], model: pin.Model, geometry: pin.GeometryModel
) -> pin.GeometryPool:
    """Return a pool that shares the meshes of a geometry.

    A new pool copies its shapes, which takes 0.1 s for 400,000 triangles. Therefore it is built
    with empty meshes, which are then replaced. pinocchio reads a mesh at every check, but chooses
    the function for its type when the pool is built. So an empty mesh must have the same type.
    """
    shapes = list(geometry.geometryObjects)
    meshes = [place for place, shape in enumerate(shapes) if _is_mesh(shape.geometry)]
    empty = geometry.copy() if meshes else geometry
    for place in meshes:
        empty.geometryObjects[place].geometry = type(shapes[place].geometry)()
    pool = kind(model, empty, 1)
    for place in meshes:
        pool.getGeometryModel(0).geometryObjects[place] = shapes[place]
    return pool


def _is_mesh(shape: coal.CollisionGeometry) -> bool:
    return isinstance(shape, coal.BVHModelBase)


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
