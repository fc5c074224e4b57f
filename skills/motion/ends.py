"""The lowest rungs: is the question sound, and may the arm be at both ends?"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hardware import Joint, Robot

from .contacts import Contacts
from .errors import (
    BadQuery,
    EndInCollision,
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
    """All actuated joints at the start and at the goal (A,) [rad].

    Raises:
        BadQuery, NotFinite, StartOutOfBounds, GoalOutOfBounds, StartInCollision, GoalInCollision:
            In this order, the first that applies.
    """
    if query.group not in robot.groups:
        raise BadQuery.group(query.group, robot.groups)
    if not (isinstance(query.seed, int) and query.seed >= 0):
        raise BadQuery(f"The seed is {query.seed!r}; give a whole number from 0")
    start = finite("start", query.start, robot.actuated)
    goal = start.copy()
    goal[columns(robot, query.group)] = finite("goal", query.goal, robot.leaders(query.group))
    _bounded(robot, start, StartOutOfBounds)
    _bounded(robot, goal, GoalOutOfBounds)
    _free(robot, contacts, start, StartInCollision)
    _free(robot, contacts, goal, GoalInCollision)
    return start, goal


def columns(robot: Robot, group: str) -> NDArray[np.intp]:
    """Where the group's own joints are among the actuated (J,)."""
    names = [joint.name for joint in robot.actuated]
    return np.array([names.index(joint.name) for joint in robot.leaders(group)], dtype=np.intp)


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
    if len(values) != len(joints):
        raise BadQuery.count(what, len(values), names)
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise BadQuery(f"The {what} {values!r} is not all numbers; give radians") from error
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
            raise error(joint.name, value, joint.lower, joint.upper)


def _free(
    robot: Robot, contacts: Contacts, configuration: Array, error: type[EndInCollision]
) -> None:
    margin = robot.collision.margin
    if contacts.first_hit(configuration[None, :], margin) is not None:
        nearest = contacts.nearest(configuration)
        assert nearest
        raise error(*nearest, margin)
