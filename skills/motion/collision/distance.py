"""Computes the signed distance of two shapes: their gap, or minus their penetration depth.

The penetration depth is the length of the shortest translation that separates two shapes. For
meshes, coal computes only the depth of single triangles. A translation by the penetration depth of
the hulls always separates the shapes; for convex shapes it is the shortest one. For other shapes, a
search looks for a shorter translation, unless they have very many triangles. The computed depth is
therefore never too small.
"""

import math
from collections.abc import Callable, Iterable, Iterator

import coal
import numpy as np
import pinocchio as pin

from skills.motion.arrays import Array

from .containment import ContainmentChecker
from .planning_scene import PlanningScene

_RESOLUTION = 0.05  # relative error of a penetration depth
_FINEST = 1e-4  # smallest absolute error of the search [m]
_MAX_CONTACTS = 50  # number of contacts from which the plane of intersection is computed
# Largest number of triangles of two meshes for a search. With more, one collision check takes
# milliseconds.
_MANY_TRIANGLES = 20_000
_NO_SHIFT = np.zeros(3)
_DISTANCE, _COLLISION = coal.DistanceRequest(), coal.CollisionRequest()
_CONTACTS = coal.CollisionRequest()
_CONTACTS.enable_contact, _CONTACTS.num_max_contacts = True, _MAX_CONTACTS


