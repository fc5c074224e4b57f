"""The motion planner: it answers a Query with a checked and timed Plan.

`Planner.plan` tries one stage after another until it has a path that is proved to be free of
collisions. Then it times the path. A timed motion does not leave its path:

    straight   the line from start to goal
    bend       a path with a single rounded corner; with via points, a corner in each leg
    search     RRT-Connect
    shorten    shortcutting of a searched path
    blend      parabolic blends at the corners, and a proof of the curve
    time       trapezoidal profile on a line, TOPP-RA on a curve

If the robot file allows this, a motion may start in a slight contact, but must not deepen it. If
the straight line would deepen the contact or is not free, the motion first leaves the contact. If
the goal is in the same contact, all stages ignore the links in contact, and the finished plan is
then checked for deeper contacts.

`Planner.reach` solves inverse kinematics; `rest`, `carry` and `verify` answer the other requests.
"""

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise, tee

import numpy as np

from hardware import DISPLAY_UNITS, MAX_DURATION, Clock, RealClock, Robot

from .arrays import Array, joint_positions, norms
from .collision.body_meshes import BodyMeshes
from .collision.checker import CollisionChecker
from .collision.endpoint_checker import EndpointChecker
from .collision.planning_scene import PlanningScene
from .collision.start_contacts import StartContacts
from .deadline import Deadline, Stopwatch
from .errors import BadQuery, ContactDeepened, MotionCollides, StartInCollision, TooLong
from .inverse_kinematics import solve_ik
from .path.blend import blend
from .path.disconnection_proof import check_passable
from .path.motion_validator import MotionValidator
from .path.motion_verification import first_deeper, verify_contacts, verify_rows
from .path.retraction import lines_leave_or_keep, retract
from .path.rrt_connect import find_paths
from .path.shortcut import shortcut
from .path.single_via_point import find_bend, find_corner
from .query import Answer, Carry, Query, Reached, Request, Rest, ToolQuery, Verify, check_types
from .robot_model.joint_group import JointGroup
from .robot_model.robot_model import FLOOR, RobotModel
from .timing.retime_after_pause import remaining_plan
from .timing.time_parameterization import time_curve
from .trajectory.curve import Curve
from .trajectory.plan import Plan
from .world import EMPTY, Body, World

Pairs = frozenset[frozenset[str]]  # pairs of links
Search = Callable[[Array, Array], Iterator[Array]]  # start and goal -> paths

_NONE: Pairs = frozenset()
_MAX_SCENES = 4  # number of scenes kept in memory
_SAMPLES = 200  # number of samples of a plan at which contacts are checked again
_SAME_POINT = 1e-9  # waypoints closer than this are merged [rad]


