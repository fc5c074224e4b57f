"""Times the rest of a motion that was stopped, from standstill."""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hardware import Joint
from skills.motion.arrays import Array, joint_positions, norms
from skills.motion.errors import BadQuery, NotFinite, shown
from skills.motion.query import Rest
from skills.motion.robot_model.joint_group import JointGroup
from skills.motion.trajectory.curve import Curve
from skills.motion.trajectory.plan import Plan
from skills.motion.validation import is_number

from .time_parameterization import time_curve

_SHORT = 1e-9  # a remaining path that is not longer than this becomes a line [rad]


def _check(request: Rest) -> None:
    """Check a request.

    Raises:
        NotFinite: The time is NaN or infinite.
        BadQuery: The time is not a number, or the limits of the plan are invalid.
    """
    plan, time = request.plan, request.time
    if isinstance(time, (float, np.floating)) and not math.isfinite(time):
        raise NotFinite("time", "the motion", float(time))
    if not is_number(time, -sys.float_info.max, sys.float_info.max):
        raise BadQuery(f"The time is {shown(time)} s; give a number")
    if not ((plan.velocity > 0.0).all() and (plan.acceleration > 0.0).all()):
        raise BadQuery("The limits of the plan are not above 0; give a Plan of this planner")


def remaining_plan(request: Rest, group: JointGroup, actuated: Sequence[Joint]) -> Plan:
    """Return a plan for the rest of a path, from the stop to the goal, timed from standstill.

    Args:
        request: The motion, and the time and position at which it was stopped.
        group: The group that moves.
        actuated: All actuated joints (A).

    Raises:
        NotFinite: A number of the request is NaN or infinite.
        BadQuery: The request is not valid, the plan is of other joints, the arm is not on the path,
            or the arm would have to stop on the rest of the path.
    """
    _check(request)
    plan = request.plan
    start = joint_positions("start", request.start, actuated)
    if plan.joints != group.names:
        moves, own = ", ".join(plan.joints), ", ".join(group.names)
        raise BadQuery(f"The plan moves {moves}, but {plan.group} has {own}; plan again")
    place = float(plan.profile.at(np.clip(np.array([request.time]), 0.0, plan.duration))[0][0])
    curve, origin = plan.curve.after(place), start[group.columns]
    if not np.allclose(curve.constant[0], origin, rtol=0.0, atol=_SHORT):
        raise BadQuery("The arm is not at the position of the stop; plan again")
    waypoints = np.vstack((origin, _waypoints_ahead(plan.waypoints, curve.length)))
    if np.array_equal(origin, plan.goal):
        curve = Curve.point(plan.goal)
    elif curve.length <= _SHORT:
        curve = Curve.line(origin, plan.goal)
    profile = time_curve(curve, plan.velocity, plan.acceleration, group.most_acceleration)
    if profile is None:
        raise BadQuery("The arm cannot follow the rest of the path without a stop; plan again")
    return replace(
        plan, start=start, origin=origin, waypoints=waypoints, curve=curve, profile=profile
    )


def _waypoints_ahead(waypoints: Array, length: float) -> Array:
    """Return the last waypoints: those whose distance from the goal is less than a length.

    The distance is measured along the lines between the waypoints.
    """
    left = np.cumsum(norms(np.diff(waypoints, axis=0))[::-1])[::-1]
    return waypoints[1:][np.append(left[1:], 0.0) < max(length, _SHORT)]
