"""Inverse kinematics: joint positions that bring a tool to a point, and its axis to a direction.

From each of several places the squared error is lowered step by step (K. Levenberg 1944, D. W.
Marquardt 1963), kept within the limits by projection. The first place is the start, the others are
drawn with the seed. Of all answers that are free the one soonest reached from the start is taken.
"""

import math
import sys
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import Robot, Tool

from .arrays import norms
from .bodies import frame_of
from .contacts import Contacts
from .deadline import Deadline
from .ends import bounds, check_seed, columns, finite, short_way, turning
from .errors import BadQuery, GoalInCollision, NotFinite, StartOutOfBounds, Unreachable, shown
from .measures import FARTHEST
from .model import Model
from .query import Reached, ToolQuery
from .world import Vector

Array = NDArray[np.float64]

_PLACES = 16  # counts, not times: the same query must give the same answer
_STEPS = 60
_GAIN = 1e-3  # share of the squared error that a step must be worth
_NEAR = 1e-6  # a point is reached [m]
_TRUE = 1e-4  # a direction is kept [rad]
_WORTH = 0.1  # of a radian beside a metre


def reached(
    robot: Robot, model: Model, contacts: Contacts, query: ToolQuery, deadline: Deadline
) -> Reached:
    """The nearest free answer.

    Raises:
        BadQuery, NotFinite, StartOutOfBounds: The query makes no sense.
        Unreachable: No answer was found; says how near the tool gets.
        GoalInCollision: There are answers, but none is free.
        PlanTimeout: The time is up.
    """
    start, arm = _checked(robot, query), _Arm(robot, model, query)
    point = np.array(query.point) + (arm.pose(start)[0] if query.relative else 0.0)
    random, answers, misses = np.random.default_rng(query.seed), list[_Found](), list[_Found]()
    for number in range(_PLACES):
        begin = start[arm.columns] if number == 0 else arm.draw(random, start)
        found = arm.solve(start, begin, point, deadline)
        (answers if found.distance <= _NEAR and found.askew <= _TRUE else misses).append(found)
    if not answers:
        best = min(misses, key=lambda miss: miss.distance + _WORTH * miss.askew)
        raise Unreachable(tuple(point), tuple(best.point), best.distance, best.askew)
    answers.sort(key=lambda answer: arm.seconds(start, answer.joints))
    whole = np.tile(start, (len(answers), 1))
    whole[:, arm.columns] = [answer.joints for answer in answers]
    margin = robot.collision.margin
    for row, answer in zip(whole, answers, strict=True):
        if contacts.first_blocked(row[None, :], margin) is None:
            return Reached(tuple(answer.joints.tolist()), len(answers))
    touching = contacts.nearest(whole[0])
    assert touching
    raise GoalInCollision(*touching, margin)


@dataclass(frozen=True)
class _Found:
    """Where a descent ended: the group's joints, the tool, and what is left of the errors."""

    joints: Array
    point: Array
    distance: float
    askew: float


