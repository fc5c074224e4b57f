"""Why a motion takes as long as it does."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.motion.plan import Plan

from .timing import straight

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_STEP = 0.001  # [s]
_MOST = 100_000  # samples of a motion of hours
_NEAR = 0.999  # of a limit: every motion keeps its limits to a thousandth


@dataclass(frozen=True, slots=True)
class Limit:
    """A limit that held the motion back.

    Attributes:
        joint: Whose.
        kind: `speed` or `acceleration`.
        value: The limit [rad/s] or [rad/s2].
        seconds: How long it held the motion back [s].
    """

    joint: str
    kind: str
    value: float
    seconds: float


def limits_met(plan: Plan) -> list[Limit]:
    """Every limit that held the motion back, the longest first.

    A speed limit does so while the joint is at it. An acceleration limit does so from one knot of
    the time law to the next where the joint meets it at one of them, as there the push on s, which
    is constant in between, can be no harder; and where no limit is met, but this one between the
    next two knots: with a harder push now, the joint would break it there.
    """
    step = max(_STEP, plan.duration / _MOST)
    times = np.arange(0.5 * step, plan.duration, step)
    if not times.size:
        return []
    here = np.searchsorted(plan.profile.times, times, side="right") - 1
    strains = _strains(plan)
    slowed = _hardest(plan, strains)
    met = strains >= _NEAR * slowed
    fast = abs(plan.velocities(times)) >= _NEAR * np.sqrt(slowed[here]) * plan.velocity
    ahead = np.vstack((met[1:], np.zeros_like(met[:1]))) & ~met.any(axis=1, keepdims=True)
    pushed = (met[here] & ~fast) | (ahead[here] & ~fast.any(axis=1, keepdims=True))
    found = [
        *_limits(plan, "acceleration", plan.acceleration, pushed),
        *_limits(plan, "speed", plan.velocity, fast),
    ]
    return sorted(found, key=lambda limit: -limit.seconds)


def _strains(plan: Plan) -> Array:
    """Largest acceleration over its limit from each knot to the next, at one of them (K, J)."""
    profile = plan.profile
    lower, upper, bends = plan.curve.intervals(profile.places)
    push, squares = profile.pushes[:-1, None], np.square(profile.speeds)[:, None]
    ends = lower * push + bends * squares[:-1], upper * push + bends * squares[1:]
    strains: Array = np.maximum(*map(abs, ends)) / plan.acceleration
    return strains


def _hardest(plan: Plan, strains: Array) -> Array:
    """Largest strain from one stop to the next, for each knot between (K, 1).

    It is 1 where the motion was not slowed as a whole: its accelerations are limited where it
    starts. It is a little less where a speed would have risen above its limit between two knots.
    """
    stops = np.flatnonzero(plan.profile.speeds[:-1] == 0.0)
    hardest = np.maximum.reduceat(strains.max(axis=1), stops)
    counts = np.diff(np.append(stops, len(strains)))
    return np.repeat(hardest, counts)[:, None]


def _limits(plan: Plan, kind: str, limits: Array, held: Mask) -> Iterable[Limit]:
    """The limits of one kind that held at some of the times (N, J)."""
    for joint, limit, share in zip(plan.joints, limits.tolist(), held.mean(axis=0), strict=True):
        if share:
            yield Limit(joint, kind, limit, float(share) * plan.duration)


def straight_duration(plan: Plan) -> float:
    """What the straight line between the ends would take, if it were free [s]."""
    return straight(plan.goal - plan.origin, plan.velocity, plan.acceleration)
