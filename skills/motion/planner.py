"""Start and goal in, a checked and timed Plan out: every rung in its place."""

import dataclasses
import math
import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hardware import Clock, RealClock, Robot

from .arrays import readonly
from .collision.bodies import files
from .collision.carry import carried
from .collision.checker import CollisionChecker
from .collision.endpoints import EndpointChecker, bounds, finite, turning
from .collision.scene import PlanningScene
from .collision.verify import check_motion
from .deadline import Deadline, Stopwatch
from .errors import BadQuery, ModelUnusable, MotionCollides, MotionError, shown
from .kinematics.inverse import solve_ik
from .kinematics.robot_model import RobotModel
from .measures import FARTHEST, is_number
from .path.curve import Curve
from .path.path import ways
from .path.search import Search
from .path.space import Space, evenly
from .plan import Plan
from .query import Answer, Carry, Query, Reached, Request, Rest, ToolQuery, Verify
from .timing.profile import Profile
from .timing.remaining import check_rest, rest_of
from .timing.timing import timed
from .world import EMPTY, Body, World

Array = NDArray[np.float64]

_WORLDS = 4  # models at a time
_SLOWEST = 1e-9  # limit that a joint can have [rad/s, rad/s2]
_SAMPLES = 200  # of a motion, to find how far it has travelled when


