"""Checks that the answer of a worker fits its request.

A worker is another process. Its memory may be damaged, and its libraries may have errors. Therefore
its answer is checked before it is used. Only the distance to obstacles is not computed again,
because this would take as long as in the worker.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hardware import MAX_DURATION, Joint, Robot
from skills.motion.arrays import Array, joint_positions
from skills.motion.errors import MotionError, shown
from skills.motion.query import Carry, Query, Reached, Request, Rest, Result, ToolQuery, Verify
from skills.motion.robot_model.joint_group import JointGroup
from skills.motion.robot_model.roll_pitch_yaw import axes_across, turn_tolerance, turned
from skills.motion.trajectory.curve import Curve
from skills.motion.trajectory.plan import Plan
from skills.motion.trajectory.time_law import TimeLaw
from skills.motion.validation import MAX_MAGNITUDE, is_number
from skills.motion.world import Body

from .messages import InvalidMessage

# This function needs half of the time of the array's method `all`.
_all = partial(np.logical_and.reduce, axis=None)
_SAME = 1e-6  # largest rounding error of a position or of s [rad]
_NEAR = 1e-5  # largest distance of a tool from its target: ten times that of the solver [m]
_ALIGNED = 1e-3  # largest angle of a tool's axis from its direction: ten times the solver's [rad]
_ROUNDING = 0.01  # share by which speeds and accelerations may exceed limits, as in the write guard


class AnswerChecker:
    """Checks the answers of workers.

    Args:
        robot: The robot for which the workers plan.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._joints = robot, robot.actuated
        self._groups = dict[str, JointGroup]()

    def check(self, request: Request, answer: object) -> Result:
        """Return an answer if it fits its request.

        Raises:
            InvalidMessage: The answer does not fit the request.
            BadQuery: The request is not valid, so only an error is a valid answer.
        """
        if isinstance(answer, MotionError):
            _check_durations(answer.milliseconds)
            return answer
        match request, answer:
            case ((Query() | Rest()), Plan()):
                with np.errstate(all="ignore"):
                    self._check_plan(request, answer)
            case ToolQuery(), Reached():
                try:
                    with np.errstate(all="ignore"):
                        self._check_reached(request, answer)
                except (TypeError, ValueError, ArithmeticError) as error:
                    raise InvalidMessage("a solution of an invalid query") from error
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
        joints, all_joints = group.joints, self._joints
        _check_shapes(plan, len(all_joints), len(joints))
        start = joint_positions("start", request.start, all_joints)
        goal = group.nearest_turn(plan.goal, joint_positions("goal", asked.goal, joints))
        if isinstance(request, Query):
            velocity, acceleration = group.limits_at(request.speed)
        else:
            velocity, acceleration = request.plan.velocity, request.plan.acceleration
        for kind, limits, own, per in (
            ("velocity", plan.velocity, velocity, "/s"),
            ("acceleration", plan.acceleration, acceleration, "/s2"),
        ):
            _check_equal(f"a plan with the {kind} limit of", limits, own, joints, per)
        _check_equal("a plan that starts with", plan.start, start, all_joints)
        origin = plan.start[group.columns]
        _check_equal("a plan that starts with", plan.origin, origin, joints)
        _check_equal("a plan that ends with", plan.goal, goal, joints)
        if isinstance(request, Query):
            _check_via(plan, request.via, group)
        _check_curve(plan, group)
        _check_time_law(plan.profile, plan.curve)
        _check_limits(plan, group)

    def _check_reached(self, request: ToolQuery, reached: Reached) -> None:
        """Check that the tool is at its target.

        Skips the check if only the planner knows the tool: the request names no link, and the group
        does not move the robot's own tool.
        """
        group, own = self._group(request.group), self._robot.tool
        _check_positions(reached, group)
        link, offset, axis = request.link, np.array(request.offset), request.axis or (0.0, 0.0, 1.0)
        if not link:
            above = self._robot.kinematics.joints_above(own.link) if own else []
            if not own or {joint.name for joint in above}.isdisjoint(group.names):
                return
            link, offset, axis = own.link, offset + own.offset, request.axis or own.axis
        start = joint_positions("start", request.start, self._joints)
        (there,) = group.full(start, np.array([reached.positions]))
        tool, tip = (self._locate(link, each, there) for each in (offset, offset + axis))
        target = np.array(request.point)
        if request.relative:
            target = target + self._locate(link, offset, start)
        if not (far := math.dist(tool, target)) <= _NEAR:
            words = f"a solution with the tool {1000 * far:.6g} mm from its target"
            raise InvalidMessage(words)
        if request.direction is not None:
            wanted = np.array(request.direction) / math.hypot(*request.direction)
            off = math.dist((tip - tool) / math.dist(tip, tool), wanted)
            _check_aligned(off, _ALIGNED, "direction")
        if request.turn is not None:
            axes = axes_across(np.array(axis) / math.hypot(*axis))

            def seen(configuration: Array) -> Array:
                origin = self._locate(link, offset, configuration)
                ends = [self._locate(link, offset + each, configuration) for each in axes]
                return np.array(ends) - origin

            above = self._robot.kinematics.joints_above(link)
            *_, first = moved = [each.child for each in above if each.type != "fixed"] or [""]
            points = (self._locate(each, np.zeros(3), start) for each in (moved[0], first))
            tool = self._locate(link, offset, start)
            wanted = turned(before := seen(start), request.turn, tool, *points)
            off = float(np.linalg.norm(seen(there) - wanted, axis=1).max())
            _check_aligned(off, _ALIGNED + turn_tolerance(before, wanted), "orientation")

    def _locate(self, link: str, offset: Array, configuration: Array) -> Array:
        """Return the position of a point of a link in the root frame (3,) [m].

        Args:
            link: Name of the link.
            offset: Position of the point in the frame of the link (3,) [m].
            configuration: All actuated joints (A,) [rad].
        """
        names = (joint.name for joint in self._joints)
        positions = dict(zip(names, configuration.tolist(), strict=True))
        x, y, z = offset.tolist()
        return np.array(self._robot.kinematics.locate(link, (x, y, z), positions))

    def _group(self, name: str) -> JointGroup:
        if name not in self._groups:
            self._groups[name] = JointGroup(self._robot, name)
        return self._groups[name]