class SignedDistance:
    """Measures distances between the shapes of a scene. Not thread-safe.

    Args:
        scene: The scene.
        data: Working memory for the scene's kinematics.
        placed: Working memory for the scene's exact geometry.
        containment: Finds shapes inside meshes of the same scene.
        check: Callback before calls that may take milliseconds. It raises an exception to stop.
    """

    def __init__(
        self,
        scene: PlanningScene,
        data: pin.Data,
        placed: pin.GeometryData,
        containment: ContainmentChecker,
        check: Callable[[], None],
    ) -> None:
        self._scene, self._data, self._placed = scene, data, placed
        self._containment, self._check = containment, check
        self._placed_hulls = pin.GeometryData(scene.hulls)
        self._hull_pairs = scene.hull_pairs_of_exact

    def nearest(self, q: Array) -> tuple[int, float]:
        """Return the deepest pair of `scene.exact`, or else the closest one, and its distance [m].

        Hulls are at least as close, or as deep, as their shapes. Therefore pairs are measured in
        the order of their hulls' distances, and most pairs need no measurement. Overlaps come
        first: for meshes, they take a hundredth of the time of a distance.

        Args:
            q: Coordinates of pinocchio (nq,).
        """
        bounds = self._hull_distances(q)
        order = np.argsort(bounds, kind="stable").tolist()
        for measure in (self._overlap, self._gap):
            found, nearest = -1, math.inf
            for k in order:
                if bounds[k] >= nearest or (measure == self._overlap and bounds[k] > 0.0):
                    break
                distance = measure(k, nearest)
                if distance < nearest:
                    found, nearest = k, distance
            if found >= 0:
                return found, nearest
        raise AssertionError("shapes have a finite distance")

    def below(self, q: Array, most: float, only: Iterable[int] | None = None) -> dict[int, float]:
        """Return the distances of links that are closer than a distance, by pair of `scene.hulls`.

        Args:
            q: Coordinates of pinocchio (nq,).
            most: The distance [m].
            only: The pairs to measure. Default: all.
        """
        near, found = self._hull_distances(q, only) < most, dict[int, float]()
        for k in np.flatnonzero(near).tolist():
            distance = self._overlap(k, most)
            if distance == math.inf and most > 0.0:
                distance = self._gap(k, most)
            pair = int(self._hull_pairs[k])
            if distance < found.get(pair, most):
                found[pair] = distance
        return found

    def _hull_distances(self, q: Array, only: Iterable[int] | None = None) -> Array:
        """Place all shapes, and return the distance of the hulls of each pair of `scene.exact`.

        If pairs of `scene.hulls` are given, the distances of all others are infinite.
        """
        scene, placed = self._scene, self._placed_hulls
        if only is None:
            pin.computeDistances(scene.kinematics, self._data, scene.hulls, placed, q)
            hulls = np.array([result.min_distance for result in placed.distanceResults])
        else:
            pin.updateGeometryPlacements(scene.kinematics, self._data, scene.hulls, placed, q)
            hulls = np.full(len(scene.ends(scene.hulls)), math.inf)
            for pair in only:
                hulls[pair] = pin.computeDistance(scene.hulls, placed, pair).min_distance
        pin.updateGeometryPlacements(scene.kinematics, self._data, scene.exact, self._placed)
        distances: Array = hulls[self._hull_pairs]
        return distances

    def _overlap(self, pair: int, nearest: float) -> float:
        """Return the signed distance if it is 0 or less, else infinity [m].

        The search ends early if the result cannot be less than `nearest`.
        """
        if pair not in self._containment.mesh_pairs:
            distance = self._gap(pair, nearest)
            return distance if distance <= 0.0 else math.inf
        if not self._overlaps(pair, _NO_SHIFT):
            return math.inf
        return -self._depth(pair, max(0.0, -nearest))

    def _gap(self, pair: int, nearest: float) -> float:
        """Return the distance [m]; the search ends early if it cannot be less than `nearest`."""
        self._check()
        ends, result = self._scene.exact.collisionPairs[pair], coal.DistanceResult()
        if ends.first in self._scene.volumes and pair not in self._containment.mesh_pairs:
            return self._height(ends.first, ends.second)
        if 0.0 < nearest < math.inf:  # coal would return a negative bound as its result
            result.min_distance = nearest
        coal.distance(*self._shape(ends.first), *self._shape(ends.second), _DISTANCE, result)
        return float(result.min_distance)

    def _height(self, mesh: int, floor: int) -> float:
        """Return the height of a mesh above the floor [m]; coal would measure only one triangle."""
        shapes, pose = self._scene.exact.geometryObjects, self._placed.oMg[mesh]
        half, points = shapes[floor].geometry, np.asarray(shapes[mesh].geometry.vertices())
        heights = points @ (pose.rotation.T @ half.n)
        return float(heights.min() + half.n @ pose.translation - half.d)

    def _depth(self, pair: int, enough: float) -> float:
        """Return a bound on the penetration depth [m]. The search ends at `enough` or less."""
        hulls = self._placed_hulls.distanceResults[int(self._hull_pairs[pair])]
        depth: float = max(0.0, -hulls.min_distance)
        directions = () if self._is_fine(pair) else self._exits(pair, np.array(hulls.normal))
        for direction in directions:
            depth = self._depth_along(pair, direction, depth, enough)
            if depth <= enough:
                break
        return depth

    def _is_fine(self, pair: int) -> bool:
        ends, volumes = self._scene.exact.collisionPairs[pair], self._scene.volumes
        counts = (volumes[i].triangle_count for i in (ends.first, ends.second) if i in volumes)
        return sum(counts) > _MANY_TRIANGLES

    def _exits(self, pair: int, hull_normal: Array) -> Iterator[Array]:
        """Yield likely shortest directions for the second shape to leave: unit vectors (3,).

        They are the separating direction of the hulls, and both normals of the plane in which the
        two surfaces intersect. The normals are best for shapes that only touch slightly.
        """
        yield hull_normal
        contacts = self._collide(pair, _NO_SHIFT, _CONTACTS).getContacts()
        points = np.array([contact.pos for contact in contacts]).reshape(-1, 3)
        if len(points):
            centred = points - points.mean(axis=0)
            normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
            yield normal
            yield -normal

    def _depth_along(self, pair: int, direction: Array, depth: float, enough: float) -> float:
        """Return the length of a translation that separates the shapes, at most `depth` [m].

        Moves the second shape, and finds the length by bisection.
        """
        if enough > 0.0 and not self._overlaps(pair, enough * direction):
            return enough
        near, far, middle = max(enough, _FINEST), depth, (1.0 - _RESOLUTION) * depth
        while far - near > max(_RESOLUTION * far, _FINEST):
            if self._overlaps(pair, middle * direction):
                near = middle
            else:
                far = middle
            middle = math.sqrt(near * far)
        return far

    def _overlaps(self, pair: int, shift: Array) -> bool:
        """Return True if the shapes overlap after the second one moves by a shift (3,) [m]."""
        hit = self._collide(pair, shift, _COLLISION).isCollision()
        return hit or self._containment.contained_after_shift(pair, shift)

    def _collide(
        self, pair: int, shift: Array, request: coal.CollisionRequest
    ) -> coal.CollisionResult:
        self._check()
        ends, result = self._scene.exact.collisionPairs[pair], coal.CollisionResult()
        coal.collide(*self._shape(ends.first), *self._shape(ends.second, shift), request, result)
        return result

    def _shape(
        self, index: int, shift: Array = _NO_SHIFT
    ) -> tuple[coal.CollisionGeometry, coal.Transform3s]:
        pose = self._placed.oMg[index]
        moved = coal.Transform3s(pose.rotation, pose.translation + shift)
        return self._scene.exact.geometryObjects[index].geometry, moved
