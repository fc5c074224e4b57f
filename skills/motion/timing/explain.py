"""Finds the limits that set the duration of a motion."""

from collections.abc import Iterable

import numpy as np

from hardware.loading.dataclass import dataclass
from skills.motion.arrays import Array, Mask
from skills.motion.trajectory.plan import Plan

from .time_parameterization import line_duration

_STEP = 0.001  # time between samples [s]
_MAX_SAMPLES = 100_000  # largest number of samples: very long motions have a longer step
# A limit counts as reached at this share of it, because plans keep limits to a thousandth.
_AT_LIMIT = 0.999


@dataclass(frozen=True, slots=True)
class Limit:
    """A limit of a joint that set the duration of a motion.

    Attributes:
        joint: Name of the joint.
        kind: `speed` or `acceleration`.
        value: Value of the limit [rad/s] or [rad/s2].
        seconds: Total time during which the limit applied [s].
    """

    joint: str
    kind: str
    value: float
    seconds: float


def limits_met(plan: Plan) -> list[Limit]:
    """Return the limits that set the duration of a plan. The limit with the longest time is first.

    A speed limit applies while the joint moves at this speed. An acceleration limit applies between
    two knots of the time law if the joint reaches this limit at one of the two knots. The
    acceleration along the curve is constant between two knots, so it cannot be higher. If no limit
    is reached between two knots, a limit that is reached between the next two knots applies: a
    higher acceleration would then exceed this limit later.
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
    """Return the duration of a straight motion from the plan's start to its goal [s].

    The straight motion may be in collision.
    """
    return line_duration(plan.goal - plan.origin, plan.velocity, plan.acceleration)


def _largest_between_stops(plan: Plan, ratios: Array) -> Array:
    """Return for each interval the largest ratio in its section, from stop to stop (K - 1, 1).

    A ratio is an acceleration as a share of its limit. The result is 1 for a motion that was not
    slowed down, because an acceleration reaches its limit at the start. It is slightly less if the
    motion was slowed down to keep a speed limit between two knots.
    """
    stops = np.flatnonzero(plan.profile.speeds[:-1] == 0.0)
    largest = np.maximum.reduceat(ratios.max(axis=1), stops)
    counts = np.diff(np.append(stops, len(ratios)))
    return np.repeat(largest, counts)[:, None]


def _limits(plan: Plan, kind: str, limits: Array, applies: Mask) -> Iterable[Limit]:
    """Yield the limits of one kind that apply at least once.

    Args:
        plan: The plan.
        kind: `speed` or `acceleration`.
        limits: Limit of each joint (J,).
        applies: True for each sample at which the limit of the joint applies (N, J).
    """
    shares = applies.mean(axis=0)
    for joint, limit, share in zip(plan.joints, limits.tolist(), shares, strict=True):
        if share:
            yield Limit(joint, kind, limit, float(share) * plan.duration)
