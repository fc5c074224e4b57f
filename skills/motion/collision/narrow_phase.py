"""Checks of exact shapes: primitives, and the triangles of meshes."""

from collections.abc import Callable

import coal
import numpy as np
import pinocchio as pin

from skills.motion.arrays import Array, Mask

from .broad_phase import BATCH, collide, repeatable_requests
from .planning_scene import PlanningScene


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
        if not self._meshed:
            self._set_margin(margin)
            return collide(self._pool, q, stop, BATCH, self._check)
        hits = np.zeros(len(q), bool)
        for i, row in enumerate(q):
            hits[i] = self.meshes_touch(row) or (margin > 0.0 and self.are_close(row, margin))
            if stop and hits[i]:
                break
        return hits

    def are_close(self, q: Array, margin: float) -> bool:
        """Return True if shapes are closer than a margin [m] in one row (nq,). Slow on contact."""
        if not self._meshed:
            return bool(self.collisions(q[None, :], margin, stop=True)[0])
        self._set_margin(margin)
        return self._collides(q, self._near)

    def meshes_touch(self, q: Array) -> bool:
        """Return True if meshes touch in one row (nq,). False if the links have no meshes."""
        return self._meshed and self._collides(q, self._touching)

    def _set_margin(self, margin: float) -> None:
        if margin != self._margin:
            for request in self._requests:
                request.security_margin = margin
            self._margin = margin

    def _collides(self, q: Array, placed: pin.GeometryData) -> bool:
        self._check()
        model, data, geometry = self._kinematics, self._data, self._geometry
        return bool(pin.computeCollisions(model, data, geometry, placed, q, True))
