"""Why a motion takes as long as it does."""

from dataclasses import dataclass

import numpy as np

from .curve import Curve
from .plan import Plan
from .timing import timed

_STEP = 0.001  # [s]
_MOST = 100_000  # samples of a motion of hours
_AT_LIMIT = 0.95  # between grid points the accelerations on a bend fall a little short


@dataclass(frozen=True, slots=True)
class Limit:
    """A limit that held the motion back.

    Attributes:
        joint: Whose.
        kind: `speed` or `acceleration`.
        value: The limit [rad/s] or [rad/s2].
        seconds: How long the joint was at it [s].
    """

    joint: str
    kind: str
    value: float
    seconds: float


def limits_met(plan: Plan) -> list[Limit]:
    """Every limit that the motion runs at, the longest first."""
    step = max(_STEP, plan.duration / _MOST)
    times = np.arange(0.5 * step, plan.duration, step)
    if not times.size:
        return []
    found = []
    for kind, values, limits in (
        ("acceleration", plan.accelerations(times), plan.acceleration),
        ("speed", plan.velocities(times), plan.velocity),
    ):
        shares = np.mean(abs(values) >= _AT_LIMIT * limits, axis=0)
        found += [
            Limit(joint, kind, limit, float(share) * plan.duration)
            for joint, limit, share in zip(plan.joints, limits.tolist(), shares, strict=True)
            if share
        ]
    return sorted(found, key=lambda limit: -limit.seconds)


def straight_duration(plan: Plan) -> float:
    """What the straight line between the ends would take, if it were free [s]."""
    if np.array_equal(plan.origin, plan.goal):
        return 0.0
    line = Curve.through(np.array([plan.origin, plan.goal]), np.empty(0))
    profile = timed(line, plan.velocity, plan.acceleration)
    assert profile  # on a line always
    return profile.duration
