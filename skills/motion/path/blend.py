"""Rounding the corners of a path, as far as that is free."""

import numpy as np
from numpy.typing import NDArray

from skills.motion.arrays import norms

from .curve import Curve
from .space import Space

Array = NDArray[np.float64]

_HALVINGS = 5  # then the motion stops at the corner
_LEAST = 1e-6  # as it does where it hardly could not [rad]


NEARNESS = 0.01  # of any part of the arm to where it is at a via point, at the most [m]


def blended(space: Space, waypoints: Array, via: Array) -> Curve:
    """The curve through a path of free edges, its corners rounded where that is free.

    Args:
        space: Where the group may move.
        waypoints: (N, J) [rad].
        via: Those of them that somebody asked for (V, J) [rad].
    """
    radii = _largest(waypoints)
    for i in range(len(radii)):
        if any(np.array_equal(waypoints[i + 1], point) for point in via):
            radii[i] = min(radii[i], _near(space, waypoints[i : i + 3]))
    for i in range(len(radii)):
        radii[i] = _free_radius(space, waypoints[i : i + 3], radii[i])
    return Curve.through(waypoints, radii)


def _largest(waypoints: Array) -> Array:
    """Radii with which neighbouring corners share the edge between them (N - 2,)."""
    lengths = norms(np.diff(waypoints, axis=0))
    shares = 0.5 * lengths
    shares[[0, -1]] = lengths[[0, -1]]  # nobody else needs the first and the last
    return np.minimum(shares[:-1], shares[1:])


def _near(space: Space, corner: Array) -> float:
    """The radius whose curve comes as near to the corner as is asked of a via point.

    In the middle of its parabola, r (e - d) / 4 away; see `curve`.
    """
    legs = np.diff(corner, axis=0)
    turn = abs(np.diff(legs / norms(legs)[:, None], axis=0)[0])
    travel = float((space.lever_arms @ turn).max(initial=0.0))
    return 4.0 * NEARNESS / travel if travel else np.inf


def _free_radius(space: Space, corner: Array, radius: float) -> float:
    for _ in range(_HALVINGS):
        if radius < _LEAST:
            break
        if space.curve(_corner(corner, radius)):
            return radius
        radius *= 0.5
    return 0.0


def _corner(corner: Array, radius: float) -> Curve:
    """The rounded corner alone, from three waypoints."""
    before, after = corner[0] - corner[1], corner[2] - corner[1]
    legs = [leg * (radius / np.linalg.norm(leg)) for leg in (before, after)]
    ends = np.array([corner[1] + legs[0], corner[1], corner[1] + legs[1]])
    return Curve.through(ends, np.array([radius]))
