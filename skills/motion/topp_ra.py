"""TOPP-RA on a curve of lines and parabolas, with limits that hold between grid points too.

Hung Pham and Quang-Cuong Pham, "A new approach to time-optimal path parameterization based on
reachability analysis", IEEE Transactions on Robotics 34 (2018). With x = (ds/dt)^2 and
u = d2s/dt2 a joint's acceleration is q' u + q'' x. The grid holds every break of the curve and u is
constant between two points of it; there q' and x are linear in s and q'' is constant, so the
acceleration is linear in s: keeping the limit at both ends of an interval, both with that
interval's own q'', keeps it all along. The speed q' sqrt(x) may rise a little above its ends
between them; that is taken out by slowing the whole motion.

Written out here, not taken from the authors' package, which a test holds this equal to: its
constraints and its parametrizers break limits wherever q'' jumps, its import alone takes 0.7 s, and
with limits that are symmetric the two linear programs of every interval have closed forms. For a
row |alpha u + beta x| <= limit let A = limit / |alpha| and r = beta / alpha; then

    -A - r x  <=  u  <=  A - r x             for every row,
    0  <=  x + 2 step u  <=  K               K being the largest x at the next point,

so a larger x is bounded by every pair of a lower and an upper bound of u, whatever K, and by
x (1 - 2 step r) <= K + 2 step A; and u = 0, x = 0 is always allowed, so that a way always exists.
"""

import numpy as np
from numpy.typing import NDArray

from .curve import Curve
from .profile import Profile

Array = NDArray[np.float64]

_POINTS = 40  # grid intervals in a section, about
_LEAST = 5  # in any piece of it


def fastest(curve: Curve, breaks: Array, velocity: Array, acceleration: Array) -> Profile:
    """The quickest time law between two stops of a curve.

    Args:
        curve: The path.
        breaks: Its breaks from one stop to the next, both included (M + 1,).
        velocity: Limits (J,) [rad/s].
        acceleration: Limits (J,) [rad/s2].
    """
    grid = _grid(curve, breaks, velocity, acceleration)
    speeds = np.sqrt(squares(curve, grid, velocity, acceleration))
    profile = _profile(grid, speeds)
    fast, hard = _speed(curve, profile, velocity), _push(curve, profile, acceleration)
    return profile.stretched(max(1.0, fast, float(np.sqrt(hard))))


def squares(curve: Curve, grid: Array, velocity: Array, acceleration: Array) -> Array:
    """Largest (ds/dt)^2 at each point of a grid, from rest to rest (K + 1,) [1/s2]."""
    lower, upper, bends = curve.intervals(grid)
    double = 2.0 * np.diff(grid)[:, None]
    alpha = np.hstack((lower, upper + double * bends))  # at the upper end x is x + 2 step u
    beta, limit = np.hstack((bends, bends)), np.concatenate((acceleration, acceleration))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        wide = np.where(alpha == 0.0, np.inf, limit / abs(alpha))
        rate = np.where(alpha == 0.0, 0.0, beta / alpha)
        still = np.min(np.where(alpha == 0.0, limit / abs(beta), np.inf), axis=1)
        top = _fastest(lower, upper, velocity)
        top[:-1] = np.minimum(top[:-1], np.minimum(still, _crossing(wide, rate, 1.0 / double)))
        kept = 1.0 - double * rate
        reach = double * wide
        offset = np.where(kept > 0.0, reach / kept, np.inf)
        factor = np.where(kept > 0.0, 1.0 / kept, 0.0)
    return _there_and_back(top, offset, factor, reach, kept)


def _crossing(wide: Array, rate: Array, brake: Array) -> Array:
    """Largest x at which a lower bound of u meets an upper one, by interval (K,)."""
    low, low_rate = (np.hstack((wide, 0.0 * brake)), np.hstack((rate, brake)))
    apart = rate[:, None, :] - low_rate[:, :, None]
    meets = (low[:, :, None] + wide[:, None, :]) / apart
    crossing: Array = np.min(np.where(apart > 0.0, meets, np.inf), axis=(1, 2))
    return crossing