class Planner:
    """Plans for one robot, in this process. Not thread-safe.

    Args:
        robot: The robot.
        clock: Time source of deadlines and of the stages' durations. Default: the system's.

    Attributes:
        checker: Checks configurations in the empty world.
        meshes_read: Called when the meshes of a request's world are read, if it has any. The
            timeout of the request begins then.

    Raises:
        ModelUnusable: The robot's URDF or numbers are unusable.
    """

    def __init__(self, robot: Robot, clock: Clock | None = None) -> None:
        self._robot, self._clock = robot, clock or RealClock()
        self._model, self._meshes = RobotModel(robot), BodyMeshes()
        self._endpoints = EndpointChecker(robot)
        self._groups = {name: JointGroup(robot, name) for name in robot.groups}
        self._contacts: StartContacts | None = None  # contacts of the last motion
        self._checkers = dict[tuple[World, Pairs], CollisionChecker]()
        self.checker = self._checker(EMPTY)
        self.meshes_read: Callable[[], None] = _do_nothing

    def prepare(self, world: World) -> None:
        """Load a world, so that the first query in this world is as fast as later queries.

        Raises:
            BadWorld: The world is invalid.
        """
        self._checker(world).prepare()

    def answer(self, request: Request) -> Answer:
        """Return the answer to a request: a Plan, a Reached or a Body; None for a Verify.

        Raises:
            BadQuery: The request or one of its attributes is of a wrong type.
            MotionError: `plan`, `rest`, `reach`, `carry` or `verify` failed.
        """
        check_types(request)
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

    def plan(self, query: Query) -> Plan:
        """Return the motion for a query.

        Raises:
            BadQuery, NotFinite, StartOutOfBounds, GoalOutOfBounds, StartInCollision,
            GoalInCollision, Barred, NoPath, TooLong, PlanTimeout, ContactDeepened: A stage failed.
                The error has the durations of all stages so far.
        """
        watch = Stopwatch(self._clock)
        with watch.stage("ends" if (query.world, _NONE) in self._checkers else "world"):
            deadline, checker = self._begin(query)
        with checker.within(deadline):
            with watch.stage("ends"):
                group = self._group(query.group)
                start, points = self._endpoints.points(query, group)
                rows = group.full(start, points)
                try:
                    self._endpoints.check_free(rows, checker)
                except StartInCollision:
                    if not (contacts := self._start_contacts(checker, start)):
                        raise
                    others = self._checker(query.world, contacts.pairs)
                    self._endpoints.check_free(rows, others, contacts)
                else:
                    contacts, others = None, checker
            margin = self._robot.collision.margin
            validator = MotionValidator(
                checker=checker,
                group=group,
                start=start,
                margin=margin + query.spare,
                guaranteed=0.5 * margin + query.spare,
                deadline=deadline,
            )
            if contacts is None:
                return _plan(query, validator, points, watch)
            with others.within(deadline):
                apart = dataclasses.replace(validator, checker=others)
                return _plan_from_contacts(query, contacts, apart, validator, points, watch)

    def verify(self, request: Verify) -> None:
        """Check a motion as the board will execute it: along straight lines from row to row.

        Raises:
            MotionCollides: The motion is in collision. The error has the first contact.
            BadQuery, NotFinite: The request is not valid.
            PlanTimeout: The deadline passed.
        """
        deadline, checker = self._begin(request)
        with checker.within(deadline):
            try:
                verify_rows(checker, request)
            except MotionCollides:
                rows = np.asarray(request.configurations)
                first = rows[0] if request.start is None else request.start
                start = joint_positions("start", first, self._robot.actuated)
                contacts = self._start_contacts(checker, start)
                if not contacts or len(rows) == 1:
                    raise
                free = self._checker(request.world, contacts.pairs)
                with free.within(deadline):
                    verify_rows(free, request)
                verify_contacts(contacts, request)

    def reach(self, query: ToolQuery) -> Reached:
        """Return joint positions that bring the tool to the query's point.

        Raises:
            BadQuery, NotFinite, StartOutOfBounds, Unreachable, GoalInCollision, PlanTimeout: The
                first error that applies.
        """
        deadline, checker = self._begin(query)
        group = self._group(query.group)
        with checker.within(deadline):
            return solve_ik(self._robot, self._model, group, checker, query, deadline)

    def rest(self, request: Rest) -> Plan:
        """Return a plan for the rest of a motion that was stopped. The rest starts from standstill.

        Raises:
            BadQuery, NotFinite: The arm is not on the path, or the request is not valid.
            TooLong: The rest would take too long.
        """
        watch = Stopwatch(self._clock)
        group = self._group(request.plan.group)
        with watch.stage("time"):
            plan = remaining_plan(request, group, self._robot.actuated)
        _check_duration(plan, group)
        return dataclasses.replace(plan, milliseconds=watch.milliseconds)

    def carry(self, request: Carry) -> Body:
        """Return a body at the same pose, attached to another link.

        Raises:
            BadWorld: There is no such body or link.
            BadQuery, NotFinite: The positions are not valid.
        """
        body = request.world.body(request.body)
        positions = joint_positions("position", request.positions, self._robot.actuated)
        return self._checker(EMPTY).scene.attached(body, request.link, positions)

    def _begin(self, request: Query | Verify | ToolQuery) -> tuple[Deadline, CollisionChecker]:
        """Return the deadline of a request, and the checker of its world."""
        meshes = self._meshes.load_all(request.world)  # kept until the scene has them
        if meshes:
            self.meshes_read()
        return Deadline(self._clock, request.timeout), self._checker(request.world)

    def _group(self, name: str) -> JointGroup:
        if name not in self._groups:
            raise BadQuery.group(name, self._groups)
        return self._groups[name]

    def _start_contacts(self, checker: CollisionChecker, start: Array) -> StartContacts | None:
        """Return the contacts in which a motion may start; None if there is no allowed contact."""
        deepest = self._robot.collision.start_contact
        if not deepest:
            return None
        last = self._contacts
        if last is None or last.checker is not checker or not np.array_equal(last.start, start):
            self._contacts = last = StartContacts(checker, start, self._robot.collision.margin)
        return last if last.pairs and -last.deepest.distance <= deepest else None

    def _checker(self, world: World, without: Pairs = _NONE) -> CollisionChecker:
        """Return the checker of a world that does not check the pairs of links in `without`.

        The planner keeps the checkers of the empty world and of the latest worlds.
        """
        key = world, without
        checker = self._checkers.pop(key, None)
        if checker is None or not checker.scene.is_current(world):
            robot = _without(self._robot, without) if without else self._robot
            checker = CollisionChecker(PlanningScene(robot, world, self._model, self._meshes))
        if len(self._checkers) >= _MAX_SCENES:
            del self._checkers[next(other for other in self._checkers if other != (EMPTY, _NONE))]
        self._checkers[key] = checker
        return checker