class Planner:
    """Plans for one robot, in this process; for one thread.

    Args:
        robot: Whose motions.
        clock: For deadlines and the milliseconds of each rung.

    Attributes:
        checker: Checks configurations where nothing stands around the arm.

    Raises:
        ModelUnusable: The robot cannot be planned with.
    """

    def __init__(self, robot: Robot, clock: Clock | None = None) -> None:
        self._robot, self._clock = robot, clock or RealClock()
        _check_numbers(robot)
        self._links, self._scenes = RobotModel(robot), dict[World, _Scene]()
        self._groups: dict[str, _Group] = {}
        self.checker = self._scene(EMPTY).checker

    def answer(self, request: Request) -> Answer:
        """A Plan (Query, Rest), Reached (ToolQuery), a Body (Carry), or None (Verify).

        Raises:
            MotionError: As `plan`, `rest`, `reach`, `carry` and `verify`.
        """
        match request:
            case Query():
                return self.plan(request)
            case Verify():
                self.verify(request)
                return None
            case ToolQuery():
                return self.reach(request)
            case Carry():
                return self.carry(request)
            case Rest():
                return self.rest(request)
        raise BadQuery(f"{type(request).__name__} is nothing that a planner can be asked")

    def plan(self, query: Query) -> Plan:
        """The motion a query asks for.

        Raises:
            BadQuery, NotFinite, StartOutOfBounds, GoalOutOfBounds, StartInCollision,
            GoalInCollision, Barred, NoPath, PlanTimeout, MotionCollides: The first rung that fails.
        """
        watch = Stopwatch(self._clock)
        try:
            return self._climb(query, watch)
        except MotionError as error:
            error.milliseconds = watch.milliseconds
            raise

    def _climb(self, query: Query, watch: Stopwatch) -> Plan:
        deadline = Deadline(self._clock, query.timeout)
        if query.world not in self._scenes:
            with watch.stage("world"):
                self._scene(query.world)
        with watch.stage("ends"):
            scene, group = self._scene(query.world), self._group(query.group)
            start, stations = group.ends.check(scene.checker, query)
        space = Space(
            checker=scene.checker,
            start=start,
            columns=group.ends.columns,
            lever_arms=scene.model.lever_arms[:, group.ends.columns],
            margin=self._robot.collision.margin + query.spare,
            proved=0.5 * self._robot.collision.margin + query.spare,
            deadline=deadline,
        )
        with scene.checker.within(deadline):
            found = ways(space, group.search, stations, query.seed, watch)
            waypoints, curve, profile = _timed(found, group, watch)
        with watch.stage("time"):
            plan = Plan(
                group=query.group,
                joints=group.joints,
                start=start,
                origin=stations[0],
                goal=waypoints[-1],
                seed=query.seed,
                velocity=group.velocity,
                acceleration=group.acceleration,
                waypoints=waypoints,
                curve=curve,
                profile=profile,
                milliseconds=watch.milliseconds,  # to which the watch still adds
            )
        if not curve.straight:
            with watch.stage("check"), scene.checker.within(deadline):
                _check(space, plan)
        deadline.check()
        return plan

    def verify(self, request: Verify) -> None:
        """Check a motion as it will be played, straight from each row to the next.

        Raises:
            MotionCollides: The first contact along the motion.
            BadQuery, NotFinite: The rows make no sense.
            PlanTimeout: The time is up.
        """
        deadline = Deadline(self._clock, request.timeout)
        joints = [joint.name for joint in self._robot.actuated]
        scene = self._scene(request.world)
        with scene.checker.within(deadline):
            check_motion(scene.checker, scene.model.lever_arms, joints, request, deadline)

    def reach(self, query: ToolQuery) -> Reached:
        """Joint positions that bring the tool where a query asks for.

        Raises:
            BadQuery, NotFinite, StartOutOfBounds, Unreachable, GoalInCollision, PlanTimeout:
                The first that applies.
        """
        scene, deadline = self._scene(query.world), Deadline(self._clock, query.timeout)
        with scene.checker.within(deadline):
            return solve_ik(self._robot, scene.model, scene.checker, query, deadline)

    def rest(self, request: Rest) -> Plan:
        """What is left of a motion that was stopped, timed from standstill.

        Raises:
            BadQuery, NotFinite: The arm does not stand on its path, or the question makes no sense.
        """
        watch = Stopwatch(self._clock)
        check_rest(request)
        start = finite("start", request.start, self._robot.actuated)
        group = self._group(request.plan.group)
        if request.plan.joints != group.joints:
            moves = ", ".join(request.plan.joints), ", ".join(group.joints)
            raise BadQuery(
                f"The plan moves {moves[0]}, {request.plan.group} {moves[1]}; plan again"
            )
        with watch.stage("time"):
            left = rest_of(request.plan, request.time, start, group.ends.columns)
        return dataclasses.replace(left, milliseconds=watch.milliseconds)

    def carry(self, request: Carry) -> Body:
        """A body where it is, but moving with another link.

        Raises:
            BadWorld: There is no such body, or no such link.
            BadQuery, NotFinite: The positions make no sense.
        """
        body = request.world.body(request.body)
        positions = finite("position", request.positions, self._robot.actuated)
        return carried(self._scene(EMPTY).model, body, request.link, positions)

    def _group(self, name: str) -> "_Group":
        if name not in self._groups:
            if name not in self._robot.groups:
                raise BadQuery.group(name, self._robot.groups)
            self._groups[name] = _Group(self._robot, name)
        return self._groups[name]

    def _scene(self, world: World) -> "_Scene":
        """The model of a world; the empty one is kept, and of others the last few asked for."""
        scene = self._scenes.pop(world, None)
        if scene is None or scene.files != files(world):
            scene = _Scene(self._robot, world, self._links)
        if len(self._scenes) >= _WORLDS:
            del self._scenes[next(other for other in self._scenes if other != EMPTY)]
        self._scenes[world] = scene
        return scene


class _Scene:
    """What is kept of a world between queries."""

    def __init__(self, robot: Robot, world: World, links: RobotModel) -> None:
        self.files = files(world)  # as they are before they are read
        self.model = PlanningScene(robot, world, links)
        self.checker = CollisionChecker(self.model)


