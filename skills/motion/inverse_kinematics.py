"""Inverse kinematics: joint positions that bring a tool to a point, with its axis in a direction.

A Levenberg-Marquardt descent (K. Levenberg 1944, D. W. Marquardt 1963) reduces the squared error,
within the joint limits. It runs from several starting points: the current configuration, and random
configurations. The result is the collision-free solution with the shortest straight motion from
the current configuration.

The first 16 starting points reach most targets. If no solution is free of collision, the solver
draws 512 more starting points, tries the most promising ones, and continues the best results with
more steps. If it still cannot reach a requested direction, the point gets priority over the
direction. This shows whether the point or the direction is out of reach.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hardware import Robot, Tool
from hardware.loading.dataclass import dataclass
from skills.motion.arrays import Array, joint_positions, norms
from skills.motion.deadline import Deadline
from skills.motion.errors import (
    BadQuery,
    GoalInCollision,
    NotFinite,
    StartOutOfBounds,
    Unreachable,
    shown,
)
from skills.motion.query import Reached, ToolQuery
from skills.motion.timing.time_parameterization import line_duration
from skills.motion.validation import MAX_MAGNITUDE, check_seed
from skills.motion.world import Vector

from .collision.checker import CollisionChecker
from .robot_model.joint_group import JointGroup
from .robot_model.robot_model import RobotModel
from .robot_model.roll_pitch_yaw import axes_across, turn_tolerance, turned

# The number of descents is limited, not their time, so equal queries give equal answers.
_FIRST_SEEDS = 16  # starting points of the first round, with the current configuration
_RANDOM_SEEDS = 512  # starting points drawn for the second round
_MOST_PROMISING = 32  # number of starting points that the second round tries
_CONTINUED = 8  # number of best results that are continued with more steps
_POINT_FIRST_SEEDS = 16  # random starting points of the point-first round, and earlier results
_SEPARATION = 0.1  # smallest RMS distance of two starting points, as a share of the joint ranges
_POINT_TOLERANCE = 1e-6  # [m]
# A stretched arm that moves its tool sideways misses the point by a few microns [m]. A point at
# this distance also counts as reached.
_NEARLY = 5e-6  # [m]
_AXIS_TOLERANCE = 1e-4  # [rad]
_AXIS_WEIGHT = 0.1  # weight of 1 rad of axis error against 1 m of position error [m/rad]
_SMALL_AXIS_WEIGHT = 1e-3  # the weight in the point-first round [m/rad]


class _Effort(NamedTuple):
    """Limits of one descent."""

    steps: int
    gain: float  # smallest relative reduction of the squared error per step


_QUICK, _PATIENT = _Effort(60, 1e-3), _Effort(200, 1e-5)


def solve_ik(
    robot: Robot,
    model: RobotModel,
    group: JointGroup,
    checker: CollisionChecker,
    query: ToolQuery,
    deadline: Deadline,
) -> Reached:
    """Return the collision-free solution with the shortest straight motion from the start.

    Raises:
        BadQuery, NotFinite, StartOutOfBounds: The query is not valid.
        Unreachable: There is no solution. The error has the reachable point that is nearest.
        GoalInCollision: All solutions are in collision.
        PlanTimeout: The deadline passed.
    """
    start = _check_query(robot, query)
    chain = ToolChain(robot, model, group, query)
    point = np.array(query.point) + (chain.tool_pose(start)[0] if query.relative else 0.0)
    margin, solutions, misses = robot.collision.margin, list[_Result](), list[_Result]()

    def duration(solution: _Result) -> float:
        return chain.duration(start, solution.joints)

    def is_free(solution: _Result) -> bool:
        row = group.full(start, solution.joints[None, :])
        return checker.first_invalid(row, margin) is None

    for results in _Search(chain, start, point, query.seed, deadline).rounds():
        reached = sorted((each for each in results if each.reached), key=duration)
        solutions += reached
        misses += [each for each in results if not each.reached]
        for solution in reached:
            if is_free(solution):
                return Reached(tuple(solution.joints.tolist()), len(solutions))
    if not solutions:
        best = min(_nearest(misses), key=lambda miss: miss.angle)
        if best.aligned and best.distance <= _NEARLY and is_free(best):
            return Reached(tuple(best.joints.tolist()), 1)
        points = tuple(point.tolist()), tuple(best.point.tolist())
        raise Unreachable(*points, best.distance, best.angle, query.direction, _POINT_TOLERANCE)
    contact = checker.nearest(group.full(start, min(solutions, key=duration).joints[None, :])[0])
    assert contact
    raise GoalInCollision(*contact, margin)


@dataclass(frozen=True, slots=True)
class _Result:
    """Result of one descent.

    Attributes:
        joints: Positions of the group's joints (J,) [rad].
        point: Position of the tool at these joint positions (3,) [m].
        distance: Distance of the tool from its target point [m].
        angle: Largest angle between an axis of the tool and its target [rad].
        aligned: True if the angle is within its tolerance.
    """

    joints: Array
    point: Array
    distance: float
    angle: float
    aligned: bool

    @property
    def reached(self) -> bool:
        return self.aligned and self.distance <= _POINT_TOLERANCE

    @property
    def error(self) -> float:
        return math.hypot(self.distance, _AXIS_WEIGHT * self.angle)


def _nearest(results: list[_Result]) -> list[_Result]:
    """Return all results that reach the target point, or else the nearest result."""
    least = max(_POINT_TOLERANCE, min(each.distance for each in results))
    return [each for each in results if each.distance <= least]


class _Search:
    """Descents from many starting points, in rounds."""

    def __init__(
        self, chain: "ToolChain", start: Array, point: Array, seed: int, deadline: Deadline
    ) -> None:
        self._chain, self._start, self._point, self._deadline = chain, start, point, deadline
        self._random = np.random.default_rng(seed)

    def rounds(self) -> Iterator[list[_Result]]:
        """Yield the results of each round. The next round runs only if the caller continues."""
        seeds = [self._start[self._chain.columns], *self._draw(_FIRST_SEEDS - 1)]
        found = [self._descend(seed) for seed in seeds]
        yield found[:]
        drawn = [self._evaluate(joints) for joints in self._draw(_RANDOM_SEEDS)]
        seeds = self._separate(sorted(drawn, key=lambda each: each.error), _MOST_PROMISING)
        found += [self._descend(seed) for seed in seeds]
        best = sorted(found, key=lambda each: each.error)[:_CONTINUED]
        found += [self._descend(each.joints, _PATIENT) for each in best if not each.reached]
        yield found[_FIRST_SEEDS:]
        if self._chain.directed and not any(each.reached for each in found):
            near = sorted(drawn, key=lambda each: each.distance)
            seeds = self._separate(near, _POINT_FIRST_SEEDS)
            near = sorted(found, key=lambda each: each.error)
            seeds += self._separate(near, _POINT_FIRST_SEEDS)
            yield self._point_first(seeds)

    def _point_first(self, seeds: list[Array]) -> list[_Result]:
        """Descend to the point first, then to the direction without leaving the point."""
        found = [self._descend(seed, _QUICK, 0.0) for seed in seeds]
        best = sorted(found, key=lambda each: each.distance)[:_CONTINUED]
        found += [self._descend(each.joints, _PATIENT, 0.0) for each in best]
        near = _nearest(found)
        turned = [self._descend(each.joints, _PATIENT, _SMALL_AXIS_WEIGHT) for each in near]
        return found + [self._descend(each.joints, _PATIENT, 0.0) for each in turned]

    def _separate(self, results: list[_Result], count: int) -> list[Array]:
        """Return the configurations of the first results, without those close to an earlier one.

        From close starting points, the descent mostly leads to the same solution.

        Args:
            results: Results, the best first.
            count: Largest number of configurations.
        """
        taken, shares = list[Array](), np.zeros((0, len(self._chain.ranges)))
        for result in results:
            share = result.joints / self._chain.ranges
            if np.all(np.mean((shares - share) ** 2, axis=1) > _SEPARATION**2):
                taken.append(result.joints)
                shares = np.vstack((shares, share))
            if len(taken) == count:
                break
        return taken

    def _draw(self, count: int) -> Iterator[Array]:
        return (self._chain.draw(self._random, self._start) for _ in range(count))

    def _evaluate(self, joints: Array) -> _Result:
        self._deadline.check()
        return self._chain.evaluate(self._start, joints, self._point)

    def _descend(
        self, seed: Array, effort: _Effort = _QUICK, axis_weight: float = _AXIS_WEIGHT
    ) -> _Result:
        chain, start, point = self._chain, self._start, self._point
        return chain.descend(start, seed, point, self._deadline, effort, axis_weight)


class ToolChain:
    """A group of joints and the tool that the group moves.

    Args:
        robot: Description of the robot.
        model: Model of the same robot.
        group: The group.
        query: The query. It names the tool, and the tool's direction or turn.
    """

    def __init__(
        self, robot: Robot, model: RobotModel, group: JointGroup, query: ToolQuery
    ) -> None:
        self._model, self._data, self._group = model, model.kinematics.createData(), group
        self.columns = group.columns
        ranges = group.upper - group.lower
        self.ranges = np.where((ranges > 0.0) & np.isfinite(ranges), ranges, 2.0 * np.pi)
        indices = [model.kinematics.getJointId(name) for name in group.names]
        self._velocity_columns = np.array([model.kinematics.joints[i].idx_v for i in indices])
        tool = self._tool(robot, query, indices)
        self._frame = model.frame_index(tool.link)
        self._offset, self._axis = np.array(tool.offset), _unit(tool.axis)
        # Axes of the tool that have a target direction: none, the tool's axis, or two axes, which
        # together define the tool's orientation.
        self._axes = self._targets = np.zeros((0, 3))
        self._tolerance = _AXIS_TOLERANCE
        if query.turn is not None:
            self._axes = axes_across(self._axis)
            position, rotation = self._pose(np.array(query.start))
            axes = self._axes @ rotation.T
            self._targets = turned(axes, query.turn, position, *self._ends())
            self._tolerance = max(_AXIS_TOLERANCE, turn_tolerance(axes, self._targets))
        elif query.direction is not None:
            self._axes, self._targets = self._axis[None, :], _unit(query.direction)[None, :]
        self.directed = len(self._axes) > 0

    def _tool(self, robot: Robot, query: ToolQuery, joints: list[int]) -> Tool:
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
        joint = kinematics.frames[self._model.frame_index(link)].parentJoint
        return bool(set(kinematics.supports[joint]) & set(joints))

    def _ends(self) -> tuple[Array, Array]:
        """Return the positions of the last and the first joint that move the tool, (3,) each [m].

        Both are the origin of the root if no joint moves the tool.
        """
        kinematics = self._model.kinematics
        root, *above = kinematics.supports[kinematics.frames[self._frame].parentJoint]
        last, first = (above[-1], above[0]) if above else (root, root)
        return self._data.oMi[last].translation, self._data.oMi[first].translation

    def draw(self, random: np.random.Generator, start: Array) -> Array:
        """Return random positions of the group's joints (J,) [rad].

        They are within the joint limits. A joint without limits is at most half a turn from its
        start.
        """
        own, group = start[self.columns], self._group
        lower = np.where(np.isfinite(group.lower), group.lower, own - np.pi)
        upper = np.where(np.isfinite(group.upper), group.upper, own + np.pi)
        return random.uniform(lower, upper)

    def duration(self, start: Array, joints: Array) -> float:
        """Return the duration of the straight motion from the start to the given joints [s]."""
        group = self._group
        return line_duration(joints - start[self.columns], group.velocity, group.acceleration)

    def tool_pose(self, configuration: Array) -> tuple[Array, Array]:
        """Return position [m] and axis of the tool in the root frame, (3,) each.

        Args:
            configuration: All actuated joints (A,) [rad].
        """
        position, rotation = self._pose(configuration)
        return position, rotation @ self._axis

    def _pose(self, configuration: Array) -> tuple[Array, Array]:
        """Return position of the tool (3,) [m] and rotation of its link (3, 3)."""
        q = self._model.coordinates(configuration[None, :])[:, 0]
        pin.computeJointJacobians(self._model.kinematics, self._data, q)
        frame = pin.updateFramePlacement(self._model.kinematics, self._data, self._frame)
        return frame.act(self._offset), frame.rotation

    def evaluate(self, start: Array, joints: Array, point: Array) -> _Result:
        """Return the result at given positions of the group's joints (J,) [rad]: no descent."""
        position, rotation = self._pose(self._group.full(start, joints[None, :])[0])
        return self._result(joints, position, rotation, point)

    def descend(
        self,
        start: Array,
        seed: Array,
        point: Array,
        deadline: Deadline,
        effort: _Effort = _QUICK,
        axis_weight: float = _AXIS_WEIGHT,
    ) -> _Result:
        """Return the result of a descent from one starting point, within the joint limits.

        Args:
            start: All actuated joints (A,) [rad]. Joints outside the group keep these positions.
            seed: Starting point: positions of the group's joints (J,) [rad].
            point: Target of the tool, in the root frame (3,) [m].
            deadline: Deadline of the query.
            effort: Limits of the descent.
            axis_weight: Weight of the axis error [m/rad].
        """
        lower, upper = self._group.lower, self._group.upper
        configuration, joints, damping = start.copy(), seed, 1e-3
        error, jacobian, found = self._linearise(configuration, joints, point, axis_weight)
        for _ in range(effort.steps):
            deadline.check()
            gradient = jacobian.T @ error
            # A joint at its limit keeps its position in this step if it would exceed the limit.
            stuck = (joints <= lower) & (gradient > 0) | (joints >= upper) & (gradient < 0)
            step = np.zeros(len(joints))
            free = ~stuck
            part = jacobian[:, free]
            normal = part.T @ part + damping * np.eye(part.shape[1])
            step[free] = np.linalg.solve(normal, -gradient[free])
            moved = np.clip(joints + step, lower, upper)
            if abs(moved - joints).max() < 1e-12:
                break
            ahead = self._linearise(configuration, moved, point, axis_weight)
            gain = 1.0 - (ahead[0] @ ahead[0]) / (error @ error)
            if gain > 0.0:
                joints, damping = moved, max(0.2 * damping, 1e-12)
                error, jacobian, found = ahead
                aligned = not axis_weight or found.angle < 0.01 * _AXIS_TOLERANCE
                arrived = aligned and found.distance < 0.01 * _POINT_TOLERANCE
                if arrived or gain < effort.gain:
                    break
            else:
                damping *= 5.0
                if damping > 1e6:
                    break
        return replace(found, joints=self._group.nearest_turn(start[self.columns], joints))

    def _linearise(
        self, configuration: Array, joints: Array, point: Array, axis_weight: float
    ) -> tuple[Array, Array, _Result]:
        """Return the weighted error, its Jacobian, and the result at the given joint positions."""
        configuration[self.columns] = joints
        position, rotation = self._pose(configuration)
        jacobian = pin.getFrameJacobian(
            self._model.kinematics, self._data, self._frame, pin.LOCAL_WORLD_ALIGNED
        )[:, self._velocity_columns]
        arm, angular = position - self._data.oMf[self._frame].translation, jacobian[3:]
        error, slope = position - point, jacobian[:3] - pin.skew(arm) @ angular
        for own, target in zip(self._axes, self._targets, strict=True):
            axis = rotation @ own
            error = np.concatenate((error, axis_weight * (axis - target)))
            slope = np.vstack((slope, -axis_weight * pin.skew(axis) @ angular))
        return error, slope, self._result(joints, position, rotation, point)

    def _result(self, joints: Array, position: Array, rotation: Array, point: Array) -> _Result:
        pairs = zip(self._axes, self._targets, strict=True)
        chord = max((float(np.linalg.norm(rotation @ own - to)) for own, to in pairs), default=0.0)
        angle = 2.0 * math.asin(min(1.0, 0.5 * chord))
        distance = float(np.linalg.norm(position - point))
        return _Result(joints, position, distance, angle, angle <= self._tolerance)


