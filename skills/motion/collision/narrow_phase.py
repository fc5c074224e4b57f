"""Checks the exact shapes of links for collision: primitives, and triangles of meshes."""

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from skills.motion.arrays import Array, Mask

from .broad_phase import BATCH, FEW_SHAPES, LEAST_MARGIN, collide
from .planning_scene import PlanningScene, ShapePairs, part_of

_CONTACT = coal.CollisionRequest()
_MAX_POOLS = 256  # kept, of 80 kB each; a world of 400 bodies can have thousands of close pairs


class NarrowPhase:
    """Checks of the exact shapes of links, with their working memory.

    Meshes are checked one configuration at a time, because one check may take milliseconds.
    Contacts are checked first: a check of a margin takes up to a thousand times as long. A pool of
    coal would copy the meshes, which takes longer than most checks.

    Args:
        scene: The scene.
        joints: Working memory for the scene's kinematics.
        placed: Working memory for the scene's exact geometry.
        check: Callback before calls that may take milliseconds. It raises an exception to stop.
    """

    def __init__(
        self,
        scene: PlanningScene,
        joints: pin.Data,
        placed: pin.GeometryData,
        check: Callable[[], None],
    ) -> None:
        self._scene, self._joints, self._placed, self._check = scene, joints, placed, check
        self._shapes = dict[int, ShapePairs]()  # exact shapes by pair of hulls
        self._pools = dict[int, pin.GeometryPool]()
        self._close = coal.CollisionRequest()

    # Loaded at their first use: large worlds take milliseconds for each of these.
    @cached_property
    def _boxes(self) -> Any:  # pinocchio has no common type for its managers of boxes
        if len(self._scene.exact.geometryObjects) <= FEW_SHAPES:
            kind = pin.BroadPhaseManager_NaiveCollisionManager
        else:
            kind = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager
        return kind(self._scene.kinematics, self._scene.exact, self._placed)

    @cached_property
    def _first(self) -> pin.CollisionCallBackDefault:
        return pin.CollisionCallBackDefault(self._scene.exact, self._placed, True)

    @cached_property
    def _placed_hulls(self) -> pin.GeometryData:
        return pin.GeometryData(self._scene.hulls)

    def place(self, q: Array) -> None:
        """Place the shapes as in a configuration (nq,), for `meshes_touch` and `are_close`."""
        model, joints, exact = self._scene.kinematics, self._joints, self._scene.exact
        pin.updateGeometryPlacements(model, joints, exact, self._placed, q)

    def touch(self, q: Array) -> bool:
        """Place the shapes like `place`. Return True if shapes touch.

        It may miss the floor and flat meshes.
        """
        self.place(q)
        boxes, first = self._boxes, self._first
        boxes.update(False)
        boxes.collide(first)
        return bool(first.collision)

    def meshes_touch(self, pairs: Iterable[int]) -> bool:
        """Return True if the meshes of a pair of `scene.hulls` touch."""
        return any(self._of(pair).meshed and self._collide(pair, _CONTACT) for pair in pairs)

    def are_close(self, pairs: Iterable[int], margin: float) -> bool:
        """Return True if the shapes of a pair are closer than a margin. Slow on contact.

        Args:
            pairs: Pairs of `scene.hulls`.
            margin: Distance to keep [m].
        """
        self._close.security_margin = max(margin, LEAST_MARGIN)
        return any(self._collide(pair, self._close) for pair in pairs)

    def collisions(self, q: Array, pair: int, margin: float, stop: bool) -> Mask:
        """Return True for each row with shapes closer than a margin. See `BroadPhase`.

        Args:
            q: Coordinates of pinocchio (N, nq).
            pair: Pair of `scene.hulls`.
            margin: Distance to keep [m].
            stop: True to stop at the first collision.
        """
        if not self._of(pair).meshed:
            return collide(self._pool(pair, margin), q, stop, BATCH, self._check)
        hits = np.zeros(len(q), bool)
        for i, row in enumerate(q):
            self.place(row)
            hits[i] = self.meshes_touch([pair]) or self.are_close([pair], margin)
            if stop and hits[i]:
                break
        return hits

    def _of(self, pair: int) -> ShapePairs:
        if pair not in self._shapes:
            self._shapes[pair] = self._scene.exact_pairs_of(pair)
        return self._shapes[pair]

    def _collide(self, pair: int, request: coal.CollisionRequest) -> bool:
        self._check()
        geometry, pairs, _ = self._of(pair)
        placed = self._placed
        if geometry is self._scene.hulls:
            model, placed = self._scene.kinematics, self._placed_hulls
            pin.updateGeometryPlacements(model, self._joints, geometry, placed)
        return any(pin.computeCollision(geometry, placed, k, request) for k in pairs)

    def _pool(self, pair: int, margin: float) -> pin.GeometryPool:
        if pair not in self._pools:
            if len(self._pools) == _MAX_POOLS:
                del self._pools[next(iter(self._pools))]
            geometry, pairs, _ = self._of(pair)
            part, _ = part_of(geometry, self._scene.ends(geometry)[pairs])
            self._pools[pair] = pin.GeometryPool(self._scene.kinematics, part, 1)
        for request in self._pools[pair].getGeometryData(0).collisionRequests:
            request.security_margin = max(margin, LEAST_MARGIN)
        return self._pools[pair]