def _do_nothing() -> None: ...


def _without(robot: Robot, pairs: Pairs) -> Robot:
    """Return a copy of a robot whose rules allow some pairs of links to touch."""
    rules = robot.collision
    ignores = rules.floor_ignores.union(*(pair - {FLOOR} for pair in pairs if FLOOR in pair))
    rules = dataclasses.replace(rules, allowed=rules.allowed | pairs, floor_ignores=ignores)
    return dataclasses.replace(robot, collision=rules)


def _plan(
    query: Query, validator: MotionValidator, points: Array, watch: Stopwatch, retracting: int = 0
) -> Plan:
    """Return a free motion through points of a group.

    Args:
        query: The query.
        validator: Checks motions of the group.
        points: Free start, via points and goal (K, J) [rad].
        watch: Measures each stage.
        retracting: Number of lines at the beginning that leave contacts. They are known to be free.

    Raises:
        Barred, NoPath, TooLong, PlanTimeout: A stage failed.
    """
    group, deadline = validator.group, validator.deadline
    velocity, acceleration = group.limits_at(query.speed)
    for path in _paths(validator, points, query.seed, watch, retracting):
        with watch.stage("time"):
            profile = time_curve(path[1], velocity, acceleration, group.most_acceleration)
        if profile:
            break
    waypoints, curve = path
    assert profile, "a path that stops at every waypoint can be timed"
    with watch.stage("time"):
        plan = Plan(
            group=query.group,
            joints=group.names,
            start=validator.start,
            origin=points[0],
            goal=waypoints[-1],
            seed=query.seed,
            velocity=velocity,
            acceleration=acceleration,
            waypoints=waypoints,
            curve=curve,
            profile=profile,
            milliseconds=watch.milliseconds,  # shared, for later stages
        )
        _check_duration(plan, group)
        deadline.check()
    return plan


def _plan_from_contacts(
    query: Query,
    contacts: StartContacts,
    others: MotionValidator,
    every: MotionValidator,
    points: Array,
    watch: Stopwatch,
) -> Plan:
    """Return a motion that starts in contacts and does not deepen them.

    Args:
        query: The query.
        contacts: Contacts of the start.
        others: Checks all pairs of links that are not in contact at the start.
        every: Checks all pairs of links.
        points: Start, via points and goal (K, J) [rad].
        watch: Measures each stage.

    Raises:
        Barred, NoPath, TooLong, PlanTimeout: A stage failed.
        ContactDeepened: The motion would deepen a contact, and no motion out of the contact was
            found.
    """
    retraction = None
    with watch.stage("contacts"):
        direct = lines_leave_or_keep(contacts, others, points)
        if not direct and every.free_points(points[1:]).all():
            retraction = retract(contacts, others, every, points[0])
    if retraction is None:
        plan = _plan(query, others, points, watch)
    else:
        points = np.insert(points, 1, retraction, axis=0)
        plan = _plan(query, every, points, watch, len(retraction))
    with watch.stage("contacts"):
        rows = every.full(plan.sample(np.linspace(0.0, plan.duration, _SAMPLES)))
        if deeper := first_deeper(contacts, rows):
            raise ContactDeepened(*contacts.at_start(deeper[1]), every.margin)
        every.deadline.check()
    return plan


