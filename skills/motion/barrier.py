"""Where there can be no way: a joint would have to pass a place that it cannot.

A pair of links that only one joint moves against each other is always equally near where that joint
is in one place. And on every way a joint passes all places between its start and its goal. So where
such a pair is too near in one of these there is no way, and no search would ever tell.
"""

import numpy as np
from numpy.typing import NDArray

from .errors import Barred
from .space import Space

Array = NDArray[np.float64]

_LOOKS = 64


def check_passable(space: Space, start: Array, goals: Array) -> None:
    """Look for what is in the way of single joints.

    Args:
        space: Where the group may move.
        start: A free point (J,) [rad].
        goals: Others, of which one is to be reached (G, J) [rad].

    Raises:
        Barred: To each of them.
    """
    alone = np.flatnonzero((space.levers > 0.0).sum(axis=1) == 1)
    if not alone.size:
        return
    found = [_barred(space, start, goal, frozenset(alone.tolist())) for goal in goals]
    if (barred := found[0]) and all(found):
        raise barred


def _barred(space: Space, start: Array, goal: Array, pairs: frozenset[int]) -> Barred | None:
    """What is in the way of the joint that moves one of these pairs of links."""
    shares = np.linspace(0.0, 1.0, _LOOKS)[:, None]
    rows, contacts = space.whole(start + shares * (goal - start)), space.contacts
    hit = contacts.first_hit(rows, space.proved, pairs)
    if hit is None:
        return None
    there = rows[hit : hit + 1]
    pair = next(
        k for k in sorted(pairs) if contacts.first_hit(there, space.proved, frozenset((k,))) == 0
    )
    joint, model = int(space.columns[np.argmax(space.levers[pair])]), contacts.model
    ends = model.outer.collisionPairs[pair]
    names = [model.link(model.outer, i) for i in (ends.first, ends.second)]
    return Barred(model.joints[joint], float(there[0, joint]), model.units[joint], *names)