def _there_and_back(top: Array, offset: Array, factor: Array, reach: Array, kept: Array) -> Array:
    """What can still stop in time, from the end; then the largest of that, from the start."""
    x, last = top.tolist(), len(offset)
    # In plain floats: of so few rows each, numpy takes five times as long.
    back, ahead = (
        list(zip(p.tolist(), q.tolist(), strict=True)) for p, q in ((offset, factor), (reach, kept))
    )
    x[last] = 0.0
    for i in range(last - 1, -1, -1):
        k = x[i + 1]
        x[i] = min(x[i], *[p + q * k for p, q in zip(*back[i], strict=True)])
    x[0] = 0.0
    for i in range(last):
        k = x[i]
        x[i + 1] = max(0.0, min(x[i + 1], *[p + q * k for p, q in zip(*ahead[i], strict=True)]))
    return np.array(x)


def _fastest(lower: Array, upper: Array, velocity: Array) -> Array:
    """Largest x by the speeds at each point, from the intervals on both sides (K + 1,)."""
    steepest = np.vstack((abs(lower), np.zeros_like(lower[:1])))
    steepest[1:] = np.maximum(steepest[1:], abs(upper))
    speeds: Array = np.min(velocity / steepest, axis=1) ** 2
    return speeds


def _grid(curve: Curve, breaks: Array, velocity: Array, acceleration: Array) -> Array:
    """All breaks, points between, and where full speed is reached from the ends if on a line."""
    even = _even(breaks)
    lower, upper, bends = curve.intervals(breaks)
    with np.errstate(divide="ignore", over="ignore"):
        speeds = [np.min(velocity / abs(slope)) for slope in (lower[0], upper[-1])]
        pushes = [np.min(acceleration / abs(slope)) for slope in (lower[0], upper[-1])]
    first, last = 0.5 * np.square(speeds) / pushes
    extra = [breaks[0] + first] if first < breaks[1] - breaks[0] and not bends[0].any() else []
    if last < breaks[-1] - breaks[-2] and not bends[-1].any():
        extra.append(breaks[-1] - last)
    apart = [s for s in extra if abs(even - s).min() > 1e-6 * (breaks[-1] - breaks[0])]
    return np.sort(np.append(even, apart))


def _even(breaks: Array) -> Array:
    lengths = np.diff(breaks)
    counts = np.maximum(_LEAST, np.rint(_POINTS * lengths / lengths.sum())).astype(int)
    parts = [
        np.linspace(begin, end, count, endpoint=False)
        for begin, end, count in zip(breaks, breaks[1:], counts, strict=False)
    ]
    return np.concatenate((*parts, breaks[-1:]))


def _profile(grid: Array, speeds: Array) -> Profile:
    steps = np.diff(grid)
    times = 2.0 * steps / (speeds[1:] + speeds[:-1])
    pushes = np.diff(speeds * speeds) / (2.0 * steps)
    return Profile(np.concatenate(([0.0], np.cumsum(times))), grid, speeds, np.append(pushes, 0.0))


def _push(curve: Curve, profile: Profile, acceleration: Array) -> float:
    """Largest joint acceleration over its limit; it is linear in between the grid points."""
    lower, upper, bends = curve.intervals(profile.places)
    push, squares = profile.pushes[:-1, None], np.square(profile.speeds)[:, None]
    ends = np.vstack((lower * push + bends * squares[:-1], upper * push + bends * squares[1:]))
    return float(np.max(abs(ends) / acceleration))


def _speed(curve: Curve, profile: Profile, velocity: Array) -> float:
    """Largest joint speed over its limit.

    Within an interval its square is p(s)^2 x(s) with p and x linear in s: largest at an end, or
    where 2 p' x + p x' = 0.
    """
    lower, _, p1 = curve.intervals(profile.places)
    squares, steps = np.square(profile.speeds)[:, None], np.diff(profile.places)[:, None]
    p0, x0, x1 = lower, squares[:-1], np.diff(squares, axis=0) / steps
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        turn = np.nan_to_num(-(2.0 * p1 * x0 + p0 * x1) / (3.0 * p1 * x1))
    speeds = [
        abs(p0 + u * p1) * np.sqrt(np.maximum(0.0, x0 + u * x1)) / velocity
        for u in (0.0 * steps, np.clip(turn, 0.0, steps), steps)
    ]
    return float(np.max(speeds))
