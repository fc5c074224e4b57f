"""Inverse kinematics: joint positions that bring a tool to a point, and its axis to a direction.

From each of several places the squared error is lowered step by step (K. Levenberg 1944, D. W.
Marquardt 1963), kept within the limits by projection. The first place is the start, the others are
drawn with the seed. Of all answers that are free the one soonest reached from the start, straight
and from rest to rest, is taken.

Most goals are reached from some of the first places. Where none is free, or there is none, many
more places are drawn, and the most promising are gone on from, with more patience. Where a
direction then cannot be kept, the point comes first and the direction as far as it goes: so it is
known which of the two is out of reach.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import Robot, Tool
from skills.motion.arrays import norms
from skills.motion.collision.bodies import frame_of
from skills.motion.collision.checker import CollisionChecker
from skills.motion.collision.endpoints import (
    bounds,
    check_seed,
    columns,
    finite,
    short_way,
    turning,
)
from skills.motion.collision.scene import PlanningScene
from skills.motion.deadline import Deadline
from skills.motion.errors import (
    BadQuery,
    GoalInCollision,
    NotFinite,
    StartOutOfBounds,
    Unreachable,
    shown,
)
from skills.motion.measures import FARTHEST
from skills.motion.query import Reached, ToolQuery
from skills.motion.timing.timing import straight
from skills.motion.world import Vector

Array = NDArray[np.float64]

_PLACES = 16  # counts, not times: the same query must give the same answer
_DRAWS = 512
_MORE = 32  # of those drawn
_LAST = 8  # that are gone on from with patience
_APART = 0.1  # from each other, root of the mean square of the joints, in their ranges
_FIRST = 16  # each of those drawn and of those missed, when the point comes first
_NEAR = 1e-6  # a point is reached [m]
_TRUE = 1e-4  # a direction is kept [rad]
_WORTH = 0.1  # of a radian beside a metre
_LITTLE = 1e-3  # the same, where the point comes first


class _Effort(NamedTuple):
    """How long a descent goes on."""

    steps: int
    gain: float  # share of the squared error that a step must be worth


_QUICK, _PATIENT = _Effort(60, 1e-3), _Effort(200, 1e-5)


def solve_ik(
    robot: Robot,
    model: PlanningScene,
    checker: CollisionChecker,
    query: ToolQuery,
    deadline: Deadline,
) -> Reached:
    """The free answer soonest reached.

    Raises:
        BadQuery, NotFinite, StartOutOfBounds: The query makes no sense.
        Unreachable: No answer was found; says how near the tool gets.
        GoalInCollision: There are answers, but none is free.
        PlanTimeout: The time is up.
    """
    start, arm = _checked(robot, query), _Arm(robot, model, query)
    point = np.array(query.point) + (arm.pose(start)[0] if query.relative else 0.0)
    margin, answers, misses = robot.collision.margin, list[_Found](), list[_Found]()
    for found in _Search(arm, start, point, query.seed, deadline).rounds():
        there = [each for each in found if each.there]
        there.sort(key=lambda answer: arm.seconds(start, answer.joints))
        answers += there
        misses += [each for each in found if not each.there]
        for answer in there:
            if checker.first_invalid(arm.whole(start, answer.joints)[None, :], margin) is None:
                return Reached(tuple(answer.joints.tolist()), len(answers))
    if not answers:
        best = min(_nearest(misses), key=lambda miss: miss.askew)
        places = tuple(point.tolist()), tuple(best.point.tolist())
        raise Unreachable(*places, best.distance, best.askew, query.direction, _NEAR)
    soonest = min(answers, key=lambda answer: arm.seconds(start, answer.joints))
    touching = checker.nearest(arm.whole(start, soonest.joints))
    assert touching
    raise GoalInCollision(*touching, margin)


@dataclass(frozen=True)
class _Found:
    """Where a descent ended: the group's joints, the tool, and what is left of the errors."""

    joints: Array
    point: Array
    distance: float
    askew: float

    @property
    def there(self) -> bool:
        return self.distance <= _NEAR and self.askew <= _TRUE

    @property
    def error(self) -> float:
        return math.hypot(self.distance, _WORTH * self.askew)


