"""What is wholly inside a mesh, of which coal sees the surface alone.

A link of the robot is solid. So is a mesh of the world that is closed; one that is not may be a
tray or a room with a door, so what is in it is free.

Only the ends of a motion need be looked at: between them nothing gets in but through the surface.
"""

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion.collision.scene import PlanningScene

Array = NDArray[np.float64]


class Insides:
    """Looks into the meshes of a model; for one thread.

    A shape is looked at by one point of it, as its surface is known to touch no mesh. So of a mesh
    of several pieces only one of them is seen.

    Args:
        model: Whose.
        data: Working memory of its joints.
        placed: And of its exact shapes.

    Attributes:
        meshed: Pairs of `PlanningScene.exact` that have a mesh, other than those with the floor.
    """

    def __init__(self, model: PlanningScene, data: pin.Data, placed: pin.GeometryData) -> None:
        self._model, self._data, self._placed = model, data, placed
        shapes = [shape.geometry for shape in model.exact.geometryObjects]
        seats = [
            (k, mesh, other)
            for k, pair in enumerate(model.exact.collisionPairs if model.solids else ())
            for mesh, other in ((pair.first, pair.second), (pair.second, pair.first))
            if mesh in model.solids and not isinstance(shapes[other], coal.Halfspace)
        ]
        self._pairs, self._meshes, self._others = np.array(seats, dtype=np.intp).reshape(-1, 3).T
        self.meshed = frozenset(self._pairs.tolist())
        self._points = np.array([_point(shape) for shape in shapes]).reshape(-1, 3)
        boxes = [(shape.aabb_local.min_, shape.aabb_local.max_) for shape in shapes]
        self._lower, self._upper = np.array(boxes).reshape(-1, 2, 3).swapaxes(0, 1)

    def __bool__(self) -> bool:
        """Whether there is any mesh to look into."""
        return bool(self._pairs.size)

    def pairs(self, q: Array) -> list[int]:
        """Pairs of `exact` of which one is inside the other, the joints at (nq,)."""
        if not self:
            return []
        model = self._model
        pin.updateGeometryPlacements(model.kinematics, self._data, model.exact, self._placed, q)
        places = [self._placed.oMg[i] for i in range(len(self._points))]
        turns = np.array([place.rotation for place in places])
        origins = np.array([place.translation for place in places])
        points = origins + np.einsum("gij,gj->gi", turns, self._points)
        apart = points[self._others] - origins[self._meshes]
        local = np.einsum("kji,kj->ki", turns[self._meshes], apart)
        lower, upper = self._lower[self._meshes], self._upper[self._meshes]
        rows = np.flatnonzero(((lower < local) & (local < upper)).all(axis=1))
        return [int(self._pairs[k]) for k in rows if self._encloses(int(self._meshes[k]), local[k])]

    def shifted(self, pair: int, shift: Array) -> bool:
        """Whether one of a pair would be inside the other if its second were moved (3,) [m].

        The joints are where `pairs` looked last.
        """
        second = self._model.exact.collisionPairs[pair].second
        for k in np.flatnonzero(self._pairs == pair):
            mesh, other = int(self._meshes[k]), int(self._others[k])
            point = self._placed.oMg[other].act(self._points[other])
            point = self._placed.oMg[mesh].actInv(point + (shift if other == second else -shift))
            within = (self._lower[mesh] < point) & (point < self._upper[mesh])
            if within.all() and self._encloses(mesh, point):
                return True
        return False

    def _encloses(self, mesh: int, point: Array) -> bool:
        """Whether a mesh is solid and has a point (3,) in it, in its frame [m]."""
        solid = self._model.solids[mesh]
        may_be_open = not self._model.is_body(self._model.exact, mesh)
        return (may_be_open or solid.closed) and solid.contains(point)


def _point(shape: coal.CollisionGeometry) -> Array:
    """One of a shape's own points, in its frame (3,) [m]."""
    if isinstance(shape, coal.BVHModelBase):
        return np.array(shape.vertices()[0])
    if isinstance(shape, coal.ConvexBase):
        return np.array(shape.points()[0])
    return np.zeros(3)
