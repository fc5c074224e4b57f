"""The lowest rungs: is the question sound, and may the arm be at both ends?"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hardware import Joint, Robot

from .contacts import Contacts
from .errors import (
    BadQuery,
    GoalInCollision,
    GoalOutOfBounds,
    NotFinite,
    OutOfBounds,
    StartInCollision,
    StartOutOfBounds,
)
from .query import Query

Array = NDArray[np.float64]


def check_ends(robot: Robot, contacts: Contacts, query: Query) -> tuple[Array, Array]:
    """All actuated joints at the start (A,), and the group's at start, via points and goal (K, J).

    All of them in [rad]; to be passed in that order, joints without an end the short way each time.

    Raises:
        BadQuery, NotFinite, StartOutOfBounds, GoalOutOfBounds, StartInCollision, GoalInCollision:
            In this order, the first that applies; a via point counts as a goal.
    """
    if query.group not in robot.groups:
        raise BadQuery.group(query.group, robot.groups)
    if not (isinstance(query.seed, int) and query.seed >= 0):
        raise BadQuery(f"The seed is {query.seed!r}; give a whole number from 0")
    own, joints = columns(robot, query.group), robot.leaders(query.group)
    endless = turning(robot, query.group)
    start = finite("start", query.start, robot.actuated)
    rows = [start]
    for what, goal in (*(("via point", via) for via in query.via), ("goal", query.goal)):
        rows.append(start.copy())
        rows[-1][own] = short_way(endless, rows[-2][own], finite(what, goal, joints))
    for number, row in enumerate(rows):
        _bounded(robot, row, GoalOutOfBounds if number else StartOutOfBounds)
    stations = np.array(rows)
    blocked = contacts.blocked(stations, robot.collision.margin)
    if blocked:
        number, nearest = blocked
        error = GoalInCollision if number else StartInCollision
        raise error(*nearest, robot.collision.margin)
    return start, stations[:, own]


def columns(robot: Robot, group: str) -> NDArray[np.intp]:
    """Where the group's own joints are among the actuated (J,)."""
    names = [joint.name for joint in robot.actuated]
    return np.array([names.index(joint.name) for joint in robot.leaders(group)], dtype=np.intp)


def turning(robot: Robot, group: str) -> NDArray[np.bool_]:
    """Which of the group's own joints stand the same a whole turn on (J,)."""
    followed = {joint.mimic.leader for joint in robot.joints if joint.mimic}
    joints = robot.leaders(group)
    return np.array([joint.endless and joint.name not in followed for joint in joints], dtype=bool)


def short_way(endless: NDArray[np.bool_], start: Array, goal: Array) -> Array:
    """A goal with endless joints turned back to within half a turn of the start, (J,) [rad]."""
    turns = np.where(endless, np.round((goal - start) / (2.0 * np.pi)), 0.0)
    return goal - 2.0 * np.pi * turns


def bounds(robot: Robot, group: str) -> tuple[Array, Array]:
    """Limits of the group's own joints that keep their followers within theirs too (J,) [rad]."""
    own = {joint.name: (joint.lower, joint.upper) for joint in robot.leaders(group)}
    for joint in robot.joints:
        if joint.mimic and joint.mimic.leader in own and joint.mimic.multiplier:
            mimic, (lower, upper) = joint.mimic, own[joint.mimic.leader]
            ends = sorted((q - mimic.offset) / mimic.multiplier for q in (joint.lower, joint.upper))
            own[mimic.leader] = max(lower, ends[0]), min(upper, ends[1])
    return np.array([low for low, _ in own.values()]), np.array([up for _, up in own.values()])


def finite(what: str, values: Sequence[float], joints: Sequence[Joint]) -> Array:
    """Values for joints as an array (J,) [rad].

    Raises:
        BadQuery: There are too many or too few, or they are no numbers.
        NotFinite: One is a NaN or an infinity.
    """
    names = [joint.name for joint in joints]
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise BadQuery(f"The {what} {values!r} is not all numbers; give radians") from error
    if array.shape != (len(joints),):
        raise BadQuery.count(what, array.size, names)
    for name, value in zip(names, array.tolist(), strict=True):
        if not np.isfinite(value):
            raise NotFinite(what, name, value)
    return array


def _bounded(robot: Robot, configuration: Array, error: type[OutOfBounds]) -> None:
    """Refuse joints outside their limits, followers included."""
    own = {joint.name: q for joint, q in zip(robot.actuated, configuration.tolist(), strict=True)}
    for joint in robot.joints:
        value = joint.mimic.value(own[joint.mimic.leader]) if joint.mimic else own[joint.name]
        if not joint.lower <= value <= joint.upper:
            raise error(joint.name, value, joint.lower, joint.upper, joint.unit)
