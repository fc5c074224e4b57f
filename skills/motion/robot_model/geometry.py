"""Geometry of collision shapes: convex hulls, and the volume that a mesh encloses."""

from collections.abc import Sequence
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion.arrays import Array
from skills.motion.validation import MAX_MAGNITUDE

_MIN_THICKNESS = 1e-4  # smallest thickness of a hull, because coal crashes on a flat hull [m]
# Sides of the prism around a cylinder; fewer sides make every check of the hull faster.
_PRISM_SIDES = 8
_THIN = 1e-4  # radius of the capsule that stands for a line [m]
_SAME_VERTEX = 1e-6  # vertices are rounded to this share of the mesh's size
_UP, _IDENTITY = np.array([0.0, 0.0, 1.0]), coal.Transform3s.Identity()


def corners(shape: pin.GeometryObject) -> Array:
    """Return points whose convex hull contains a shape, in its joint's frame (P, 3) [m]."""
    geometry = shape.geometry
    if isinstance(geometry, coal.Cylinder):
        points = _prism(geometry)
    elif isinstance(geometry, coal.BVHModelBase):
        points = np.asarray(geometry.vertices())
    elif isinstance(geometry, coal.ConvexBase):
        points = np.asarray(geometry.points())
    else:
        points = _bounding_box(geometry)
    return _in_joint_frame(points, shape)


def convex_hull(shapes: Sequence[pin.GeometryObject]) -> coal.ConvexBase:
    """Return a convex shape that contains several shapes of one joint, in the joint's frame.

    The hull is at least 0.1 mm thick. If one of its points has too many neighbours for coal, the
    result is the hull of the shapes' bounding boxes.

    Raises:
        ValueError: A corner is not finite or further than `MAX_MAGNITUDE` from the origin.
    """
    points = np.vstack([corners(shape) for shape in shapes])
    if not (abs(points) <= MAX_MAGNITUDE).all():
        raise ValueError(
            f"a vertex is not finite, or more than {MAX_MAGNITUDE:g} m from the origin"
        )
    try:
        return _hull_of_points(points)
    except RuntimeError:
        boxes = [_in_joint_frame(_bounding_box(shape.geometry), shape) for shape in shapes]
        return _hull_of_points(np.vstack(boxes))


