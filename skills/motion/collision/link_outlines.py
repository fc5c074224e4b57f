"""Outlines of links and bodies, for drawings."""

import coal
import numpy as np
import pinocchio as pin

from skills.motion.arrays import Array
from skills.motion.robot_model.geometry import corners

from .planning_scene import PlanningScene

_ANGLES = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
_RING = np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(len(_ANGLES))))


def convex_outlines(scene: PlanningScene, configuration: Array) -> list[tuple[str, Array]]:
    """Return points around each shape, in the root frame.

    Args:
        scene: The robot in its world.
        configuration: All actuated joints (A,) [rad].

    Returns:
        For each shape, the name of its link or body, and the points whose convex hull is the shape
        (P, 3) [m].
    """
    data, model = scene.kinematics.createData(), scene.robot_model
    pin.forwardKinematics(scene.kinematics, data, model.coordinates(configuration[None, :])[:, 0])
    outlines = []
    for index, shape in enumerate(scene.exact.geometryObjects):
        if isinstance(shape.geometry, coal.Halfspace):
            continue
        pose = data.oMi[shape.parentJoint]
        points = _points(shape) @ pose.rotation.T + pose.translation
        outlines.append((scene.exact_links[index], points))
    return outlines


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
