"""Time parameterization of a curve: the fastest motion within velocity and acceleration limits."""

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
    """Return the fastest time law for a curve. The motion stands still at both ends and at stops.

    Args:
        curve: The path.
        velocity: Velocity limits (J,) [rad/s].
        acceleration: Acceleration limits (J,) [rad/s2].
        acceleration_sum: Largest sum of the absolute accelerations of all joints [rad/s2]. If the
            motion exceeds this sum, the whole motion is slowed down.

    Returns:
        The time law; None if the motion would have to stop at another place. This happens only on
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
    """Return the time law between two stops; None if the motion would have to stop between them.

    On a single line, it is a trapezoidal profile. Else, TOPP-RA computes it.
    """
    inside = [place for place in curve.breaks.tolist() if begin < place < end]
    piece = np.searchsorted(curve.breaks, begin, side="right") - 1
    if inside or curve.quadratic[piece].any():
        return time_section(curve, np.array([begin, *inside, end]), velocity, acceleration)
    return TimeLaw.along_line(begin, end, curve.linear[piece], velocity, acceleration)


def line_duration(step: Array, velocity: Array, acceleration: Array) -> float:
    """Return the duration of a straight motion that starts and ends at standstill [s].

    Args:
        step: Change of each joint (J,) [rad].
        velocity: Velocity limits (J,) [rad/s].
        acceleration: Acceleration limits (J,) [rad/s2].
    """
    longest = float(abs(step).max())
    if not longest:
        return 0.0
    return TimeLaw.along_line(0.0, longest, step / longest, velocity, acceleration).duration
