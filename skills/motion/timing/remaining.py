"""What is left of a motion that was stopped on its way."""

import math
import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from skills.motion.arrays import norms
from skills.motion.errors import BadQuery, NotFinite, shown
from skills.motion.measures import is_number
from skills.motion.path.curve import Curve
from skills.motion.plan import Plan
from skills.motion.query import Rest

from .timing import timed

Array = NDArray[np.float64]

# Less way than this is a line [rad].
_NOTHING = 1e-9


def check_rest(request: Rest) -> None:
    """Refuse what has no rest.

    Raises:
        NotFinite: The time is a NaN or an infinity.
        BadQuery: It is no number, or the plan none of ours.
    """
    plan, time = request.plan, request.time
    if isinstance(time, (float, np.floating)) and not math.isfinite(time):
        raise NotFinite("time", "the motion", float(time))
    if not is_number(time, -sys.float_info.max, sys.float_info.max):
        raise BadQuery(f"The time is {shown(time)} s; give a number")
    if not isinstance(plan, Plan):
        raise BadQuery(f"The plan is {shown(plan)}; give one that was found")
    if not ((plan.velocity > 0.0).all() and (plan.acceleration > 0.0).all()):
        raise BadQuery("The limits of the plan are not above 0; give one that was found")


def rest_of(plan: Plan, time: float, start: Array, columns: NDArray[np.intp]) -> Plan:
    """The same path from where it was left, timed anew from standstill.

    Args:
        plan: Which motion.
        time: How far it was followed [s].
        start: Where the arm stands: all actuated joints (A,) [rad].
        columns: Those of the plan's joints (J,).

    Raises:
        BadQuery: The arm does not stand on the path, or what is left of it cannot be timed.
    """
    place = float(plan.profile.at(np.clip(np.array([time]), 0.0, plan.duration))[0][0])
    curve, origin = plan.curve.after(place), start[columns]
    if not np.allclose(curve.base[0], origin, rtol=0.0, atol=_NOTHING):
        raise BadQuery("the arm does not stand where the motion was stopped; plan again")
    waypoints = np.vstack((origin, _ahead(plan.waypoints, curve.length)))
    if np.array_equal(origin, plan.goal):
        curve = Curve.point(plan.goal)
    elif curve.length <= _NOTHING:
        curve = Curve.line(origin, plan.goal)
    profile = timed(curve, plan.velocity, plan.acceleration)
    if profile is None:
        raise BadQuery("what is left of the motion cannot be timed; plan again")
    return replace(
        plan, start=start, origin=origin, waypoints=waypoints, curve=curve, profile=profile
    )


def _ahead(waypoints: Array, length: float) -> Array:
    """The waypoints that are less than a length before the end, along the line through them."""
    left = np.cumsum(norms(np.diff(waypoints, axis=0))[::-1])[::-1]
    return waypoints[1:][np.append(left[1:], 0.0) < max(length, _NOTHING)]
