"""Retraction: moves an arm out of the contacts in which a motion starts.

Each step moves one or two joints, so that the links in contact move apart.
"""

import math
from itertools import combinations, pairwise

import numpy as np

from skills.motion.arrays import Array
from skills.motion.collision.start_contacts import StartContacts

from .motion_validator import MotionValidator
from .motion_verification import first_deeper

_STEP = {"rad": math.radians(5), "m": 0.005}  # step of a joint
_MAX_STEPS = 8


def lines_leave_or_keep(contacts: StartContacts, others: MotionValidator, points: Array) -> bool:
    """Return True if the lines through points are free, and deepen no contact.

    Args:
        contacts: Contacts of the start.
        others: Checks all other pairs of links.
        points: Start and the next points (K, J) [rad].
    """
    lines = all(others.line_is_free(*leg) for leg in pairwise(points))
    return lines and first_deeper(contacts, others.full(points)) is None


def retract(
    contacts: StartContacts, others: MotionValidator, every: MotionValidator, start: Array
) -> Array | None:
    """Return waypoints that lead from the start out of all contacts.

    The lines from the start through the waypoints are free, and deepen no contact.

    Args:
        contacts: Contacts of the start.
        others: Checks all pairs of links that are not in contact at the start.
        every: Checks all pairs of links.
        start: The start (J,) [rad].

    Returns:
        The waypoints without the start (K, J) [rad], or None if `_MAX_STEPS` steps do not suffice.

    Raises:
        PlanTimeout: The deadline passed.
    """
    group, path, last = every.group, [start], -1
    ones = np.diag([_STEP[joint.unit] for joint in group.joints])
    ones = np.concatenate((ones, -ones))
    steps = np.array([*ones, *(a + b for a, b in combinations(ones, 2))])
    clearance = contacts.clearance(contacts.start)
    for _ in range(_MAX_STEPS):
        every.deadline.check()
        around = path[-1] + steps
        inside = ((group.lower <= around) & (around <= group.upper)).all(axis=1)
        free = np.flatnonzero(inside & others.free_points(around)).tolist()
        found = {k: contacts.clearance(others.full(around[[k]])[0]) for k in free}
        better = sorted((k for k in found if found[k] > clearance), key=lambda k: -found[k])
        for k in better:
            begin = path[:-1] if k == last else path  # the same step again extends its line
            if lines_leave_or_keep(contacts, others, np.array([begin[-1], around[k]])):
                path, last, clearance = [*begin, around[k]], k, found[k]
                break
        else:
            return None
        if every.free_points(np.array(path[-1:])).all():
            return np.array(path[1:])
    return None
