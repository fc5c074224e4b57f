"""The check of an answer against its request.

A worker is another process: its memory may be damaged, and its libraries may have errors. So its
answer is checked before anything is computed from it.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from hardware import MAX_DURATION, Joint, Robot
from hardware.joints import DISPLAY_UNITS
from skills.motion.arrays import Array, Mask
from skills.motion.errors import MotionError, shown
from skills.motion.kinematics.joint_group import JointGroup
from skills.motion.path.curve import Curve
from skills.motion.plan import Plan
from skills.motion.query import Carry, Query, Reached, Request, Rest, Result, ToolQuery, Verify
from skills.motion.timing.time_law import TimeLaw
from skills.motion.validation import is_number, joint_positions
from skills.motion.world import Body

from .messages import InvalidMessage

_SAME = 1e-6  # largest rounding error of a position or of s [rad]
_ROUNDING = 1.01  # factor of velocity and acceleration limits, as in the write guard


class AnswerChecker:
    """Checks the answers of workers.

    Args:
        robot: The robot that they plan for.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._groups = dict[str, JointGroup]()

    def check(self, request: Request, answer: object) -> Result:
        """Return an answer if it fits its request.

        Raises:
            InvalidMessage: It does not.
            BadQuery: The request is not valid, so only an error fits it.
        """
        if isinstance(answer, MotionError):
            _check_durations(answer.milliseconds)
            return answer
        match request, answer:
            case ((Query() | Rest()), Plan()):
                with np.errstate(all="ignore"):
                    self._check_plan(request, answer)
            case ToolQuery(), Reached():
                _check_reached(answer, self._group(request.group))
            case Carry(), Body():
                _check_body(answer, request)
            case Verify(), None:
                pass
            case _:
                raise InvalidMessage(f"{type(request).__name__} with {type(answer).__name__}")
        return answer

    def _check_plan(self, request: Query | Rest, plan: Plan) -> None:
        asked = request if isinstance(request, Query) else request.plan
        group = self._group(asked.group)
        if (plan.group, plan.joints, plan.seed) != (group.name, group.names, asked.seed):
            given = f"{shown(plan.group)} ({shown(plan.joints)}) with seed {shown(plan.seed)}"
            wanted = f"{group.name} ({', '.join(group.names)}) with seed {asked.seed}"
            raise InvalidMessage(f"a plan for {given}, not for {wanted}")
        _check_durations(plan.milliseconds)
        _check_shapes(plan, len(self._robot.actuated), len(group.names))
        start = joint_positions("start", request.start, self._robot.actuated)
        goal = joint_positions("goal", asked.goal, group.joints)
        for limits, own in (plan.velocity, group.velocity), (plan.acceleration, group.acceleration):
            if not np.array_equal(limits, own):
                raise InvalidMessage(
                    f"a plan with the limits {limits.tolist()}, not {own.tolist()}"
                )
        _check_same("starts", plan.start, start, self._robot.actuated)
        _check_same("starts", plan.origin, plan.start[group.columns], group.joints)
        _check_same("ends", plan.goal, goal + _turns(plan.goal - goal, group), group.joints)
        if isinstance(request, Query):
            _check_via(plan, request.via, group)
        _check_curve(plan, group)
        _check_time_law(plan.profile, plan.curve)
        _check_limits(plan, group)

    def _group(self, name: str) -> JointGroup:
        if name not in self._groups:
            self._groups[name] = JointGroup(self._robot, name)
        return self._groups[name]


def _check_durations(milliseconds: Mapping[str, float]) -> None:
    """Check the durations of the stages."""
    if not isinstance(milliseconds, Mapping) or not all(
        isinstance(stage, str) and is_number(spent, 0.0, math.inf)
        for stage, spent in milliseconds.items()
    ):
        raise InvalidMessage(f"the durations {shown(milliseconds)} of its stages")


