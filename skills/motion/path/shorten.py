"""Making a path shorter, by edges that are checked."""

import numpy as np
from numpy.typing import NDArray

from .space import Space

Array = NDArray[np.float64]

_SHARES = (0.7, 0.35)  # of a corner's legs, tried to be cut off


def shortened(space: Space, waypoints: Array) -> Array:
    """A path no longer than the one given, between the same ends (N, J) [rad].

    Leaves out what can be left out, then cuts off corners, each as far as that is free.
    """
    return _cut(space, _thinned(space, waypoints))


def _thinned(space: Space, path: Array) -> Array:
    """From every waypoint kept, on to the furthest that an edge reaches."""
    kept, i = [0], 0
    while i < len(path) - 1:
        further = range(len(path) - 1, i + 1, -1)
        i = next((j for j in further if space.edge(path[i], path[j])), i + 1)
        kept.append(i)
    return path[kept]


def _cut(space: Space, path: Array) -> Array:
    """With every corner replaced by an edge between points on its legs, where one is free.

    Legs between two corners are shared: each corner has one half.
    """
    places = [path[:1]]
    for i in range(1, len(path) - 1):
        corner = path[i]
        before, after = path[i - 1] - corner, path[i + 1] - corner
        first, last = i == 1, i == len(path) - 2
        halves = before * (1.0 if first else 0.5), after * (1.0 if last else 0.5)
        places.append(_cut_corner(space, corner, *halves))
    return np.vstack([*places, path[-1:]])


def _cut_corner(space: Space, corner: Array, before: Array, after: Array) -> Array:
    for share in _SHARES:
        ends = corner + share * np.array([before, after])
        if space.edge(ends[0], ends[1]):
            return ends
    return corner[None, :]
