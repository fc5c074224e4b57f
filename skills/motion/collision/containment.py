"""Detects shapes that are completely inside a mesh, where coal finds no contact with its surface.

Links of the robot and closed meshes of the world are solid. An open mesh of the world may be a tray
or a room with a door, so its inside is free.

Only the ends of a motion need this check: between them, a shape cannot get inside without a contact
with the surface.
"""

from collections.abc import Callable

import coal
import numpy as np
import pinocchio as pin

from skills.motion.arrays import Array

from .planning_scene import PlanningScene


class ContainmentChecker:
    """Finds shapes inside meshes of a scene. Not thread-safe.

    The check uses only one point of each shape. This is enough if no surfaces touch, except for a
    mesh that consists of several parts: only one part is then checked.

    Args:
        scene: The scene.
        data: Working memory for the scene's kinematics.
        placed: Working memory for the scene's exact geometry.
        check: Callback before calls that may take milliseconds. It raises an exception to stop.

    Attributes:
        mesh_pairs: Pairs of `scene.exact` with a mesh, except those with the floor.
    """

    def __init__(
        self,
        scene: PlanningScene,
        data: pin.Data,
        placed: pin.GeometryData,
        check: Callable[[], None],
    ) -> None:
        self._scene, self._data, self._placed, self._check = scene, data, placed, check
        shapes = [shape.geometry for shape in scene.exact.geometryObjects]
        ends, count = scene.ends(scene.exact), len(shapes)
        solid = np.isin(np.arange(count), list(scene.volumes))
        bounded = np.array([not isinstance(shape, coal.Halfspace) for shape in shapes], bool)
        meshes, others = np.hstack((ends, ends[:, ::-1])).reshape(-1, 2).T
        rows = (solid[meshes] & bounded[others]).nonzero()[0]
        self._pairs, self._meshes, self._others = rows // 2, meshes[rows], others[rows]
        self.mesh_pairs = frozenset(self._pairs.tolist())
        self._points = np.array([_point_of(shape) for shape in shapes]).reshape(-1, 3)
        boxes = [(shape.aabb_local.min_, shape.aabb_local.max_) for shape in shapes]
        self._lower, self._upper = np.array(boxes).reshape(-1, 2, 3).swapaxes(0, 1)

    def __bool__(self) -> bool:
        """Return True if the scene has meshes to check."""
        return bool(self._pairs.size)

    def pairs(self, q: Array) -> list[int]:
        """Return the pairs of `scene.exact` in which one shape is inside the other.

        Args:
            q: Coordinates of pinocchio (nq,).
        """
        if not self:
            return []
        scene = self._scene
        pin.updateGeometryPlacements(scene.kinematics, self._data, scene.exact, self._placed, q)
        poses = np.array([pose.homogeneous for pose in self._placed.oMg.tolist()])
        rotations, origins = poses[:, :3, :3], poses[:, :3, 3]
        points = origins + np.einsum("gij,gj->gi", rotations, self._points)
        offsets = points[self._others] - origins[self._meshes]
        local = np.einsum("kji,kj->ki", rotations[self._meshes], offsets)
        lower, upper = self._lower[self._meshes], self._upper[self._meshes]
        rows = np.flatnonzero(((lower < local) & (local < upper)).all(axis=1))
        return [int(self._pairs[k]) for k in rows if self._contains(int(self._meshes[k]), local[k])]

    def contained_after_shift(self, pair: int, shift: Array) -> bool:
        """Return True if one shape of a pair is inside the other after a shift of the second one.

        The joints are at the coordinates of the last call of `pairs` or of pinocchio.

        Args:
            pair: Index in `scene.exact`.
            shift: Motion of the second shape (3,) [m].
        """
        second = self._scene.exact.collisionPairs[pair].second
        for k in np.flatnonzero(self._pairs == pair):
            mesh, other = int(self._meshes[k]), int(self._others[k])
            point = self._placed.oMg[other].act(self._points[other])
            point = self._placed.oMg[mesh].actInv(point + (shift if other == second else -shift))
            in_box = (self._lower[mesh] < point) & (point < self._upper[mesh])
            if in_box.all() and self._contains(mesh, point):
                return True
        return False

    def _contains(self, mesh: int, point: Array) -> bool:
        """Return True if a mesh is solid and contains a point in its frame (3,) [m]."""
        self._check()
        volume = self._scene.volumes[mesh]
        if self._scene.is_body(self._scene.exact_links[mesh]):
            return volume.contains(point)
        return volume.winds_around(point)


def _point_of(shape: coal.CollisionGeometry) -> Array:
    """Return one point of a shape, in its frame (3,) [m]."""
    if isinstance(shape, coal.BVHModelBase):
        return np.array(shape.vertices()[0])
    if isinstance(shape, coal.ConvexBase):
        return np.array(shape.points()[0])
    return np.zeros(3)
