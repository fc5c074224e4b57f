"""The lowest rungs: is the question sound, and may the arm be at both ends?"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hardware import Joint, Robot
from skills.motion.errors import (
    BadQuery,
    GoalInCollision,
    GoalOutOfBounds,
    NotFinite,
    OutOfBounds,
    StartInCollision,
    StartOutOfBounds,
    shown,
)
from skills.motion.measures import FARTHEST, is_number
from skills.motion.query import Query

from .checker import CollisionChecker

Array = NDArray[np.float64]

_WIDEST = 1.0  # distance to be kept beyond the margin [m]
_LARGEST = 2**64 - 2  # seed; OMPL is given one more, in 64 bits


class EndpointChecker:
    """Checks both ends of the queries of one group.

    Args:
        robot: Whose.
        group: Name of the group.

    Attributes:
        columns: Where the group's own joints are among the actuated (J,).
    """

    def __init__(self, robot: Robot, group: str) -> None:
        self.columns = columns(robot, group)
        self._actuated, self._own = robot.actuated, robot.actuated_in(group)
        self._endless, self._margin = turning(robot, group), robot.collision.margin
        places = {joint.name: i for i, joint in enumerate(self._actuated)}
        self._rules = [  # the coordinate of each joint, what it is times and plus, and its limits
            (places[mimic.leader], mimic.multiplier, mimic.offset, joint)
            if (mimic := joint.mimic)
            else (places[joint.name], 1.0, 0.0, joint)
            for joint in robot.joints
        ]

    def check(self, checker: CollisionChecker, query: Query) -> tuple[Array, Array]:
        """All actuated joints at the start (A,), and the group's at start, via, goal (K, J).

        All of them in [rad]; to be passed in that order, joints without an end the short way each
        time.

        Raises:
            BadQuery, NotFinite, StartOutOfBounds, GoalOutOfBounds, StartInCollision,
            GoalInCollision: In this order, the first that applies; a via point counts as a goal.
        """
        check_seed(query.seed)
        if not is_number(query.spare, 0.0, _WIDEST):
            raise BadQuery(f"The spare is {shown(query.spare)} m; give 0 to {_WIDEST:g}")
        start, own = finite("start", query.start, self._actuated), self.columns
        names = ["", *(f"via point {i + 1}" for i in range(len(query.via))), ""]
        goals = zip(names[1:], (*query.via, query.goal), strict=True)
        points = [start[own], *(finite(what or "goal", goal, self._own) for what, goal in goals)]
        stations = np.tile(start, (len(points), 1))
        stations[:, own] = points
        for number, row in enumerate(stations.tolist()):
            self._bounded(row, GoalOutOfBounds if number else StartOutOfBounds, names[number])
        for before, row in pairwise(stations):
            row[own] = short_way(self._endless, before[own], row[own])
        blocked = checker.first_invalid_contact(stations, self._margin)
        if blocked:
            number, nearest = blocked
            error = GoalInCollision if number else StartInCollision
            raise error(*nearest, self._margin, names[number])
        return start, stations[:, own]

    def _bounded(self, row: list[float], error: type[OutOfBounds], what: str) -> None:
        """Refuse joints outside their limits, followers included."""
        for place, multiplier, offset, joint in self._rules:
            value = multiplier * row[place] + offset
            lower, upper = max(joint.lower, -FARTHEST), min(joint.upper, FARTHEST)
            if not lower <= value <= upper:
                raise error(joint.name, value, lower, upper, joint.unit, what)


def check_seed(seed: int) -> None:
    """Refuse what cannot be a seed.

    Raises:
        BadQuery: It is no whole number, or OMPL could not hold it.
    """
    if not (isinstance(seed, int) and 0 <= seed <= _LARGEST):
        raise BadQuery(f"The seed is {shown(seed)}; give a whole number from 0 to {_LARGEST}")


def columns(robot: Robot, group: str) -> NDArray[np.intp]:
    """Where the group's own joints are among the actuated (J,)."""
    names = [joint.name for joint in robot.actuated]
    return np.array([names.index(joint.name) for joint in robot.actuated_in(group)], dtype=np.intp)


def turning(robot: Robot, group: str) -> NDArray[np.bool_]:
    """Which of the group's own joints stand the same a whole turn on (J,)."""
    followed = {joint.mimic.leader for joint in robot.joints if joint.mimic}
    joints = robot.actuated_in(group)
    return np.array(
        [joint.continuous and joint.name not in followed for joint in joints], dtype=bool
    )


def short_way(endless: NDArray[np.bool_], start: Array, goal: Array) -> Array:
    """A goal with endless joints turned back to within half a turn of the start, (J,) [rad]."""
    if not endless.any():
        return goal
    turns = np.where(endless, np.round((goal - start) / (2.0 * np.pi)), 0.0)
    return goal - 2.0 * np.pi * turns


def bounds(robot: Robot, group: str) -> tuple[Array, Array]:
    """Limits of the group's own joints that keep their followers within theirs too (J,) [rad]."""
    own = {joint.name: (joint.lower, joint.upper) for joint in robot.actuated_in(group)}
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
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadQuery(f"The {what} {shown(values)} is not all numbers; give radians") from error
    if array.shape != (len(joints),):
        raise BadQuery.count(what, array.size, (joint.name for joint in joints))
    for joint, value in zip(joints, array.tolist(), strict=True):
        if not math.isfinite(value):
            raise NotFinite(what, joint.name, value)
    return array
