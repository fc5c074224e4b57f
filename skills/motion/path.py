"""The ladder of a path: straight if it is free, else searched for, shortened and rounded."""

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
    space: Space, search: Search, ends: tuple[Array, Array], seed: int, watch: Stopwatch
) -> tuple[Array, Curve]:
    """Waypoints (N, J) [rad] and the curve through them, all of it free.

    Args:
        space: Where the group may move.
        search: For when the line is not free.
        ends: A free start and a free goal (J,) [rad].
        seed: Of search and shortcuts.
        watch: Notes what each rung takes.

    Raises:
        NoPath: There is none, as far as the search has seen.
        PlanTimeout: The time is up.
    """
    if np.array_equal(*ends):
        return ends[0][None, :], Curve.point(ends[0])
    with watch.rung("straight"):
        straight = space.edge(*ends)
    waypoints = np.array(ends) if straight else _round(space, search, ends, seed, watch)
    if len(waypoints) == 2:
        return waypoints, Curve.through(waypoints, np.empty(0))
    with watch.rung("blend"):
        return waypoints, blended(space, waypoints)


def _round(
    space: Space, search: Search, ends: tuple[Array, Array], seed: int, watch: Stopwatch
) -> Array:
    searching, cutting = np.random.SeedSequence(seed).generate_state(2)
    with watch.rung("search"):
        found = search.find(space, *ends, max(1, int(searching)))
    with watch.rung("shorten"):
        short = shortened(space, found, int(cutting))
    apart = norms(np.diff(short, axis=0)) > _SAME
    return np.vstack((short[0], short[1:-1][apart[:-1]], short[-1]))
