"""The quickest way along a curve that keeps every joint's velocity and acceleration limits."""

import math
import sys
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skills.motion.path.curve import Curve

from .profile import Profile

Array = NDArray[np.float64]


def timed(curve: Curve, velocity: Array, acceleration: Array) -> Profile | None:
    """The time law of a curve, at rest at both ends and at its stops.

    Args:
        curve: The path.
        velocity: Limits (J,) [rad/s].
        acceleration: Limits (J,) [rad/s2].

    Returns:
        The time law; None where the solver fails on a bend, as it never does on lines.
    """
    if not curve.length:
        return Profile.still()
    whole = None
    for begin, end in pairwise([0.0, *curve.stops, curve.length]):
        part = _section(curve, begin, end, velocity, acceleration)
        if part is None:
            return None
        whole = whole.then(part) if whole else part
    return whole


def _section(
    curve: Curve, begin: float, end: float, velocity: Array, limits: Array
) -> Profile | None:
    """Between two stops: in closed form where it is one line, by TOPP-RA where it is not."""
    inside = [place for place in curve.breaks.tolist() if begin < place < end]
    piece = np.searchsorted(curve.breaks, begin, side="right") - 1
    if inside or curve.bend[piece].any():
        from .toppra_timing import fastest  # loads TOPP-RA

        return fastest(curve, np.array([begin, *inside, end]), velocity, limits)
    return trapezoid(begin, end, *_along(abs(curve.slope[piece]), velocity, limits))


def straight(way: Array, velocity: Array, acceleration: Array) -> float:
    """Seconds that a straight move takes, from rest to rest.

    Args:
        way: Of each joint (J,) [rad].
        velocity: Limits (J,) [rad/s].
        acceleration: Limits (J,) [rad/s2].
    """
    longest = float(abs(way).max())
    if not longest:
        return 0.0
    return trapezoid(0.0, longest, *_along(abs(way) / longest, velocity, acceleration)).duration


def _along(slope: Array, velocity: Array, acceleration: Array) -> tuple[float, float]:
    """Limits on ds/dt and d2s/dt2 along a line of that |dq/ds| (J,)."""
    moving = [(i, part) for i, part in enumerate(slope.tolist()) if part]
    speed, push = (
        min(limits[i] / part for i, part in moving)
        for limits in (velocity.tolist(), acceleration.tolist())
    )
    return speed, push


def trapezoid(begin: float, end: float, speed: float, push: float) -> Profile:
    """The quickest rest-to-rest motion of one coordinate: full push, full speed, full brake.

    Where the way is too short to reach full speed, push and brake meet in the middle. Along a line
    q' is constant and q'' is zero, so all joints' limits are two on s, and this is the optimum.

    Args:
        begin: Where it starts.
        end: Where it ends, beyond `begin`.
        speed: Limit [1/s].
        push: Limit [1/s2].
    """
    length = end - begin
    top = min(speed, _root_of_product(length, push))
    rising, way = top / push, 0.5 * top * top / push
    cruise = max(0.0, (length - 2.0 * way) / top)
    return Profile(
        np.array([0.0, rising, rising + cruise, 2.0 * rising + cruise]),
        np.array([begin, begin + way, end - way, end]),
        np.array([0.0, top, top, 0.0]),
        np.array([push, 0.0, -push, 0.0]),
    )


def _root_of_product(one: float, other: float) -> float:
    """The square root of what may be too small a number to be multiplied out."""
    product = one * other
    if product < sys.float_info.min:
        return math.sqrt(one) * math.sqrt(other)
    return math.sqrt(product)
