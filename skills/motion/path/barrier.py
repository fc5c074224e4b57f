"""Where there can be no way: a joint would have to pass a place that it cannot.

A pair of links that only one joint moves against each other is always equally near where that joint
is in one place. And on every way a joint with an end passes all places between its start and its
goal, one without an end these or all the others. So where such a pair is too near in one of these
there is no way, and no search would ever tell.
"""

import numpy as np
from numpy.typing import NDArray

from skills.motion.errors import Barred

from .search import Search
from .space import Space

Array = NDArray[np.float64]

_LOOKS = 64


def check_passable(space: Space, search: Search, start: Array, goal: Array) -> None:
    """Look for what is in the way of single joints.

    Args:
        space: Where the group may move.
        search: Which of its joints have an end.
        start: A free point (J,) [rad].
        goal: Another (J,) [rad].

    Raises:
        Barred: No way leads there, whichever way round.
    """
    alone = np.flatnonzero((space.lever_arms > 0.0).sum(axis=1) == 1)
    movers = space.lever_arms[alone].argmax(axis=1)
    for joint in np.unique(movers).tolist():
        pairs = frozenset(alone[movers == joint].tolist())
        ways = [_barred(space, start, way, pairs) for way in _ways(search, joint, start, goal)]
        if ways and (barred := ways[0]) and all(ways):
            raise barred


def _ways(search: Search, joint: int, start: Array, goal: Array) -> list[Array]:
    """Where a single joint goes, of which it must go one; none if others may lead there too."""
    way = start.copy()
    way[joint] = goal[joint]
    if np.isfinite([search.lower[joint], search.upper[joint]]).any():
        return [way]
    # What a leader without an end does a whole turn on its followers need not do.
    return list(search.other_ways(start, way)) if search.turning[joint] else []


def _barred(space: Space, start: Array, goal: Array, pairs: frozenset[int]) -> Barred | None:
    """What is in the way of the joint that moves these pairs of links."""
    shares = np.linspace(0.0, 1.0, _LOOKS)[:, None]
    rows, checker = space.whole(start + shares * (goal - start)), space.checker
    hit = checker.first_collision(rows, space.proved, pairs)
    if hit is None:
        return None
    there = rows[hit : hit + 1]
    pair = next(
        k
        for k in sorted(pairs)
        if checker.first_collision(there, space.proved, frozenset((k,))) == 0
    )
    joint, model = int(space.columns[np.argmax(space.lever_arms[pair])]), checker.model
    ends = model.outer.collisionPairs[pair]
    names = [model.link(model.outer, i) for i in (ends.first, ends.second)]
    return Barred(model.joints[joint], float(there[0, joint]), model.units[joint], *names)