class _Arm:
    """A group and its tool."""

    def __init__(self, robot: Robot, model: Model, query: ToolQuery) -> None:
        self._model, self._data = model, model.kinematics.createData()
        self.columns = columns(robot, query.group)
        self.lower, self.upper = bounds(robot, query.group)
        self._endless = turning(robot, query.group)
        joints = robot.leaders(query.group)
        self._velocity = np.array([joint.velocity for joint in joints])
        indices = [model.kinematics.getJointId(joint.name) for joint in joints]
        self._speeds = np.array([model.kinematics.joints[i].idx_v for i in indices])
        tool = self._tool(robot, query, indices)
        self._frame = frame_of(model.kinematics, tool.link)
        self._offset, self._axis = np.array(tool.offset), _unit(tool.axis)
        self._wanted = None if query.direction is None else _unit(query.direction)

    def _tool(self, robot: Robot, query: ToolQuery, joints: list[int]) -> Tool:
        """What is to be brought there."""
        kinematics, own = self._model.kinematics, robot.tool
        if not query.link and own and self._moves(own.link, joints):
            x, y, z = (a + b for a, b in zip(own.offset, query.offset, strict=True))
            return Tool(own.link, (x, y, z), query.axis or own.axis)
        last = [
            frame.name
            for frame in kinematics.frames
            if frame.type == pin.FrameType.BODY and frame.parentJoint == joints[-1]
        ]
        return Tool(query.link or last[-1], query.offset, query.axis or (0.0, 0.0, 1.0))

    def _moves(self, link: str, joints: list[int]) -> bool:
        kinematics = self._model.kinematics
        joint = kinematics.frames[frame_of(kinematics, link)].parentJoint
        return bool(set(kinematics.supports[joint]) & set(joints))

    def draw(self, random: np.random.Generator, start: Array) -> Array:
        """A place within the limits; where they are infinite, within half a turn of the start."""
        own = start[self.columns]
        lower = np.where(np.isfinite(self.lower), self.lower, own - np.pi)
        upper = np.where(np.isfinite(self.upper), self.upper, own + np.pi)
        return random.uniform(lower, upper)

    def seconds(self, start: Array, joints: Array) -> float:
        """At full speed from the start [s]."""
        return float(np.max(abs(joints - start[self.columns]) / self._velocity))

    def pose(self, configuration: Array) -> tuple[Array, Array]:
        """Place and axis of the tool, all actuated joints being at (A,) [rad]."""
        q = self._model.coordinates(configuration[None, :])[:, 0]
        pin.computeJointJacobians(self._model.kinematics, self._data, q)
        frame = pin.updateFramePlacement(self._model.kinematics, self._data, self._frame)
        return frame.act(self._offset), frame.rotation @ self._axis

    def solve(self, start: Array, begin: Array, point: Array, deadline: Deadline) -> _Found:
        """Lower the error from one place, within the limits."""
        whole, joints, damping = start.copy(), begin, 1e-3
        error, slope, found = self._look(whole, joints, point)
        for _ in range(_STEPS):
            deadline.check()
            gradient = slope.T @ error
            # A joint at its limit that would leave it stands still for this step.
            stuck = (joints <= self.lower) & (gradient > 0) | (joints >= self.upper) & (
                gradient < 0
            )
            move = np.zeros(len(joints))
            free = ~stuck
            part = slope[:, free]
            normal = part.T @ part + damping * np.eye(part.shape[1])
            move[free] = np.linalg.solve(normal, -gradient[free])
            there = np.clip(joints + move, self.lower, self.upper)
            if abs(there - joints).max() < 1e-12:
                break
            ahead = self._look(whole, there, point)
            gain = 1.0 - (ahead[0] @ ahead[0]) / (error @ error)
            if gain > 0.0:
                joints, damping = there, max(0.2 * damping, 1e-12)
                error, slope, found = ahead
                arrived = found.distance < 0.01 * _NEAR and found.askew < 0.01 * _TRUE
                if arrived or gain < _GAIN:
                    break
            else:
                damping *= 5.0
                if damping > 1e6:
                    break
        joints = short_way(self._endless, start[self.columns], joints)
        return _Found(joints, found.point, found.distance, found.askew)

    def _look(self, whole: Array, joints: Array, point: Array) -> tuple[Array, Array, _Found]:
        """The error with the group's joints there, its derivative, and it in words."""
        whole[self.columns] = joints
        place, axis = self.pose(whole)
        jacobian = pin.getFrameJacobian(
            self._model.kinematics, self._data, self._frame, pin.LOCAL_WORLD_ALIGNED
        )[:, self._speeds]
        arm, turns = place - self._data.oMf[self._frame].translation, jacobian[3:]
        error, slope, askew = place - point, jacobian[:3] - pin.skew(arm) @ turns, 0.0
        if self._wanted is not None:
            error = np.concatenate((error, _WORTH * (axis - self._wanted)))
            slope = np.vstack((slope, -_WORTH * pin.skew(axis) @ turns))
            askew = 2.0 * math.asin(min(1.0, 0.5 * float(np.linalg.norm(axis - self._wanted))))
        distance = float(np.linalg.norm(place - point))
        return error, slope, _Found(joints, place, distance, askew)


def _unit(vector: tuple[float, ...]) -> Array:
    array = np.array(vector)
    unit: Array = array / norms(array[None, :])
    return unit


def _checked(robot: Robot, query: ToolQuery) -> Array:
    """All actuated joints at the start."""
    if query.group not in robot.groups:
        raise BadQuery.group(query.group, robot.groups)
    check_seed(query.seed)
    start = finite("start", query.start, robot.actuated)
    for joint, value in zip(robot.actuated, start.tolist(), strict=True):
        if not joint.lower <= value <= joint.upper:
            raise StartOutOfBounds(joint.name, value, joint.lower, joint.upper, joint.unit)
    if not isinstance(query.link, str):
        raise BadQuery(f"The link is {shown(query.link)}; give a name, or none")
    if not isinstance(query.relative, bool):
        raise BadQuery(f"The relative is {shown(query.relative)}; give True or False")
    for what in ("point", "direction", "offset", "axis"):
        vector = getattr(query, what)
        if vector is None and what not in _DISTANCES:
            continue
        _check_vector(what, vector)
        if what in ("direction", "axis") and not any(vector):
            raise BadQuery(f"The {what} is zero; give a vector with a length")
    return start


# The other vectors only point somewhere.
_DISTANCES = ("point", "offset")


def _check_vector(what: str, vector: Vector) -> None:
    if not isinstance(vector, (tuple, list)) or len(vector) != 3:
        raise BadQuery(f"The {what} is {shown(vector)}; give x, y, z")
    for name, value in zip("xyz", vector, strict=True):
        if not isinstance(value, (int, float)) or _beyond_floats(value):
            raise BadQuery(f"The {name} of the {what} is {shown(value)}; give a number")
        if not math.isfinite(value):
            raise NotFinite(name, what, value)
        if what in _DISTANCES and abs(value) > FARTHEST:
            raise BadQuery(f"The {name} of the {what} is {value:g}; give at most {FARTHEST:g} m")


def _beyond_floats(value: float) -> bool:
    return isinstance(value, int) and abs(value) > sys.float_info.max