def _check_shapes(plan: Plan, actuated: int, joints: int) -> None:
    """Check the shapes of all arrays."""
    curve, law = plan.curve, plan.profile
    pieces, knots, waypoints, stops = (
        max(array.shape[0], least) if array.ndim else least
        for array, least in (
            (curve.constant, 1),
            (law.times, 1),
            (plan.waypoints, 1),
            (curve.stops, 0),
        )
    )
    shapes = {
        "start": (plan.start, (actuated,)),
        "origin": (plan.origin, (joints,)),
        "goal": (plan.goal, (joints,)),
        "velocity": (plan.velocity, (joints,)),
        "acceleration": (plan.acceleration, (joints,)),
        "waypoints": (plan.waypoints, (waypoints, joints)),
        "breaks": (curve.breaks, (pieces + 1,)),
        "constant": (curve.constant, (pieces, joints)),
        "linear": (curve.linear, (pieces, joints)),
        "quadratic": (curve.quadratic, (pieces, joints)),
        "stops": (curve.stops, (stops,)),
        "times": (law.times, (knots,)),
        "positions": (law.positions, (knots,)),
        "speeds": (law.speeds, (knots,)),
        "accelerations": (law.accelerations, (knots,)),
    }
    for name, (array, wanted) in shapes.items():
        if array.shape != wanted:
            raise InvalidMessage(f"a plan whose {name} have the shape {array.shape}, not {wanted}")


def _check_same(verb: str, given: Array, wanted: Array, joints: Sequence[Joint]) -> None:
    """Check a start or an end."""
    wrong = ~(abs(given - wanted) <= _SAME)  # also if an overflow gave NaN, as everywhere here
    if wrong.any():
        i = int(wrong.argmax())
        here, there = _shown(joints[i], given[i], wanted[i])
        raise InvalidMessage(f"a plan that {verb} with {joints[i].name} at {here}, not at {there}")


def _turns(differences: Array, group: JointGroup) -> Array:
    """Return the whole turns in differences of joint positions (J,) [rad]."""
    if not group.continuous.any():
        return np.zeros_like(differences)
    return np.where(group.continuous, 2.0 * np.pi * np.round(differences / (2.0 * np.pi)), 0.0)


def _check_via(plan: Plan, via: Sequence[Sequence[float]], group: JointGroup) -> None:
    """Check that the via points are waypoints, in their order."""
    passed = iter(plan.waypoints)
    for number, point in enumerate(via, 1):
        differences = (row - joint_positions("via point", point, group.joints) for row in passed)
        if not any((abs(off - _turns(off, group)) <= _SAME).all() for off in differences):
            raise InvalidMessage(f"a plan that does not pass via point {number}")


def _check_curve(plan: Plan, group: JointGroup) -> None:
    """Check that the curve leads from start to goal without a jump, within the joint limits."""
    curve = plan.curve
    lengths = np.diff(curve.breaks)
    if curve.breaks[0] or not (lengths >= 0.0).all():
        raise InvalidMessage(f"a plan whose breaks are {shown(curve.breaks.tolist())}")
    u = lengths[:, None]
    ends = curve.constant + u * (curve.linear + u * curve.quadratic)
    here = np.concatenate((plan.origin[None, :], ends))
    there = np.concatenate((curve.constant, plan.goal[None, :]))
    if (jumps := ~(abs(here - there) <= _SAME)).any():
        row, i = np.argwhere(jumps)[0]
        before, after = _shown(group.joints[i], here[row, i], there[row, i])
        raise InvalidMessage(f"a plan in which {group.names[i]} jumps from {before} to {after}")
    # A parabola is inside the triangle of its ends and the point where its tangents meet.
    points = np.concatenate((curve.constant, ends, curve.constant + 0.5 * u * curve.linear))
    outside = ~((points >= group.lower - _SAME) & (points <= group.upper + _SAME))
    if outside.any():
        row, i = np.argwhere(outside)[0]
        texts = _shown(group.joints[i], points[row, i], group.lower[i], group.upper[i])
        raise InvalidMessage(
            f"a plan that moves {group.names[i]} to {texts[0]}, outside [{texts[1]}, {texts[2]}]"
        )


