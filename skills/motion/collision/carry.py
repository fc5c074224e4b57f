"""Taking hold of a body, and letting go of it."""

import dataclasses

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion.collision.scene import PlanningScene
from skills.motion.world import Body

from .bodies import frame_of, placed

Array = NDArray[np.float64]


def carried(model: PlanningScene, body: Body, link: str, positions: Array) -> Body:
    """A body where it is, but in the frame of another link, all actuated joints being at (A,).

    Raises:
        BadWorld: There is no such link.
    """
    kinematics, data = model.kinematics, model.kinematics.createData()
    frames = [frame_of(kinematics, name) for name in (body.link, link)]
    pin.framesForwardKinematics(kinematics, data, model.coordinates(positions[None, :])[:, 0])
    before, after = (data.oMf[frame] for frame in frames)
    x, y, z, *turn = pin.SE3ToXYZQUAT(after.actInv(before * placed(body))).tolist()
    a, b, c, d = (np.array(turn) / np.linalg.norm(turn)).tolist()
    return dataclasses.replace(body, position=(x, y, z), rotation=(a, b, c, d), link=link)
