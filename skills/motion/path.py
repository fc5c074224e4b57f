"""The ladder of a path: straight if it is free, else searched for, shortened and rounded."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .arrays import norms
from .blend import blended
from .curve import Curve
from .deadline import Stopwatch
from .search import Search
from .shorten import shortened
from .space import Space

Array = NDArray[np.float64]

_SAME = 1e-9  # waypoints nearer than this are one [rad]


def find(
    space: Space, search: Search, stations: Array, seed: int, watch: Stopwatch
) -> tuple[Array, Curve]:
    """Waypoints (N, J) [rad] and the curve through them, all of it free.

    Args:
        space: Where the group may move.
        search: For when a line is not free.
        stations: A free start, via points and goal (K, J) [rad].
        seed: Of the search.
        watch: Notes what each rung takes.

    Raises:
        NoPath: There is none, as far as the search has seen.
        PlanTimeout: The time is up.
    """
    legs = [leg for leg in pairwise(stations) if not np.array_equal(*leg)]
    if not legs:
        return stations[:1], Curve.point(stations[0])
    with watch.rung("straight"):
        straight = [space.edge(*leg) for leg in legs]
    ways = [
        np.array(leg) if free else _round(space, search, leg, seed, watch)
        for leg, free in zip(legs, straight, strict=True)
    ]
    waypoints = _apart(np.vstack([ways[0], *(way[1:] for way in ways[1:])]))
    if len(waypoints) == 2:
        return waypoints, Curve.through(waypoints, np.empty(0))
    with watch.rung("blend"):
        return waypoints, blended(space, waypoints, stations[1:-1])


def _round(
    space: Space, search: Search, ends: tuple[Array, Array], seed: int, watch: Stopwatch
) -> Array:
    with watch.rung("search"):
        found = search.find(space, *ends, seed + 1)  # OMPL ignores a seed of 0
    with watch.rung("shorten"):
        return shortened(space, found)


def _apart(waypoints: Array) -> Array:
    """Without those that are hardly anywhere else than the one before or the last."""
    kept = [waypoints[0]]
    for point in waypoints[1:-1]:
        if min(norms(np.array([point - kept[-1], waypoints[-1] - point]))) > _SAME:
            kept.append(point)
    return np.array([*kept, waypoints[-1]])
