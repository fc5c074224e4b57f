"""Which limits set the duration of a motion."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skills.motion.arrays import Array, Mask
from skills.motion.trajectory.plan import Plan

from .time_parameterization import line_duration

_STEP = 0.001  # time between samples [s]
_MAX_SAMPLES = 100_000  # largest number of samples, for motions of hours
# Share of a limit that counts as reached, because plans keep limits to a thousandth.
_AT_LIMIT = 0.999


@dataclass(frozen=True, slots=True)
class Limit:
    """A limit that set the duration.

    Attributes:
        joint: Name of the joint.
        kind: `speed` or `acceleration`.
        value: The limit [rad/s] or [rad/s2].
        seconds: Total time for which it applied [s].
    """

    joint: str
    kind: str
    value: float
    seconds: float


def limits_met(plan: Plan) -> list[Limit]:
    """Return every limit that set the duration, longest time first.

    A speed limit applies while the joint moves at it. An acceleration limit applies between two
    knots of the time law if the joint reaches it at one of them. The acceleration along the curve
    is constant between the knots, so it cannot be higher. If no limit is reached there, a limit
    that is reached between the next two knots applies, because a higher acceleration now would
    break it later.
    """
    step = max(_STEP, plan.duration / _MAX_SAMPLES)
    times = np.arange(0.5 * step, plan.duration, step)
    if not times.size:
        return []
    interval = np.searchsorted(plan.profile.times, times, side="right") - 1
    slopes = plan.curve.intervals(plan.profile.positions)
    ratios = plan.profile.acceleration_ratios(slopes, plan.acceleration)
    scale = _largest_between_stops(plan, ratios)
    reached = ratios >= _AT_LIMIT * scale
    top = _AT_LIMIT * np.sqrt(scale[interval]) * plan.velocity
    fast = abs(plan.velocities(times)) >= top
    next_reached = np.vstack((reached[1:], np.zeros_like(reached[:1])))
    ahead = next_reached & ~reached.any(axis=1, keepdims=True)
    pushed = (reached[interval] & ~fast) | (ahead[interval] & ~fast.any(axis=1, keepdims=True))
    found = [
        *_limits(plan, "acceleration", plan.acceleration, pushed),
        *_limits(plan, "speed", plan.velocity, fast),
    ]
    return sorted(found, key=lambda limit: -limit.seconds)


def straight_duration(plan: Plan) -> float:
    """Return the duration of the straight line between the plan's ends [s], free or not."""
    return line_duration(plan.goal - plan.origin, plan.velocity, plan.acceleration)


def _largest_between_stops(plan: Plan, ratios: Array) -> Array:
    """Return for each interval the largest ratio between the two stops around it (K - 1, 1).

    The result is 1 if the whole motion was not slowed, because accelerations reach their limits at
    the start. It is slightly less if the motion was slowed to keep a speed limit between two knots.
    """
    stops = np.flatnonzero(plan.profile.speeds[:-1] == 0.0)
    largest = np.maximum.reduceat(ratios.max(axis=1), stops)
    counts = np.diff(np.append(stops, len(ratios)))
    return np.repeat(largest, counts)[:, None]


def _limits(plan: Plan, kind: str, limits: Array, applies: Mask) -> Iterable[Limit]:
    """Return the limits of one kind that apply at some of the times (N, J)."""
    shares = applies.mean(axis=0)
    for joint, limit, share in zip(plan.joints, limits.tolist(), shares, strict=True):
        if share:
            yield Limit(joint, kind, limit, float(share) * plan.duration)
