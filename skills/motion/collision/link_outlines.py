"""Outlines of links and bodies, for drawings."""

from collections.abc import Iterator

import coal
import numpy as np
import pinocchio as pin

from skills.motion.arrays import Array
from skills.motion.robot_model.geometry import corners

from .planning_scene import PlanningScene

_ANGLES = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
_RING = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(len(_ANGLES))))


def convex_outlines(
    scene: PlanningScene, configurations: Array
) -> Iterator[list[tuple[str, Array]]]:
    """Yield points around each shape, in the root frame, for each configuration.

    Args:
        scene: The robot in its world.
        configurations: All actuated joints (N, A) [rad].

    Yields:
        For each shape, the name of its link or body, and the points whose convex hull is the shape
        (P, 3) [m].
    """
    data, kinematics = scene.kinematics.createData(), scene.kinematics
    shapes = [
        (link, shape.parentJoint, _points(shape))
        for link, shape in zip(scene.exact_links, scene.exact.geometryObjects, strict=True)
        if not isinstance(shape.geometry, coal.Halfspace)
    ]
    for q in scene.robot_model.coordinates(configurations).T:
        pin.forwardKinematics(kinematics, data, q)
        poses = [(pose.rotation.T, pose.translation) for pose in data.oMi]
        yield [(link, points @ poses[joint][0] + poses[joint][1]) for link, joint, points in shapes]


def _points(shape: pin.GeometryObject) -> Array:
    """Return points of a shape in its joint's frame (P, 3) [m]; circles in steps of 15 degrees."""
    geometry = shape.geometry
    if isinstance(geometry, coal.Sphere):
        heights = np.sin(_ANGLES)[:, None, None]
        points = geometry.radius * (np.sqrt(1.0 - heights**2) * _RING + heights * [0.0, 0.0, 1.0])
    elif isinstance(geometry, coal.Cylinder):
        ends = np.array([[[0.0, 0.0, -geometry.halfLength]], [[0.0, 0.0, geometry.halfLength]]])
        points = geometry.radius * _RING + ends
    else:
        return corners(shape)
    placed: Array = points.reshape(-1, 3) @ shape.placement.rotation.T + shape.placement.translation
    return placed
