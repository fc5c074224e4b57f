"""Where the links are, to be drawn."""

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion.collision.shapes import corners

from .scene import PlanningScene

Array = NDArray[np.float64]

_TURNS = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
_RING = np.column_stack((np.cos(_TURNS), np.sin(_TURNS), np.zeros(len(_TURNS))))


def convex_outlines(scene: PlanningScene, configuration: Array) -> list[tuple[str, Array]]:
    """Link or body, and points whose convex hull is one of its shapes, all in the root frame.

    Args:
        scene: The robot in its world.
        configuration: All actuated joints (A,) [rad].

    Returns:
        Names and points (P, 3) [m].
    """
    data = scene.kinematics.createData()
    pin.forwardKinematics(scene.kinematics, data, scene.coordinates(configuration[None, :])[:, 0])
    drawn = []
    for index, shape in enumerate(scene.exact.geometryObjects):
        if isinstance(shape.geometry, coal.Halfspace):
            continue
        place = data.oMi[shape.parentJoint]
        points = _points(shape) @ place.rotation.T + place.translation
        drawn.append((scene.link(scene.exact, index), points))
    return drawn


def _points(shape: pin.GeometryObject) -> Array:
    """In the frame of its joint (P, 3); what is round, in many small steps."""
    geometry = shape.geometry
    if isinstance(geometry, coal.Sphere):
        heights = np.sin(_TURNS)[:, None, None]
        points = geometry.radius * (np.sqrt(1.0 - heights**2) * _RING + heights * [0.0, 0.0, 1.0])
    elif isinstance(geometry, coal.Cylinder):
        ends = np.array([[[0.0, 0.0, -geometry.halfLength]], [[0.0, 0.0, geometry.halfLength]]])
        points = geometry.radius * _RING + ends
    else:
        return corners(shape)
    placed: Array = points.reshape(-1, 3) @ shape.placement.rotation.T + shape.placement.translation
    return placed