def _check_aligned(off: float, most: float, what: str) -> None:
    """Check the direction of an axis of a tool.

    Args:
        off: Distance between the ends of the axis and of its target, both of length 1.
        most: Largest allowed distance.
        what: Name of the target, for the message.
    """
    if not off <= most:
        angle = math.degrees(2.0 * math.asin(min(1.0, 0.5 * off)))
        raise InvalidMessage(f"a solution with the tool {angle:.6g} deg from its {what}")


def _check_durations(milliseconds: Mapping[str, float]) -> None:
    """Check that the durations of planning stages are numbers of at least 0, by name."""
    if not isinstance(milliseconds, Mapping) or not all(
        isinstance(stage, str) and is_number(spent, 0.0, math.inf)
        for stage, spent in milliseconds.items()
    ):
        raise InvalidMessage(f"invalid durations of its stages: {shown(milliseconds)}")


def _check_shapes(plan: Plan, actuated: int, joints: int) -> None:
    """Check the shapes of all arrays of a plan.

    Args:
        plan: The plan.
        actuated: Number of actuated joints of the robot.
        joints: Number of actuated joints of the group.
    """
    curve, law = plan.curve, plan.profile
    rows, breaks, knots = (
        max((array.shape or (1,))[0], 1) for array in (plan.waypoints, curve.breaks, law.times)
    )
    pieces = max(breaks - 1, 1)
    for name, array, wanted in (
        ("start", plan.start, (actuated,)),
        ("origin", plan.origin, (joints,)),
        ("goal", plan.goal, (joints,)),
        ("velocity", plan.velocity, (joints,)),
        ("acceleration", plan.acceleration, (joints,)),
        ("waypoints", plan.waypoints, (rows, joints)),
        ("breaks", curve.breaks, (pieces + 1,)),
        ("constant", curve.constant, (pieces, joints)),
        ("linear", curve.linear, (pieces, joints)),
        ("quadratic", curve.quadratic, (pieces, joints)),
        ("stops", curve.stops, (curve.stops.size,)),
        ("times", law.times, (knots,)),
        ("positions", law.positions, (knots,)),
        ("speeds", law.speeds, (knots,)),
        ("accelerations", law.accelerations, (knots,)),
    ):
        if array.shape != wanted:
            raise InvalidMessage(f"a plan whose {name} have the shape {array.shape}, not {wanted}")


