"""Parabolic blends: rounds the corners of a path as far as the blends are free.

T. Kunz and M. Stilman, "Turning paths into trajectories using parabolic blends", Georgia Institute
of Technology, 2011. In contrast to the paper, a blend is a curve in space. It is timed later.
"""

import numpy as np

from skills.motion.arrays import Array, norms
from skills.motion.trajectory.curve import Curve

from .motion_validator import MotionValidator

VIA_TOLERANCE = 0.01  # largest distance of any part of the arm from its pose at a via point [m]

_HALVINGS = 5  # number of times that a radius is halved before the motion stops at the corner
_MIN_RADIUS = 1e-6  # smallest radius; with a smaller one, the motion would almost stop [rad]


def blend(validator: MotionValidator, waypoints: Array, via: Array) -> Curve:
    """Return the curve along a path, with rounded corners where the blends are free.

    Args:
        validator: Checks motions of the group.
        waypoints: Waypoints of a path with free edges (N, J) [rad].
        via: The via points of the query (V, J) [rad].
    """
    radii = _largest_radii(waypoints)
    for i in range(len(radii)):
        if any(np.array_equal(waypoints[i + 1], point) for point in via):
            radii[i] = min(radii[i], _via_radius(validator, waypoints[i : i + 3]))
    for i in range(len(radii)):
        radii[i] = _free_radius(validator, waypoints[i : i + 3], radii[i])
    return Curve.through(waypoints, radii)


def _largest_radii(waypoints: Array) -> Array:
    """Return radii at which neighbouring corners share the edge between them (N - 2,) [rad]."""
    lengths = norms(np.diff(waypoints, axis=0))
    shares = 0.5 * lengths
    shares[[0, -1]] = lengths[[0, -1]]  # the first and the last edge have only one corner
    return np.minimum(shares[:-1], shares[1:])


def _via_radius(validator: MotionValidator, corner: Array) -> float:
    """Return the largest radius [rad] at which the arm still passes close to the corner.

    No part of the arm is then farther than `VIA_TOLERANCE` [m] from its pose at the corner. The
    middle of the blend is closest to the corner. Its offset is r (e - d) / 4, with the radius r and
    the directions d before and e after the corner; see `trajectory/curve.py`.
    """
    legs = np.diff(corner, axis=0)
    turn = abs(np.diff(legs / norms(legs)[:, None], axis=0)[0])
    travel = float((validator.lever_arms @ turn).max(initial=0.0))
    return 4.0 * VIA_TOLERANCE / travel if travel else np.inf


def _free_radius(validator: MotionValidator, corner: Array, radius: float) -> float:
    for _ in range(_HALVINGS):
        if radius < _MIN_RADIUS:
            break
        if validator.curve_is_free(_parabola(corner, radius)):
            return radius
        radius *= 0.5
    return 0.0


def _parabola(corner: Array, radius: float) -> Curve:
    """Return the blend of one corner, given by three waypoints (3, J) [rad]."""
    legs = np.diff(corner, axis=0)
    directions = legs / norms(legs)[:, None]
    begin, turn = corner[1:2] - radius * directions[:1], np.diff(directions, axis=0)
    breaks = np.array([0.0, 2.0 * radius])
    return Curve(breaks, begin, directions[:1], turn / (4.0 * radius), np.empty(0))
