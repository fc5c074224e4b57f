"""Time parameterization of a curve: time-optimal under velocity and acceleration limits."""

import math
from itertools import pairwise

import numpy as np

from skills.motion.arrays import Array
from skills.motion.trajectory.curve import Curve
from skills.motion.trajectory.time_law import TimeLaw

from .toppra import time_section


def time_curve(
    curve: Curve, velocity: Array, acceleration: Array, acceleration_sum: float = math.inf
) -> TimeLaw | None:
    """Return the time law of a curve. The motion rests at both ends and at its stops.

    Args:
        curve: The path.
        velocity: Velocity limits (J,) [rad/s].
        acceleration: Acceleration limits (J,) [rad/s2].
        acceleration_sum: Largest sum of the absolute accelerations of all joints [rad/s2]. If the
            motion exceeds it, all of it is slowed down.

    Returns:
        The time law, or None if the motion would have to stop in between. This happens only on
        blends.
    """
    if not curve.length:
        return TimeLaw.standstill()
    whole = None
    for begin, end in pairwise([0.0, *curve.stops, curve.length]):
        part = _time_section(curve, begin, end, velocity, acceleration)
        if part is None:
            return None
        whole = whole.then(part) if whole else part
    return whole and whole.within_sum(curve, acceleration_sum)


def _time_section(
    curve: Curve, begin: float, end: float, velocity: Array, acceleration: Array
) -> TimeLaw | None:
    """Return the time law between two stops: trapezoidal on a single line, else by TOPP-RA."""
    inside = [place for place in curve.breaks.tolist() if begin < place < end]
    piece = np.searchsorted(curve.breaks, begin, side="right") - 1
    if inside or curve.quadratic[piece].any():
        return time_section(curve, np.array([begin, *inside, end]), velocity, acceleration)
    return TimeLaw.along_line(begin, end, curve.linear[piece], velocity, acceleration)


def line_duration(step: Array, velocity: Array, acceleration: Array) -> float:
    """Return the duration of a straight motion from rest to rest [s].

    Args:
        step: Change of each joint (J,) [rad].
        velocity: Velocity limits (J,) [rad/s].
        acceleration: Acceleration limits (J,) [rad/s2].
    """
    longest = float(abs(step).max())
    if not longest:
        return 0.0
    return TimeLaw.along_line(0.0, longest, step / longest, velocity, acceleration).duration