def _check_equal(
    what: str, values: Array, right: Array, joints: Sequence[Joint], per: str = ""
) -> None:
    """Check that values of joints (..., J) equal the expected values, except for rounding.

    Args:
        what: First words of the message.
        values: Values of the answer. NaN is wrong.
        right: The expected values, of the same shape.
        joints: The joints (J).
        per: Text after the unit of the joint, such as `/s`.
    """
    if values.tobytes() == right.tobytes():  # a fast check for the usual case
        return
    same = abs(values - right) <= _SAME
    if not _all(same):
        joint, value, wanted = _first(~same, joints, per, values, right)
        raise InvalidMessage(f"{what} {joint} at {value}, not at {wanted}")


def _check_within(
    what: str,
    values: Array,
    lower: Array,
    upper: Array,
    joints: Sequence[Joint],
    per: str = "",
    slack: float | Array = _SAME,
) -> None:
    """Check values of joints (..., J) against limits.

    Args:
        what: First words of the message.
        values: Values of the answer. NaN is outside of all limits.
        lower: Lower limits.
        upper: Upper limits.
        joints: The joints (J).
        per: Text after the unit of the joint, such as `/s`.
        slack: Largest rounding error by which a value may exceed a limit.
    """
    inside = (values >= lower - slack) & (values <= upper + slack)
    if not _all(inside):
        joint, value, low, high = _first(~inside, joints, per, values, lower, upper)
        raise InvalidMessage(f"{what} {joint} at {value}, outside [{low}, {high}]")


def _first(
    wrong: NDArray[np.bool_], joints: Sequence[Joint], per: str, *arrays: Array
) -> list[str]:
    """Return the name of the joint of the first wrong value, and texts of the values at its place.

    Args:
        wrong: True for each wrong value (..., J).
        joints: The joints (J).
        per: Text after the unit of the joint, such as `/s`.
        arrays: Arrays that have a value at the same place.
    """
    at = tuple(np.argwhere(wrong)[0])
    joint = joints[at[-1]]
    values = [np.broadcast_to(each, wrong.shape)[at] for each in arrays]
    return [joint.name, *(joint.words(value, 6) + per for value in values)]


def _check_via(plan: Plan, via: Sequence[Sequence[float]], group: JointGroup) -> None:
    """Check that all via points are waypoints of the plan, in the same order."""
    passed = iter(plan.waypoints)
    for number, point in enumerate(via, 1):
        wanted = joint_positions("via point", point, group.joints)
        if not any((abs(row - group.nearest_turn(row, wanted)) <= _SAME).all() for row in passed):
            raise InvalidMessage(f"a plan that does not pass via point {number}")