def _check(space: Space, plan: Plan) -> None:
    """Look at a bent motion once more, as it is timed.

    A line needs no second look, in time neither: its motion passes through the points between its
    ends and no others, to a rounding, and for all of these half the margin was proved before it was
    timed, where a sample would prove it for one. Followers move in proportion and joints without an
    end count on beyond a turn, so for them too it is the line that was looked at; `Execute` looks
    at its frames besides. What is bent has been proved half the margin all along too, so that is
    what it is held to here; see `reach` and `Space.hit`.

    Raises:
        MotionCollides: It is not free, by a fault of ours.
    """
    space = dataclasses.replace(space, margin=space.proved, proved=0.0)
    times = np.linspace(0.0, plan.duration, _SAMPLES)
    # No joint can be faster between two samples than if it sped up and slowed down all it may, nor
    # than its limit, to the thousandth that is kept.
    speeds, gain = abs(plan.velocities(times)), plan.acceleration * times[1]
    fastest = np.minimum(0.5 * (speeds[1:] + speeds[:-1] + gain), 1.001 * plan.velocity)
    travels = times[1] * fastest @ space.lever_arms.T
    places, travels = evenly(times, travels)
    share = space.hit(lambda shares: plan.sample(places(shares)), travels)
    if share is not None:
        time = float(places(np.array([share]))[0])
        row = space.whole(plan.sample((time,)))[0]
        nearest = space.checker.nearest(row)
        assert nearest
        raise MotionCollides(0, time, *nearest, space.margin)


class _Group:
    """What is kept of a group between queries."""

    def __init__(self, robot: Robot, name: str) -> None:
        joints = robot.actuated_in(name)
        self.joints = tuple(joint.name for joint in joints)
        self.ends = EndpointChecker(robot, name)
        self.velocity = readonly([joint.velocity for joint in joints])
        self.acceleration = readonly([joint.acceleration for joint in joints])
        self.search = Search(*bounds(robot, name), turning(robot, name))


def _timed(
    found: Iterator[tuple[Array, Curve]], group: _Group, watch: Stopwatch
) -> tuple[Array, Curve, Profile]:
    """The first way that can be timed, and its time law."""
    for waypoints, curve in found:
        with watch.stage("time"):
            profile = timed(curve, group.velocity, group.acceleration)
        if profile:
            return waypoints, curve, profile
    raise AssertionError("what stops at every waypoint can be timed")


def _check_numbers(robot: Robot) -> None:
    """Refuse numbers that cannot be planned with, as a Robot made by hand may have them.

    Raises:
        ModelUnusable: A limit, the margin, the floor or the tool's place makes no sense.
    """
    rules, path = robot.collision, str(robot.path)
    floor = 0.0 if rules.floor is None else rules.floor
    for what, value, least in (("margin", rules.margin, 0.0), ("floor", floor, -FARTHEST)):
        if not is_number(value, least, FARTHEST):
            wanted = f"give a number from {least:g} to {FARTHEST:g}"
            raise ModelUnusable(path, f"its {what} is {shown(value)} m; {wanted}")
    for joint in robot.joints:
        if joint.mimic and not joint.mimic.multiplier:
            why = f"{joint.name} follows {joint.mimic.leader} by 0 times; make it a fixed joint"
            raise ModelUnusable(path, why)
        limits = (joint.lower, joint.upper, joint.velocity, joint.acceleration)
        moves = all(is_number(limit, _SLOWEST, sys.float_info.max) for limit in limits[2:])
        most = FARTHEST if joint.unit == "m" else math.inf
        ends = all(is_number(limit, -most, most) for limit in limits[:2])
        if not (moves and ends and joint.lower <= joint.upper):
            shows = [f"{x:g}" if isinstance(x, float) else shown(x) for x in limits]
            why = f"{joint.name} has limits [{shows[0]}, {shows[1]}] {joint.unit}, "
            why += f"{shows[2]} {joint.unit}/s, {shows[3]} {joint.unit}/s2"
            far = f"; give it ends in order, from {-FARTHEST:g} to {FARTHEST:g} m"
            raise ModelUnusable(path, why + far * (joint.unit == "m"))
        mimic = joint.mimic
        if mimic and not all(abs(x) <= FARTHEST for x in (mimic.multiplier, mimic.offset)):
            why = f"{joint.name} follows {mimic.leader} by {mimic.multiplier:g} times and "
            why += f"{mimic.offset:g} {joint.unit}; give at most {FARTHEST:g} either way"
            raise ModelUnusable(path, why)
    if robot.tool and not all(abs(x) <= FARTHEST for x in robot.tool.offset):
        why = f"its tool is at {shown(robot.tool.offset)} m; give at most {FARTHEST:g} either way"
        raise ModelUnusable(path, why)
