"""The common judge: the same arm and world, not grown, looked at every millisecond."""

from itertools import combinations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion import Plan
from tests.bench.planners.padded import Description

Array = NDArray[np.float64]
TICK = 0.001  # [s]


def ticks(plan: Plan | None) -> Array:
    """Its positions each millisecond, and where it ends (N, J) [rad]; none of what is no plan."""
    if plan is None:
        return np.empty((0, 1))
    return plan.sample(np.append(np.arange(0.0, plan.duration, TICK), plan.duration))


class Judge:
    """Looks for contacts with pinocchio alone, from a URDF, nothing of our planner's between.

    Args:
        description: Of the arm in its world, only its arm movable.
    """

    def __init__(self, description: Description) -> None:
        model = pin.buildModelFromXML(description.urdf)
        geometry = pin.buildGeomFromUrdfString(model, description.urdf, pin.GeometryType.COLLISION)
        links = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
        for i, j in combinations(range(len(links)), 2):
            if frozenset((links[i], links[j])) in description.checked:
                geometry.addCollisionPair(pin.CollisionPair(i, j))
        self._pool = pin.GeometryPool(model, geometry, 1)
        order = [model.joints[model.getJointId(name)].idx_q for name in description.joints]
        self._order = np.argsort(order)

    def collides(self, rows: Array) -> bool:
        """Whether anything touches at any of the arm's positions (N, J) [rad]."""
        q = np.asfortranarray(rows[:, self._order].T)
        return bool(np.any(pin.computeCollisionsInParallel(1, self._pool, q, True, True)))


def excess(rows: Array, velocity: Array, acceleration: Array) -> float:
    """Largest speed or acceleration over its limit between positions a tick apart, less 1.

    The first and the last row are repeated, as the arm stands before and after.
    """
    if len(rows) < 2:
        return -1.0
    speeds = np.diff(np.vstack((rows[:1], rows, rows[-1:])), axis=0) / TICK
    pushes = np.diff(speeds, axis=0) / TICK
    return float(max((abs(speeds) / velocity).max(), (abs(pushes) / acceleration).max())) - 1.0