def _check_curve(plan: Plan, group: JointGroup) -> None:
    """Check that the curve leads from start to goal without a jump, within the joint limits."""
    curve = plan.curve
    lengths = curve.breaks[1:] - curve.breaks[:-1]
    if curve.breaks[0] or not _all(lengths >= 0.0):
        raise InvalidMessage(f"a plan whose breaks are {shown(curve.breaks.tolist())}")
    u = lengths[:, None]
    ends = curve.constant + u * (curve.linear + u * curve.quadratic)
    here = np.concatenate((plan.origin[None, :], ends))
    there = np.concatenate((curve.constant, plan.goal[None, :]))
    _check_equal("a plan that continues with", there, here, group.joints)
    # A parabola is inside the triangle of its two ends and the intersection of its tangents.
    points = np.concatenate((curve.constant, ends, curve.constant + 0.5 * u * curve.linear))
    _check_within("a plan with", points, group.lower, group.upper, group.joints)


def _check_time_law(law: TimeLaw, curve: Curve) -> None:
    """Check that the time law covers the curve without a jump, and stands still at both ends."""
    lower, upper, begin = law.positions[:-1], law.positions[1:], law.speeds[:-1]
    steps, fastest = law.times[1:] - law.times[:-1], _SAME * law.speeds.max()
    gained = steps * law.accelerations[:-1]
    fits = (
        law.times[0] == 0.0
        and _all(steps >= 0.0)
        and abs(law.positions[0]) <= _SAME
        and abs(law.positions[-1] - curve.length) <= _SAME
        and _all(abs(lower + steps * (begin + 0.5 * gained) - upper) <= _SAME)
        and _all(abs(begin + gained - law.speeds[1:]) <= fastest)
        and _all(law.speeds >= 0.0)
        and max(law.speeds[0], law.speeds[-1]) <= fastest
    )
    if not fits:
        raise InvalidMessage("a plan whose time law does not cover its path")
    if law.duration > MAX_DURATION:
        raise InvalidMessage(f"a plan of {law.duration:.6g} s; the limit is {MAX_DURATION:g} s")
    # An interval across a break would have several derivatives.
    piece = curve.breaks[1:-1].searchsorted(0.5 * (lower + upper), side="right")
    before, after = curve.breaks[piece] - lower, upper - curve.breaks[piece + 1]
    if not _all(np.maximum(before, after) <= _SAME):
        raise InvalidMessage("a plan whose time law passes a break of its path between two knots")


def _check_limits(plan: Plan, group: JointGroup) -> None:
    """Check velocity and acceleration of every joint, at both ends of each interval of knots."""
    law = plan.profile
    lower, upper, second = plan.curve.intervals(law.positions)
    slopes = np.array((lower, upper))
    speeds = np.array((law.speeds[:-1], law.speeds[1:]))[:, :, None]
    accelerations = slopes * law.accelerations[:-1, None] + second * speeds * speeds
    for values, limits, per in (
        (slopes * speeds, plan.velocity, "/s"),
        (accelerations, plan.acceleration, "/s2"),
    ):
        _check_within("a plan with", values, -limits, limits, group.joints, per, _ROUNDING * limits)
    turns = abs(upper[:-1] - lower[1:]) * law.speeds[1:-1, None]
    if not _all(turns <= _ROUNDING * plan.velocity):
        raise InvalidMessage("a plan that does not stop at a corner of its path")


def _check_positions(reached: Reached, group: JointGroup) -> None:
    given, most = reached.positions, MAX_MAGNITUDE
    numbers = isinstance(given, tuple) and all(is_number(each, -most, most) for each in given)
    if not numbers or len(given) != len(group.names):
        names = ", ".join(group.names)
        raise InvalidMessage(f"{shown(given)}, not one position for each of {names}")
    positions = np.array(given)
    _check_within("a solution with", positions, group.lower, group.upper, group.joints)


def _check_body(body: Body, request: Carry) -> None:
    asked = request.world.body(request.body)
    wanted = (asked.name, asked.shape, request.link, asked.touches)
    if (body.name, body.shape, body.link, body.touches) != wanted:
        raise InvalidMessage(
            f"{shown(body)}, not {asked.name} attached to {request.link or 'root'}"
        )
    body.__post_init__()
