"""Checks the start, via points and goal of a query: joint limits and collisions."""

from itertools import pairwise

import numpy as np

from hardware import Robot
from skills.motion.arrays import Array, joint_positions
from skills.motion.errors import (
    BadQuery,
    GoalInCollision,
    GoalOutOfBounds,
    PositionOutOfBounds,
    StartInCollision,
    StartOutOfBounds,
    shown,
)
from skills.motion.query import MIN_SPEED, Query
from skills.motion.robot_model.joint_group import JointGroup
from skills.motion.validation import MAX_MAGNITUDE, check_seed, is_number

from .checker import CollisionChecker
from .start_contacts import StartContacts

_MAX_SPARE = 1.0  # largest distance to keep beyond the robot's margin [m]


class EndpointChecker:
    """Checks the endpoints of queries.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._actuated, self._margin = robot.actuated, robot.collision.margin
        columns = {joint.name: i for i, joint in enumerate(self._actuated)}
        # For each joint, also mimic joints: column, multiplier and offset of its position, and the
        # joint.
        self._positions = [
            (columns[mimic.leader], mimic.multiplier, mimic.offset, joint)
            if (mimic := joint.mimic)
            else (columns[joint.name], 1.0, 0.0, joint)
            for joint in robot.joints
        ]

    def points(self, query: Query, group: JointGroup) -> tuple[Array, Array]:
        """Check the numbers of a query and return its endpoints.

        Args:
            query: The query.
            group: The group that moves.

        Returns:
            All actuated joints at the start (A,), and the group's joints at start, via points and
            goal (K, J) [rad]. Continuous joints take the shorter direction from each point to the
            next one.

        Raises:
            BadQuery, NotFinite, StartOutOfBounds, GoalOutOfBounds: The first error that applies, in
                this order. A via point counts as a goal.
        """
        check_seed(query.seed)
        if not is_number(query.spare, 0.0, _MAX_SPARE):
            raise BadQuery(f"The spare is {shown(query.spare)} m; give 0 to {_MAX_SPARE:g}")
        if not is_number(query.speed, MIN_SPEED, 1.0):
            raise BadQuery(f"The speed is {shown(query.speed)}; give {MIN_SPEED:g} to 1")
        start = joint_positions("start", query.start, self._actuated)
        names = _names(len(query.via) + 2)
        points = [start[group.columns]]
        for name, goal in zip(names[1:], (*query.via, query.goal), strict=True):
            points.append(joint_positions(name or "goal", goal, group.joints))
        rows = np.tile(start, (len(points), 1))
        rows[:, group.columns] = points
        for number, row in enumerate(rows.tolist()):
            self._check_limits(row, GoalOutOfBounds if number else StartOutOfBounds, names[number])
        for before, row in pairwise(rows):
            row[group.columns] = group.nearest_turn(before[group.columns], row[group.columns])
        return start, rows[:, group.columns]

    def check_free(
        self, rows: Array, checker: CollisionChecker, contacts: StartContacts | None = None
    ) -> None:
        """Check that endpoints are not in collision.

        Args:
            rows: All actuated joints at start, via points and goal (K, A) [rad].
            checker: Checks configurations in the query's world, without the contacts.
            contacts: Contacts of the start that the other points may not deepen. Default: none.

        Raises:
            StartInCollision, GoalInCollision: A point is in collision. A via point counts as a
                goal.
        """
        invalid = checker.first_invalid_contact(rows, self._margin)
        if invalid is None and contacts:
            invalid = contacts.first_deeper(rows)
        if invalid:
            number, contact = invalid
            error = GoalInCollision if number else StartInCollision
            raise error(*contact, self._margin, _names(len(rows))[number])

    def _check_limits(self, row: list[float], error: type[PositionOutOfBounds], what: str) -> None:
        """Check the limits of all joints, also of mimic joints."""
        for column, multiplier, offset, joint in self._positions:
            value = multiplier * row[column] + offset
            lower, upper = max(joint.lower, -MAX_MAGNITUDE), min(joint.upper, MAX_MAGNITUDE)
            if not lower <= value <= upper:
                raise error(joint.name, value, lower, upper, joint.unit, what)


def _names(count: int) -> list[str]:
    """Return the names of all points of a query for messages; start and goal have empty names."""
    return ["", *(f"via point {i}" for i in range(1, count - 1)), ""]