def _nearest(found: list[_Found]) -> list[_Found]:
    """All that reach the point; if none does, the nearest."""
    least = max(_NEAR, min(each.distance for each in found))
    return [each for each in found if each.distance <= least]


class _Search:
    """Descents from one place after another."""

    def __init__(
        self, arm: "_Arm", start: Array, point: Array, seed: int, deadline: Deadline
    ) -> None:
        self._arm, self._start, self._point, self._deadline = arm, start, point, deadline
        self._random = np.random.default_rng(seed)

    def rounds(self) -> Iterator[list[_Found]]:
        """Where descents ended; each round only where those before gave no free answer."""
        begins = [self._start[self._arm.columns], *self._draw(_PLACES - 1)]
        found = [self._descend(begin) for begin in begins]
        yield found[:]
        drawn = [self._look(joints) for joints in self._draw(_DRAWS)]
        begins = self._apart(sorted(drawn, key=lambda look: look.error), _MORE)
        found += [self._descend(begin) for begin in begins]
        best = sorted(found, key=lambda each: each.error)[:_LAST]
        found += [self._descend(each.joints, _PATIENT) for each in best if not each.there]
        yield found[_PLACES:]
        if self._arm.directed and not any(each.there for each in found):
            near = self._apart(sorted(drawn, key=lambda look: look.distance), _FIRST)
            near += self._apart(sorted(found, key=lambda each: each.error), _FIRST)
            yield self._point_first(near)

    def _point_first(self, begins: list[Array]) -> list[_Found]:
        """As near to the point as it gets, and there as near to the direction."""
        found = [self._descend(begin, _QUICK, 0.0) for begin in begins]
        best = sorted(found, key=lambda each: each.distance)[:_LAST]
        found += [self._descend(each.joints, _PATIENT, 0.0) for each in best]
        near = _nearest(found)
        turned = [self._descend(each.joints, _PATIENT, _LITTLE) for each in near]
        return found + [self._descend(each.joints, _PATIENT, 0.0) for each in turned]

    def _apart(self, looks: list[_Found], count: int) -> list[Array]:
        """The first of them that are not beside one before: basins are wider than that."""
        taken, shares = list[Array](), np.zeros((0, len(self._arm.ranges)))
        for look in looks:
            share = look.joints / self._arm.ranges
            if np.all(np.mean((shares - share) ** 2, axis=1) > _APART**2):
                taken.append(look.joints)
                shares = np.vstack((shares, share))
            if len(taken) == count:
                break
        return taken

    def _draw(self, count: int) -> Iterator[Array]:
        return (self._arm.draw(self._random, self._start) for _ in range(count))

    def _look(self, joints: Array) -> _Found:
        self._deadline.check()
        return self._arm.look(self._start, joints, self._point)

    def _descend(self, begin: Array, effort: _Effort = _QUICK, worth: float = _WORTH) -> _Found:
        arm, start, point = self._arm, self._start, self._point
        return arm.solve(start, begin, point, self._deadline, effort, worth)


