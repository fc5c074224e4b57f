"""The checker for all planners: the same arm and world, not padded, checked every millisecond."""

from itertools import combinations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skills.motion import Plan
from tests.bench.planners.reference.padded import Description

Array = NDArray[np.float64]
TICK = 0.001  # [s]


def ticks(plan: Plan | None) -> Array:
    """Return a plan's positions each millisecond and at its end (N, J) [rad]; none if no plan."""
    if plan is None:
        return np.empty((0, 1))
    return plan.sample(np.append(np.arange(0.0, plan.duration, TICK), plan.duration))


class ReferenceChecker:
    """Finds contacts from a URDF with pinocchio only, without code of our planner.

    Args:
        description: The arm in its world. Only its arm can move.
    """

    def __init__(self, description: Description) -> None:
        model = pin.buildModelFromXML(description.urdf)
        geometry = pin.buildGeomFromUrdfString(model, description.urdf, pin.GeometryType.COLLISION)
        links = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
        for i, j in combinations(range(len(links)), 2):
            if frozenset((links[i], links[j])) in description.checked:
                geometry.addCollisionPair(pin.CollisionPair(i, j))
        self._pool = pin.GeometryPool(model, geometry, 1)
        self._joints = [model.joints[model.getJointId(name)] for name in description.joints]
        self._size = model.nq

    def collides(self, rows: Array) -> bool:
        """Return True if anything touches at one of the arm's positions (N, J) [rad]."""
        q = np.empty((self._size, len(rows)), order="F")
        for joint, angles in zip(self._joints, rows.T, strict=True):
            # A continuous joint has the cosine and the sine of its angle as coordinates.
            own = angles if joint.nq == 1 else (np.cos(angles), np.sin(angles))
            q[joint.idx_q : joint.idx_q + joint.nq] = own
        return bool(np.any(pin.computeCollisionsInParallel(1, self._pool, q, True, True)))


def excess(rows: Array, velocity: Array, acceleration: Array) -> float:
    """Return the largest excess of a speed or acceleration over its limit, as a share of it.

    Rows are one tick apart. The first and the last are repeated: the arm rests before and after.
    """
    if len(rows) < 2:
        return -1.0
    speeds = np.diff(np.vstack((rows[:1], rows, rows[-1:])), axis=0) / TICK
    pushes = np.diff(speeds, axis=0) / TICK
    return float(max((abs(speeds) / velocity).max(), (abs(pushes) / acceleration).max())) - 1.0
