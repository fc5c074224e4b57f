"""Points around shapes, and the convex hull around several."""

from collections.abc import Sequence
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion.measures import FARTHEST

Array = NDArray[np.float64]

_THIN = 1e-4  # [m]
_SIDES = 8  # of the prism around a cylinder: the fewer, the quicker every check of the hull


def packages(urdf: Path) -> list[str]:
    """Where the meshes of a URDF are looked for, `package://` too: in all folders above it."""
    return [str(folder) for folder in urdf.resolve().parents]


def corners(shape: pin.GeometryObject) -> Array:
    """Points whose convex hull contains a shape, in the frame of its joint (P, 3) [m]."""
    geometry = shape.geometry
    if isinstance(geometry, coal.Cylinder):
        points = _prism(geometry)
    elif isinstance(geometry, coal.BVHModelBase):
        points = np.asarray(geometry.vertices())
    elif isinstance(geometry, coal.ConvexBase):
        points = np.asarray(geometry.points())
    else:
        points = _box(geometry)
    return _placed(points, shape)


def hull(shapes: Sequence[pin.GeometryObject]) -> coal.ConvexBase:
    """A convex shape around shapes on one joint, in the frame of the joint.

    It is their hull, at least `_THIN` thick, as coal crashes on a flat one. Where that has a point
    with more neighbours than coal can hold, it is the hull of the boxes around them.

    Raises:
        ValueError: A corner is not finite, or absurdly far off.
    """
    points = np.vstack([corners(shape) for shape in shapes])
    if not (abs(points) <= FARTHEST).all():
        raise ValueError(f"a corner is not at numbers up to {FARTHEST:g} m")
    try:
        return _convex(points)
    except RuntimeError:
        return _convex(np.vstack([_placed(_box(shape.geometry), shape) for shape in shapes]))


def _placed(points: Array, shape: pin.GeometryObject) -> Array:
    placed: Array = points @ shape.placement.rotation.T + shape.placement.translation
    return placed


def _convex(points: Array) -> coal.ConvexBase:
    middled = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(middled.T @ middled)
    for axis in axes.T[np.ptp(middled @ axes, axis=0) < _THIN]:
        points = np.vstack((points - 0.5 * _THIN * axis, points + 0.5 * _THIN * axis))
    vertices = coal.StdVec_Vec3s()
    for point in points:
        vertices.append(point)
    return coal.Convex.convexHull(vertices, True, "Qt")


def _prism(cylinder: coal.Cylinder) -> Array:
    angles = 2.0 * np.pi / _SIDES * np.arange(_SIDES)
    radius = cylinder.radius / np.cos(np.pi / _SIDES)
    ring = radius * np.column_stack((np.cos(angles), np.sin(angles), np.zeros(_SIDES)))
    top = np.array([0.0, 0.0, cylinder.halfLength])
    return np.vstack((ring - top, ring + top))


def _box(geometry: coal.CollisionGeometry) -> Array:
    """Corners of the box around any geometry."""
    geometry.computeLocalAABB()
    ends = np.array([geometry.aabb_local.min_, geometry.aabb_local.max_])
    x, y, z = np.meshgrid(*ends.T, indexing="ij")
    return np.column_stack((x.ravel(), y.ravel(), z.ravel()))
