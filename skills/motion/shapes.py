"""Points around shapes, and the convex hull around several."""

from collections.abc import Iterable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
    placed: Array = points @ shape.placement.rotation.T + shape.placement.translation
    return placed


def hull(shapes: Iterable[pin.GeometryObject]) -> coal.ConvexBase:
    """The convex hull around shapes on one joint, in the frame of the joint."""
    points = coal.StdVec_Vec3s()
    for point in np.vstack([corners(shape) for shape in shapes]):
        points.append(point)
    return coal.Convex.convexHull(points, True, "Qt")


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