def _check_time_law(law: TimeLaw, curve: Curve) -> None:
    """Check that the time law leads along the whole curve, from rest to rest, without a jump."""
    steps, begin, fastest = np.diff(law.times), law.speeds[:-1], _SAME * law.speeds.max()
    places = law.positions[:-1] + steps * (begin + 0.5 * steps * law.accelerations[:-1])
    speeds = begin + steps * law.accelerations[:-1]
    fits = (
        law.times[0] == 0.0
        and (steps >= 0.0).all()
        and abs(law.positions[0]) <= _SAME
        and abs(law.positions[-1] - curve.length) <= _SAME
        and (abs(places - law.positions[1:]) <= _SAME).all()
        and (abs(speeds - law.speeds[1:]) <= fastest).all()
        and (law.speeds >= 0.0).all()
        and max(law.speeds[0], law.speeds[-1]) <= fastest
    )
    if not fits:
        raise InvalidMessage("a plan whose time law does not lead along its path")
    if law.duration > MAX_DURATION:
        raise InvalidMessage(f"a plan of {law.duration:.6g} s; the limit is {MAX_DURATION:g} s")
    # An interval that passes a break would have several derivatives.
    middle = 0.5 * (law.positions[:-1] + law.positions[1:])
    piece = np.searchsorted(curve.breaks[1:-1], middle, side="right")
    inside = (curve.breaks[piece] - law.positions[:-1] <= _SAME) & (
        law.positions[1:] - curve.breaks[piece + 1] <= _SAME
    )
    if not inside.all():
        raise InvalidMessage("a plan whose time law passes a break of its path between two knots")


def _check_limits(plan: Plan, group: JointGroup) -> None:
    """Check velocity and acceleration of every joint, at both ends of every interval."""
    law = plan.profile
    lower, upper, second = plan.curve.intervals(law.positions)
    slopes = np.array((lower, upper))
    speeds = np.array((law.speeds[:-1], law.speeds[1:]))[:, :, None]
    accelerations = slopes * law.accelerations[:-1, None] + second * speeds * speeds
    for values, limits, per in (
        (slopes * speeds, group.velocity, "/s"),
        (accelerations, group.acceleration, "/s2"),
    ):
        over: Mask = ~(abs(values) <= _ROUNDING * limits)
        if over.any():
            end, row, i = np.argwhere(over)[0]
            value, limit = _shown(group.joints[i], abs(values[end, row, i]), limits[i])
            name = group.names[i]
            raise InvalidMessage(f"a plan with {name} at {value}{per}; its limit is {limit}{per}")
    turns = abs(upper[:-1] - lower[1:]) * law.speeds[1:-1, None]
    if not (turns <= (_ROUNDING - 1.0) * group.velocity).all():
        raise InvalidMessage("a plan that does not stop at a corner of its path")


def _check_reached(reached: Reached, group: JointGroup) -> None:
    positions = reached.positions
    if not isinstance(positions, tuple) or len(positions) != len(group.names):
        names = ", ".join(group.names)
        raise InvalidMessage(f"{shown(positions)}, not one position for each of {names}")
    limits = zip(group.joints, positions, group.lower.tolist(), group.upper.tolist(), strict=True)
    for joint, value, lower, upper in limits:
        if not (is_number(value, lower - _SAME, upper + _SAME) and math.isfinite(value)):
            raise InvalidMessage(f"{joint.name} = {shown(value)}, outside [{lower:g}, {upper:g}]")


def _check_body(body: Body, request: Carry) -> None:
    asked = request.world.body(request.body)
    wanted = (asked.name, asked.shape, request.link, asked.touches)
    if (body.name, body.shape, body.link, body.touches) != wanted:
        raise InvalidMessage(
            f"{shown(body)}, not {asked.name} attached to {request.link or 'root'}"
        )
    body.__post_init__()


def _shown(joint: Joint, *values: float) -> list[str]:
    """Return positions of a joint with their unit."""
    scale, unit = DISPLAY_UNITS[joint.unit]
    return [f"{scale * value:.6g} {unit}" for value in values]
