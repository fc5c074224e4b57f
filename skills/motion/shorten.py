"""Making a path shorter, by edges that are checked."""

import numpy as np
from numpy.typing import NDArray

from .arrays import norms
from .space import Space

Array = NDArray[np.float64]

_TRIES = 30  # a count, not a time: the same query must give the same path


def shortened(space: Space, waypoints: Array, seed: int) -> Array:
    """A path no longer than the one given, between the same ends (N, J) [rad].

    Leaves out what can be left out, then cuts corners between random places, then leaves out
    again.
    """
    path = _thinned(space, waypoints)
    random = np.random.default_rng(seed)
    for _ in range(_TRIES if len(path) > 2 else 0):
        path = _cut(space, path, random)
    return _thinned(space, path)


def _thinned(space: Space, path: Array) -> Array:
    """From every waypoint kept, on to the furthest that an edge reaches."""
    kept, i = [0], 0
    while i < len(path) - 1:
        further = range(len(path) - 1, i + 1, -1)
        i = next((j for j in further if space.edge(path[i], path[j])), i + 1)
        kept.append(i)
    return path[kept]


def _cut(space: Space, path: Array, random: np.random.Generator) -> Array:
    """With an edge between two random places on the path, where it is free."""
    lengths = norms(np.diff(path, axis=0))
    reach = np.concatenate(([0.0], np.cumsum(lengths)))
    s = np.sort(random.uniform(0.0, reach[-1], 2))
    i, j = np.minimum(np.searchsorted(reach, s, side="right") - 1, len(lengths) - 1)
    if i == j:
        return path
    share = ((s - reach[[i, j]]) / lengths[[i, j]])[:, None]
    ends = path[[i, j]] + share * (path[[i + 1, j + 1]] - path[[i, j]])
    if not space.edge(ends[0], ends[1]):
        return path
    return np.vstack((path[: i + 1], ends, path[j + 1 :]))
