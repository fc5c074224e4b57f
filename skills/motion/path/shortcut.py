"""Shortcutting: shortens a searched path by free edges between its points.

Deterministic: waypoints are skipped if an edge past them is free, then corners are cut off. (The
well-known version draws the points at random: R. Geraerts and M. H. Overmars, "Creating
high-quality paths for motion planning", International Journal of Robotics Research 26, 2007.)
"""

import numpy as np

from skills.motion.arrays import Array

from .motion_validator import MotionValidator

_CUTS = (0.7, 0.35)  # shares of a corner's legs to cut off, tried in turn


def shortcut(validator: MotionValidator, waypoints: Array) -> Array | None:
    """Return a path with the same ends and free edges (N, J) [rad]. It is not longer.

    Returns None if an edge that is not skipped is not free.

    Args:
        validator: Checks motions of the group.
        waypoints: A path with edges that seem free (N, J) [rad].
    """
    path = _skip_waypoints(validator, waypoints)
    return None if path is None else _cut_corners(validator, path)


def _skip_waypoints(validator: MotionValidator, path: Array) -> Array | None:
    """Connect each kept waypoint to the furthest waypoint that a free edge reaches, or None."""
    kept, i = [0], 0
    while i < len(path) - 1:
        further = range(len(path) - 1, i, -1)
        reached = next((j for j in further if validator.line_is_free(path[i], path[j])), None)
        if reached is None:
            return None
        kept.append(i := reached)
    return path[kept]


def _cut_corners(validator: MotionValidator, path: Array) -> Array:
    """Replace each corner by a free edge between points on its legs.

    Two neighbouring corners may each use half of the leg between them.
    """
    points = [path[:1]]
    for i in range(1, len(path) - 1):
        corner = path[i]
        before, after = path[i - 1] - corner, path[i + 1] - corner
        first, last = i == 1, i == len(path) - 2
        legs = before * (1.0 if first else 0.5), after * (1.0 if last else 0.5)
        points.append(_cut_corner(validator, corner, *legs))
    return np.vstack([*points, path[-1:]])


def _cut_corner(validator: MotionValidator, corner: Array, before: Array, after: Array) -> Array:
    for share in _CUTS:
        ends = corner + share * np.array([before, after])
        if validator.line_is_free(ends[0], ends[1]):
            return ends
    return corner[None, :]
