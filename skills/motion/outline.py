"""Where the links are, to be drawn."""

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .model import Model
from .shapes import corners

Array = NDArray[np.float64]


def outlines(model: Model, configuration: Array) -> list[tuple[str, Array]]:
    """Link or body, and points whose convex hull is one of its shapes, all in the root frame.

    Args:
        model: The robot in its world.
        configuration: All actuated joints (A,) [rad].

    Returns:
        Names and points (P, 3) [m].
    """
    data = model.kinematics.createData()
    pin.forwardKinematics(model.kinematics, data, model.coordinates(configuration[None, :])[:, 0])
    drawn = []
    for index, shape in enumerate(model.exact.geometryObjects):
        if isinstance(shape.geometry, coal.Halfspace):
            continue
        place, points = data.oMi[shape.parentJoint], corners(shape)
        drawn.append(
            (model.link(model.exact, index), points @ place.rotation.T + place.translation)
        )
    return drawn
