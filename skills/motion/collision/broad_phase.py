"""Checks of the hulls of links, many pairs at many configurations."""

import math
from collections.abc import Callable, Sequence
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from skills.motion.arrays import Array, Mask

from .planning_scene import PlanningScene, part_of

BATCH = 500  # configurations per call
# Largest number of pairs per call, because a call cannot be interrupted: a few milliseconds for
# hulls around boxes and cylinders, and for hulls around meshes.
MAX_PRIMITIVE_PAIRS, MAX_MESH_PAIRS = 8000, 2000
_TREE_PAIRS = 16  # smallest number of pairs for which a tree of boxes is faster


class BroadPhase:
    """Checks of hulls, with their working memory.

    A tree of axis-aligned boxes finds the hulls that are close to each other. The floor has no
    bounded box, and the box of a very thin body has no volume. Pairs with such a shape are checked
    one after another. If few pairs are checked at first, all pairs are checked in this way, because
    a tree takes time for every shape.

    A filter of spheres in NumPy in front of coal would not help. Measured on 27 November 2026 (AMD
    EPYC, 2 cores, NumPy 2.4, coal 3.0) for a Panda in a cage, with 101 pairs: forward kinematics
    and four spheres for each link took 100, 29, 18 and 17 us per configuration for batches of 1, 6,
    24 and 48. This tree of hulls took 8, 6, 6 and 7 us.

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
                part, numbers = part_of(scene.hulls, own), sorted(own)
                pool = kind(scene.kinematics, part, 1)
                data = pool.getGeometryData(0)
                self._pools.append((pool, own))
                self._places |= {k: (data, place) for place, k in enumerate(numbers)}
                for k in own - pairs:
                    data.deactivateCollisionPair(self._places[k][1])
                requests = repeatable_requests(part, data)
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