def _paths(
    validator: MotionValidator, points: Array, seed: int, watch: Stopwatch, retracting: int
) -> Iterator[tuple[Array, Curve]]:
    """Yield waypoints (N, J) [rad] and the free curve along them, best path first.

    The caller needs another curve only if the previous one cannot be timed. The last curve stops at
    every waypoint, so it can always be timed.

    Args:
        validator: Checks motions of the group.
        points: Free start, via points and goal (K, J) [rad].
        seed: Seed of the search.
        watch: Measures each stage.
        retracting: Number of lines at the beginning that leave contacts. They are known to be free.

    Raises:
        Barred: There is no path.
        NoPath: The search found no path.
        PlanTimeout: The deadline passed.
    """
    legs = [leg for leg in pairwise(points) if not np.array_equal(*leg)]
    if not legs:
        yield points[:1], Curve.point(points[0])
        return
    with watch.stage("straight"):
        straight = [k < retracting or validator.line_is_free(*leg) for k, leg in enumerate(legs)]
    if straight == [True]:
        yield np.array(legs[0]), Curve.line(*legs[0])
        return
    if straight == [False]:
        with watch.stage("bend"):
            bend = find_bend(validator, legs[0])
        if bend:
            yield bend
    search: Search = partial(_search, validator, seed)
    attempts = [(validator, search)]
    if straight == [False]:
        # Samples find almost every collision. The first attempt checks samples, and then proves the
        # finished curve, which takes half as long as proofs of all lines and blends. Only if this
        # fails, the second attempt proves them, for the same searched paths.
        first, second = tee(search(*legs[0]))
        samples = dataclasses.replace(validator, proves=False)
        attempts = [(samples, lambda *_: first), (validator, lambda *_: second)]
    for each, search in attempts:
        paths = list(_leg_paths(each, legs, straight, search, watch))
        waypoints = _distinct(np.vstack([paths[0], *(path[1:] for path in paths[1:])]))
        with watch.stage("blend"):
            curve = blend(each, waypoints, np.array([path[-1] for path in paths[:-1]]))
            is_free = each.proves or validator.curve_is_free(curve)
        if is_free:
            yield waypoints, curve
    yield waypoints, Curve.through(waypoints, np.zeros(len(waypoints) - 2))


def _leg_paths(
    validator: MotionValidator,
    legs: list[tuple[Array, Array]],
    straight: list[bool],
    search: Search,
    watch: Stopwatch,
) -> Iterator[Array]:
    """Yield the waypoints of each leg, the part between two points of the query (N, J) [rad].

    At the end of a searched leg, the position of a continuous joint may differ by whole turns. The
    next leg begins at this position.
    """
    here, turns = legs[0][0], np.zeros(len(legs[0][0]))
    for (_, end), is_free in zip(legs, straight, strict=True):
        goal, corner = end + turns, None
        if not is_free and len(legs) > 1:
            with watch.stage("bend"):
                corner = find_corner(validator, (here, goal))
        if is_free:
            path = np.array([here, goal])
        elif corner is not None:
            path = corner
        else:
            path = _shortened(validator, search(here, goal), watch)
        here = path[-1]
        turns = turns + (here - goal)
        yield path


def _search(validator: MotionValidator, seed: int, start: Array, goal: Array) -> Iterator[Array]:
    """Yield paths from start to goal, or to an equivalent goal, as `find_paths` (N, J) [rad]."""
    check_passable(validator, start, goal)
    goals = validator.group.equivalent_goals(start, goal)
    yield from find_paths(validator, start, goals, seed)


def _shortened(validator: MotionValidator, paths: Iterator[Array], watch: Stopwatch) -> Array:
    """Return the first path with free edges, shortened (N, J) [rad]."""
    path = None
    while path is None:
        with watch.stage("search"):
            found = next(paths)
        with watch.stage("shorten"):
            path = shortcut(validator, found)
    return path


def _check_duration(plan: Plan, group: JointGroup) -> None:
    """Check that the duration of a plan is not too long to sample all of the motion.

    Raises:
        TooLong: The duration is more than `hardware.MAX_DURATION`.
    """
    if plan.duration <= MAX_DURATION:
        return
    travels = abs(np.diff(plan.waypoints, axis=0)).sum(axis=0)
    slowest = int(np.argmax(travels / plan.velocity + np.sqrt(travels / plan.acceleration)))
    joint = group.joints[slowest]
    scale, unit = DISPLAY_UNITS[joint.unit]
    limits = scale * plan.velocity[slowest], scale * plan.acceleration[slowest]
    rates = f"{limits[0]:.4g} {unit}/s and {limits[1]:.4g} {unit}/s2"
    raise TooLong(joint.name, plan.duration, MAX_DURATION, rates)


def _distinct(waypoints: Array) -> Array:
    """Return the waypoints without those that almost equal the previous one. Keeps both ends."""
    kept = [waypoints[0]]
    for point in waypoints[1:-1]:
        if norms((point - kept[-1])[None, :])[0] > _SAME_POINT:
            kept.append(point)
    while len(kept) > 1 and norms((waypoints[-1] - kept[-1])[None, :])[0] <= _SAME_POINT:
        kept.pop()
    return np.array([*kept, waypoints[-1]])