class EnclosedVolume:
    """The volume inside a triangle mesh.

    Most volumes are never used. Therefore the triangles are read when they are first needed.

    Args:
        mesh: The mesh.

    Attributes:
        triangle_count: Number of triangles.
    """

    def __init__(self, mesh: coal.BVHModelBase) -> None:
        self._mesh, self.triangle_count = mesh, int(mesh.num_tris)
        self._known: tuple[Array, bool] | None = None  # a point, and if it is inside

    @classmethod
    def of(cls, geometry: coal.CollisionGeometry) -> "EnclosedVolume | None":
        """Return the volume inside a mesh, or None if the geometry is a primitive."""
        return cls(geometry) if isinstance(geometry, coal.BVHModelBase) else None

    @cached_property
    def _points(self) -> Array:
        return np.array(self._mesh.vertices())

    @cached_property
    def _triangles(self) -> NDArray[np.intp]:
        # Coal has no function for all triangles.
        rows = map(self._mesh.tri_indices, range(self.triangle_count))
        indices = (row[i] for row in rows for i in range(3))
        return np.fromiter(indices, np.intp, 3 * self.triangle_count).reshape(-1, 3)

    @cached_property
    def _planes(self) -> tuple[Array, Array, Array]:
        """Normals, their dot products with a vertex, and half of the squared side lengths."""
        a, b, c = self._points[self._triangles.T]
        normals = np.cross(b - a, c - a)
        half_squares = np.array([0.5 * _dots(side, side) for side in (b - a, c - b, a - c)])
        return normals, _dots(a, normals), half_squares

    @cached_property
    def closed(self) -> bool:
        """True if every edge belongs to an even number of triangles."""
        counts, _ = self._edges
        return not (counts % 2).any()

    @cached_property
    def _edges(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The number of triangles at each edge, and the surplus of one direction of the edge.

        Vertices at one place are one vertex, mostly also if they differ in their last digits.
        `np.unique` of rows would take ten times as long.
        """
        same, size = np.zeros(len(self._points), np.intp), np.ptp(self._points, axis=0).max()
        for column in np.round(self._points / (_SAME_VERTEX * size or 1.0)).T:
            values, places = np.unique(column, return_inverse=True)
            _, same = np.unique(same * len(values) + places, return_inverse=True)
        begin = same[self._triangles]
        end = begin[:, [1, 2, 0]]
        turn = np.sign(end - begin).ravel()
        keys = (np.minimum(begin, end) * (same.max() + 1) + np.maximum(begin, end)).ravel()
        _, edge, counts = np.unique(keys[turn != 0], return_inverse=True, return_counts=True)
        return counts, np.bincount(edge, turn[turn != 0]).astype(np.intp)

    @cached_property
    def _is_consistent(self) -> bool:
        """True if the mesh is closed and every edge is used equally often in both directions."""
        return self.closed and not self._edges[1].any()

    def contains(self, point: Array) -> bool:
        """Return True if the mesh is closed and encloses a point (3,) [m].

        If the mesh is consistent and no triangle is between the point and a known one, the answer
        is the same. This is found much faster than the winding number of a fine mesh.
        """
        if not self.closed:
            return False
        known = self._known if self._is_consistent else None
        if known is None or not self._is_clear(point, known[0]):
            self._known = known = point, self.winds_around(point)
        return known[1]

    def _is_clear(self, a: Array, b: Array) -> bool:
        """Return True if the line between two points keeps 0.1 mm from the surface."""
        if not (length := float(np.linalg.norm(b - a))):
            return True
        turn = pin.Quaternion.FromTwoVectors(_UP, b - a).matrix()
        line, place = coal.Capsule(_THIN, length), coal.Transform3s(turn, 0.5 * (a + b))
        result = coal.CollisionResult()
        coal.collide(self._mesh, _IDENTITY, line, place, coal.CollisionRequest(), result)
        return not result.isCollision()

    def winds_around(self, point: Array) -> bool:
        """Return True if the surface winds around a point (3,) [m].

        The winding number of the surface around the point is the sum of the triangles' solid angles
        (A. Van Oosterom and J. Strackee, "The solid angle of a plane triangle", 1983). It is 2 in
        an overlap of two parts of a link, and 0 in a cavity.
        """
        offsets = self._points - point
        squares = _dots(offsets, offsets)
        la, lb, lc = np.sqrt(squares)[self._triangles.T]
        a, b, c = 0.5 * squares[self._triangles.T]
        normals, heights, half_squares = self._planes
        ab, bc, ca = np.array([a + b, b + c, c + a]) - half_squares  # dot products
        volume = heights - normals @ point
        rest = la * lb * lc + ab * lc + bc * la + ca * lb
        # The arctangents are half of the solid angles.
        return bool(abs(np.arctan2(volume, rest).sum()) > np.pi)


def _dots(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("fi,fi->f", a, b))


def _in_joint_frame(points: Array, shape: pin.GeometryObject) -> Array:
    placed: Array = points @ shape.placement.rotation.T + shape.placement.translation
    return placed


def _hull_of_points(points: Array) -> coal.ConvexBase:
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    for axis in axes.T[np.ptp(centred @ axes, axis=0) < _MIN_THICKNESS]:
        half = 0.5 * _MIN_THICKNESS * axis
        points = np.vstack((points - half, points + half))
    vertices = coal.StdVec_Vec3s()
    vertices.extend(points)
    return coal.Convex.convexHull(vertices, True, "Qt")


def _prism(cylinder: coal.Cylinder) -> Array:
    angles = 2.0 * np.pi / _PRISM_SIDES * np.arange(_PRISM_SIDES)
    radius = cylinder.radius / np.cos(np.pi / _PRISM_SIDES)
    ring = radius * np.column_stack((np.cos(angles), np.sin(angles), np.zeros(_PRISM_SIDES)))
    top = np.array([0.0, 0.0, cylinder.halfLength])
    return np.vstack((ring - top, ring + top))


def _bounding_box(geometry: coal.CollisionGeometry) -> Array:
    geometry.computeLocalAABB()
    ends = np.array([geometry.aabb_local.min_, geometry.aabb_local.max_])
    x, y, z = np.meshgrid(*ends.T, indexing="ij")
    return np.column_stack((x.ravel(), y.ravel(), z.ravel()))
