"""The ladder of a path: straight, else with one bend, else searched for, shortened and rounded."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skills.motion.arrays import norms
from skills.motion.deadline import Stopwatch

from .barrier import check_passable
from .bend import bent
from .blend import blended
from .curve import Curve
from .search import Search
from .shorten import shortened
from .space import Space

Array = NDArray[np.float64]

_SAME = 1e-9  # waypoints nearer than this are one [rad]


def ways(
    space: Space, search: Search, stations: Array, seed: int, watch: Stopwatch
) -> Iterator[tuple[Array, Curve]]:
    """Waypoints (N, J) [rad] and the curve through them, all of it free.

    The first is the best. Those after it are for when a curve cannot be timed; the last stops at
    every waypoint, so it can.

    Args:
        space: Where the group may move.
        search: For when a line is not free, nor one bend.
        stations: A free start, via points and goal (K, J) [rad].
        seed: Of the search.
        watch: Notes what each rung takes.

    Raises:
        Barred: There is none.
        NoPath: There is none, as far as the search has seen.
        PlanTimeout: The time is up.
    """
    legs = [leg for leg in pairwise(stations) if not np.array_equal(*leg)]
    if not legs:
        yield stations[:1], Curve.point(stations[0])
        return
    with watch.stage("straight"):
        straight = [space.edge(*leg) for leg in legs]
    if straight == [True]:
        yield np.array(legs[0]), Curve.line(*legs[0])
        return
    if straight == [False]:
        with watch.stage("bend"):
            found = bent(space, search.lower, search.upper, legs[0])
        if found:
            yield found
    parts = list(_parts(space, search, legs, straight, seed, watch))
    waypoints = _apart(np.vstack([parts[0], *(part[1:] for part in parts[1:])]))
    if len(waypoints) > 2:
        with watch.stage("blend"):
            curve = blended(space, waypoints, np.array([part[-1] for part in parts[:-1]]))
        yield waypoints, curve
    yield waypoints, Curve.through(waypoints, np.zeros(len(waypoints) - 2))


def _parts(
    space: Space,
    search: Search,
    legs: list[tuple[Array, Array]],
    straight: list[bool],
    seed: int,
    watch: Stopwatch,
) -> Iterator[Array]:
    """Waypoints of each leg (N, J) [rad].

    A leg that is searched for may end whole turns from where it should: the next begins there.
    """
    here, turned = legs[0][0], np.zeros(len(legs[0][0]))
    for (_, end), free in zip(legs, straight, strict=True):
        there = end + turned
        part = np.array([here, there]) if free else _round(space, search, here, there, seed, watch)
        here = part[-1]
        turned = turned + (here - there)
        yield part


def _round(
    space: Space, search: Search, start: Array, goal: Array, seed: int, watch: Stopwatch
) -> Array:
    with watch.stage("search"):
        check_passable(space, search, start, goal)
        goals = search.other_ways(start, goal)
        found = search.find(space, start, goals, seed + 1)  # OMPL ignores a seed of 0
    with watch.stage("shorten"):
        return shortened(space, found)


def _apart(waypoints: Array) -> Array:
    """Without those that are hardly anywhere else than the one before or the last."""
    kept = [waypoints[0]]
    for point in waypoints[1:-1]:
        if min(norms(np.array([point - kept[-1], waypoints[-1] - point]))) > _SAME:
            kept.append(point)
    return np.array([*kept, waypoints[-1]])
