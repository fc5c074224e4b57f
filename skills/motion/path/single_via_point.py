"""Finds a path through a single via point around an obstacle. It is tried before the search.

The path has a bend or a corner at the via point. It is found faster than a searched path, and is
mostly shorter. The candidate via points are a low-discrepancy sequence in a small and a large box
around both ends: they cover each box evenly, and are not random. They are tried in the order of
their path lengths. A fast filter first drops candidates that collide. It checks only a few pairs of
links: the pairs that collide on the straight line, and the pairs that collided on a tried bend.
"""

from functools import lru_cache

import numpy as np

from skills.motion.arrays import Array, norms
from skills.motion.robot_model.joint_group import JointGroup
from skills.motion.trajectory.curve import Curve

from .motion_validator import MotionValidator

_CANDIDATES = 192
_GROUP_SIZE = 16  # candidates filtered in one call
_MAX_TRIES = 20  # largest number of bends that are checked completely; a search costs as much
# Largest distance of candidates beyond the ends, times the number of joints [rad]: those of the
# small and of the large box alternate. With many joints, candidates far away would be sparse.
_REACH = np.tile([[5.0], [10.0]], (_CANDIDATES // 2, 1))
_MAX_REACH = 2.0  # for arms with few joints [rad]
# Of a bend, checked first: halves, quarters ... If the first candidate is not free, most are not,
# and these samples show it in a tenth of the time of a complete check.
_SHARES = np.concatenate([np.arange(1.0, 2.0**k, 2.0) / 2.0**k for k in range(1, 6)])
_FEW_SHARES = _SHARES[:7]
_LINE_SAMPLES = np.linspace(0.0, 1.0, 8)[1:-1, None]
_NO_RADIUS = np.zeros(1)
# Samples of a candidate for the filter. They are denser near the ends, because start and goal are
# often in narrow places.
_T = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 13))[1:-1, None, None]
_FIRST = np.isin(np.arange(len(_T)), (1, len(_T) // 2, len(_T) - 2))  # samples filtered first
_BEND_WEIGHTS = np.array([(1.0 - _T) ** 2, 2.0 * _T * (1.0 - _T), _T**2])
_CORNER_WEIGHTS = np.maximum(0.0, [1.0 - 2.0 * _T, 1.0 - abs(2.0 * _T - 1.0), 2.0 * _T - 1.0])


def find_bend(validator: MotionValidator, ends: tuple[Array, Array]) -> tuple[Array, Curve] | None:
    """Return three waypoints (3, J) [rad] and the free curve along them, or None.

    The curve is free. The lines between the waypoints may be in collision.

    Args:
        validator: Checks motions of the group.
        ends: Two free points (J,) [rad]. The line between them is not free.

    Raises:
        PlanTimeout: The deadline passed.
    """
    return _find(validator, ends, _BEND_WEIGHTS, rounded=True)


def find_corner(validator: MotionValidator, ends: tuple[Array, Array]) -> Array | None:
    """Return three waypoints with free lines between them (3, J) [rad], or None.

    The caller rounds all corners of the longer path later.

    Args:
        validator: Checks motions of the group.
        ends: Two free points (J,) [rad]. The line between them is not free.

    Raises:
        PlanTimeout: The deadline passed.
    """
    found = _find(validator, ends, _CORNER_WEIGHTS, rounded=False)
    return found[0] if found else None


def _find(
    validator: MotionValidator, ends: tuple[Array, Array], weights: Array, rounded: bool
) -> tuple[Array, Curve] | None:
    """Return the first three waypoints with a free curve, and the curve.

    Args:
        validator: Checks motions of the group.
        ends: Two free points (J,) [rad]. The line between them is not free.
        weights: Weights of start, via point and end in the samples of a candidate (3, S, 1, 1).
        rounded: True to round the corner as far as possible; False to stop at the corner.
    """
    # Pairs with overlapping hulls at the free ends are useless for the filter.
    ignored = _close_pairs(validator, np.array(ends))
    pairs = _close_pairs(validator, ends[0] + _LINE_SAMPLES * (ends[1] - ends[0])) - ignored
    candidates, tries = _via_points(validator.group, ends), 0
    for begin in range(0, _CANDIDATES, _GROUP_SIZE):
        if tries == _MAX_TRIES:
            break
        left = candidates[begin : begin + _GROUP_SIZE]
        left = _without_collision(validator, ends, left, weights, pairs)
        while len(left) and tries < _MAX_TRIES:
            waypoints, left, tries = np.array([ends[0], left[0], ends[1]]), left[1:], tries + 1
            radius = norms(np.diff(waypoints, axis=0)).min(keepdims=True) if rounded else _NO_RADIUS
            curve = Curve.through(waypoints, radius)
            shares = _FEW_SHARES if tries == 1 else _SHARES
            collision = validator.sampled_collision(curve.positions(curve.length * shares))
            if collision is None:
                collision = validator.collision_on(curve)
            if collision is None:
                return waypoints, curve
            new = _close_pairs(validator, collision[None, :]) - ignored - pairs
            left = _without_collision(validator, ends, left, weights, new)
            pairs |= new
    return None


def _via_points(group: JointGroup, ends: tuple[Array, Array]) -> Array:
    """Return the candidate via points, in the order of their path lengths (K, J) [rad]."""
    count = len(group.lower)
    reach = np.minimum(_REACH / count, _MAX_REACH)
    low = np.maximum(group.lower, np.minimum(*ends) - reach)
    high = np.minimum(group.upper, np.maximum(*ends) + reach)
    points: Array = low + _low_discrepancy(count) * (high - low)
    lengths = norms(points - ends[0]) + norms(ends[1] - points)
    return points[np.argsort(lengths, kind="stable")]


@lru_cache(maxsize=8)
def _low_discrepancy(dimensions: int) -> Array:
    """Return points that cover the unit cube evenly (K, dimensions).

    They are multiples of powers of 1 / x with x ** (dimensions + 1) = x + 1, modulo 1: the additive
    recurrence of Martin Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
    """
    x, size = 2.0, dimensions
    for _ in range(60):
        x = (1.0 + x) ** (1.0 / (size + 1))
    points = np.outer(np.arange(1.0, _CANDIDATES + 1.0), x ** -np.arange(1.0, size + 1.0)) % 1.0
    points.setflags(write=False)
    return points


def _close_pairs(validator: MotionValidator, points: Array) -> frozenset[int]:
    """Return the pairs of links whose hulls violate the margin at a point (N, J) [rad]."""
    return validator.checker.close_pairs(validator.full(points), validator.margin)


def _without_collision(
    validator: MotionValidator,
    ends: tuple[Array, Array],
    points: Array,
    weights: Array,
    pairs: frozenset[int],
) -> Array:
    """Return the via points of the paths that keep the margin of these hulls at all samples.

    Most candidates collide in the middle, far from the line, or near an end in a narrow place.
    """
    if not pairs:
        return points
    for samples in _FIRST, ~_FIRST:
        if len(points):
            start, via, end = weights[:, samples]
            positions = start * ends[0] + via * points + end * ends[1]
            rows = validator.full(positions.reshape(-1, points.shape[1]))
            hits = validator.checker.hulls_near(rows, validator.margin, pairs)
            points = points[~hits.reshape(len(positions), -1).any(axis=0)]
    return points