class _Arm:
    """A group and its tool."""

    def __init__(self, robot: Robot, model: PlanningScene, query: ToolQuery) -> None:
        self._model, self._data = model, model.kinematics.createData()
        self.columns = columns(robot, query.group)
        self.lower, self.upper = bounds(robot, query.group)
        ranges = self.upper - self.lower
        self.ranges = np.where((ranges > 0.0) & np.isfinite(ranges), ranges, 2.0 * np.pi)
        self._endless = turning(robot, query.group)
        joints = robot.actuated_in(query.group)
        self._velocity = np.array([joint.velocity for joint in joints])
        self._acceleration = np.array([joint.acceleration for joint in joints])
        indices = [model.kinematics.getJointId(joint.name) for joint in joints]
        self._speeds = np.array([model.kinematics.joints[i].idx_v for i in indices])
        tool = self._tool(robot, query, indices)
        self._frame = frame_of(model.kinematics, tool.link)
        self._offset, self._axis = np.array(tool.offset), _unit(tool.axis)
        self._wanted = None if query.direction is None else _unit(query.direction)
        self.directed = query.direction is not None

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
        """Straight from the start, from rest to rest [s]."""
        return straight(joints - start[self.columns], self._velocity, self._acceleration)

    def whole(self, start: Array, joints: Array) -> Array:
        """All actuated joints (A,), the group's being there."""
        configuration = start.copy()
        configuration[self.columns] = joints
        return configuration

    def pose(self, configuration: Array) -> tuple[Array, Array]:
        """Place and axis of the tool, all actuated joints being at (A,) [rad]."""
        q = self._model.coordinates(configuration[None, :])[:, 0]
        pin.computeJointJacobians(self._model.kinematics, self._data, q)
        frame = pin.updateFramePlacement(self._model.kinematics, self._data, self._frame)
        return frame.act(self._offset), frame.rotation @ self._axis

    def look(self, start: Array, joints: Array, point: Array) -> _Found:
        """The tool with the group's joints there."""
        place, axis = self.pose(self.whole(start, joints))
        return self._found(joints, place, axis, point)

    def solve(
        self,
        start: Array,
        begin: Array,
        point: Array,
        deadline: Deadline,
        effort: _Effort = _QUICK,
        worth: float = _WORTH,
    ) -> _Found:
        """Lower the error from one place, within the limits; a radian is worth so many metres."""
        whole, joints, damping = start.copy(), begin, 1e-3
        error, slope, found = self._slope(whole, joints, point, worth)
        for _ in range(effort.steps):
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
            ahead = self._slope(whole, there, point, worth)
            gain = 1.0 - (ahead[0] @ ahead[0]) / (error @ error)
            if gain > 0.0:
                joints, damping = there, max(0.2 * damping, 1e-12)
                error, slope, found = ahead
                kept = not worth or found.askew < 0.01 * _TRUE
                arrived = kept and found.distance < 0.01 * _NEAR
                if arrived or gain < effort.gain:
                    break
            else:
                damping *= 5.0
                if damping > 1e6:
                    break
        joints = short_way(self._endless, start[self.columns], joints)
        return _Found(joints, found.point, found.distance, found.askew)

    def _slope(
        self, whole: Array, joints: Array, point: Array, worth: float
    ) -> tuple[Array, Array, _Found]:
        """The error with the group's joints there, its derivative, and it in words."""
        whole[self.columns] = joints
        place, axis = self.pose(whole)
        jacobian = pin.getFrameJacobian(
            self._model.kinematics, self._data, self._frame, pin.LOCAL_WORLD_ALIGNED
        )[:, self._speeds]
        arm, turns = place - self._data.oMf[self._frame].translation, jacobian[3:]
        error, slope = place - point, jacobian[:3] - pin.skew(arm) @ turns
        if self._wanted is not None:
            error = np.concatenate((error, worth * (axis - self._wanted)))
            slope = np.vstack((slope, -worth * pin.skew(axis) @ turns))
        return error, slope, self._found(joints, place, axis, point)

    def _found(self, joints: Array, place: Array, axis: Array, point: Array) -> _Found:
        askew = 0.0
        if self._wanted is not None:
            askew = 2.0 * math.asin(min(1.0, 0.5 * float(np.linalg.norm(axis - self._wanted))))
        return _Found(joints, place, float(np.linalg.norm(place - point)), askew)


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
            raise NotFinite(f"{name} of the {what}", "", value)
        if what in _DISTANCES and abs(value) > FARTHEST:
            raise BadQuery(f"The {name} of the {what} is {value:g}; give at most {FARTHEST:g} m")


def _beyond_floats(value: float) -> bool:
    return isinstance(value, int) and abs(value) > sys.float_info.max
