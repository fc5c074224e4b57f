"""One bend round what is in the way: tried before a search, being quicker and mostly shorter.

The corners tried fill the joint space around both ends evenly and are always the same, so nothing
here is random. They are tried in the order of the way that they mean, less those whose bend meets
what is known to be in the way. That is very quick to ask of many, as it is asked of few pairs of
links: at first of those that meet on the straight line, then also of those that meet on a bend that
was tried.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from skills.motion.arrays import norms

from .curve import Curve
from .space import Space

Array = NDArray[np.float64]

_CORNERS = 128
_TOGETHER = 16  # that are asked about together
_TRIES = 10  # of those left, that are looked at all along
_AROUND = 2.0  # the ends, how far corners go [rad]
_LINE = np.linspace(0.0, 1.0, 8)[1:-1, None]  # where the line is asked what is in the way
_LOOKS = np.linspace(0.0, 1.0, 11)[1:-1, None, None]  # where a bend is asked whether it is


def bent(
    space: Space, lower: Array, upper: Array, ends: tuple[Array, Array]
) -> tuple[Array, Curve] | None:
    """Three waypoints (3, J) [rad] and the free curve round the one between; None if none is found.

    Only the curve is free: the lines between the waypoints may not be.

    Args:
        space: Where the group may move.
        lower: Of its joints, -inf where there is no limit (J,) [rad].
        upper: Of its joints, inf where there is no limit (J,) [rad].
        ends: Two free points (J,) [rad]; the line between them is not free.

    Raises:
        PlanTimeout: The time is up.
    """
    # Hulls that overlap where nothing touches say nothing.
    vague = _close(space, np.array(ends))
    pairs = _close(space, ends[0] + _LINE * (ends[1] - ends[0])) - vague
    corners, tries = _corners(lower, upper, ends), 0
    for begin in range(0, _CORNERS, _TOGETHER):
        left = _clear(space, ends, corners[begin : begin + _TOGETHER], pairs)
        while len(left) and tries < _TRIES:
            waypoints, left, tries = np.array([ends[0], left[0], ends[1]]), left[1:], tries + 1
            curve = Curve.through(waypoints, norms(np.diff(waypoints, axis=0)).min(keepdims=True))
            met = space.meets(curve)
            if met is None:
                return waypoints, curve
            new = _close(space, met[None, :]) - vague - pairs
            left, pairs = _clear(space, ends, left, new), pairs | new
    return None


def _corners(lower: Array, upper: Array, ends: tuple[Array, Array]) -> Array:
    """The way over the first is the shortest (K, J) [rad]."""
    low = np.maximum(lower, np.minimum(*ends) - _AROUND)
    high = np.minimum(upper, np.maximum(*ends) + _AROUND)
    corners: Array = low + _even(len(low)) * (high - low)
    lengths = norms(corners - ends[0]) + norms(ends[1] - corners)
    return corners[np.argsort(lengths, kind="stable")]


@lru_cache(maxsize=8)
def _even(size: int) -> Array:
    """Points that fill the unit cube evenly (K, size).

    Multiples of the powers of 1 / x with x ** (size + 1) = x + 1, modulo 1: the additive recurrence
    of Martin Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
    """
    x = 2.0
    for _ in range(60):
        x = (1.0 + x) ** (1.0 / (size + 1))
    points = np.outer(np.arange(1.0, _CORNERS + 1.0), x ** -np.arange(1.0, size + 1.0)) % 1.0
    points.setflags(write=False)
    return points


def _close(space: Space, points: Array) -> frozenset[int]:
    """Pairs of links whose hulls are too near at some of the points (N, J) [rad]."""
    return space.checker.close(space.whole(points), space.margin)


def _clear(space: Space, ends: tuple[Array, Array], corners: Array, pairs: frozenset[int]) -> Array:
    """Those of the corners whose bend, as far as is asked, keeps the hulls of some pairs apart."""
    if not (len(corners) and pairs):
        return corners
    t = _LOOKS
    looks = (1.0 - t) ** 2 * ends[0] + 2.0 * t * (1.0 - t) * corners + t**2 * ends[1]
    rows = space.whole(looks.reshape(-1, corners.shape[1]))
    hits = space.checker.doubtful(rows, space.margin, pairs)
    return corners[~hits.reshape(len(_LOOKS), -1).any(axis=0)]