def _unit(vector: tuple[float, ...]) -> Array:
    array = np.array(vector)
    unit: Array = array / norms(array[None, :])
    return unit


def _check_query(robot: Robot, query: ToolQuery) -> Array:
    """Check the values of a query. Return all actuated joints at its start (A,) [rad]."""
    check_seed(query.seed)
    start = joint_positions("start", query.start, robot.actuated)
    for joint, value in zip(robot.actuated, start.tolist(), strict=True):
        if not joint.lower <= value <= joint.upper:
            raise StartOutOfBounds(joint.name, value, joint.lower, joint.upper, joint.unit)
    if not isinstance(query.link, str):
        raise BadQuery(f"The link is {shown(query.link)}; give the name of a link, or omit it")
    if not isinstance(query.relative, bool):
        raise BadQuery(f"The value of relative is {shown(query.relative)}; give True or False")
    for what in ("point", "direction", "turn", "offset", "axis"):
        vector = getattr(query, what)
        if vector is None and what not in _LENGTHS:
            continue
        _check_vector(what, vector)
        if what in ("direction", "axis") and not any(vector):
            raise BadQuery(f"The {what} is zero; give a vector with a length")
    return start


_LENGTHS = ("point", "offset")  # vectors in metres; the others are directions or angles


def _check_vector(what: str, vector: Vector) -> None:
    if not isinstance(vector, (tuple, list)) or len(vector) != 3:
        raise BadQuery(f"The {what} is {shown(vector)}; give x, y, z")
    for name, value in zip("xyz", vector, strict=True):
        large = isinstance(value, int) and abs(value) > sys.float_info.max
        if not isinstance(value, (int, float)) or large:
            raise BadQuery(f"The {name} of the {what} is {shown(value)}; give a number")
        if not math.isfinite(value):
            raise NotFinite(f"{name} of the {what}", "", value)
        if what in _LENGTHS and abs(value) > MAX_MAGNITUDE:
            most = f"{MAX_MAGNITUDE:g} m"
            raise BadQuery(f"The {name} of the {what} is {value:g} m; give -{most} to {most}")
