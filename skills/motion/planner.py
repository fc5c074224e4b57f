"""Start and goal in, a checked and timed Plan out: every rung in its place."""

import numpy as np
from numpy.typing import NDArray

from hardware import Clock, RealClock, Robot

from .contacts import Contacts
from .curve import Curve
from .deadline import Deadline, Stopwatch
from .ends import bounds, check_ends, columns
from .errors import BadQuery, ModelUnusable, MotionCollides, MotionError
from .model import Model
from .path import find
from .plan import Plan
from .profile import Profile
from .query import Query, Verify
from .reach import levers
from .search import Search
from .space import Space
from .timing import timed
from .verify import check_motion

Array = NDArray[np.float64]


class Planner:
    """Plans for one robot, in this process; for one thread.

    Args:
        robot: Whose motions.
        clock: For deadlines and the milliseconds of each rung.

    Attributes:
        levers: Travel of any point per unit of each actuated joint (A,) [m/rad]; see `reach`.
        contacts: Checks configurations.

    Raises:
        ModelUnusable: The robot cannot be planned with.
    """

    def __init__(self, robot: Robot, clock: Clock | None = None) -> None:
        self._robot, self._clock = robot, clock or RealClock()
        _check_limits(robot)
        self.contacts = Contacts(Model(robot))
        self.levers = levers(robot)
        self._groups: dict[str, _Group] = {}

    def answer(self, request: Query | Verify) -> Plan | None:
        """A plan for a Query; None for a Verify that finds nothing.

        Raises:
            MotionError: As `plan` and `verify`.
        """
        if isinstance(request, Query):
            return self.plan(request)
        if isinstance(request, Verify):
            self.verify(request)
            return None
        raise BadQuery(f"{type(request).__name__} is neither a Query nor a Verify")

    def plan(self, query: Query) -> Plan:
        """The motion a query asks for.

        Raises:
            BadQuery, NotFinite, StartOutOfBounds, GoalOutOfBounds, StartInCollision,
            GoalInCollision, NoPath, PlanTimeout, MotionCollides: The first rung that fails.
        """
        watch = Stopwatch(self._clock)
        try:
            return self._climb(query, watch)
        except MotionError as error:
            error.milliseconds = watch.milliseconds
            raise

    def _climb(self, query: Query, watch: Stopwatch) -> Plan:
        deadline = Deadline(self._clock, query.timeout)
        with watch.rung("ends"):
            start, goal = check_ends(self._robot, self.contacts, query)
        group = self._group(query.group)
        space = self._space(group, start, deadline)
        ends = start[group.columns], goal[group.columns]
        waypoints, curve = find(space, group.search, ends, query.seed, watch)
        with watch.rung("time"):
            curve, profile = _timed(waypoints, curve, group)
        if not curve.straight:
            with watch.rung("check"):
                self._check(space, curve)
        deadline.check()
        return Plan(
            group=query.group,
            joints=group.joints,
            start=start,
            origin=ends[0],
            goal=ends[1],
            seed=query.seed,
            velocity=group.velocity,
            acceleration=group.acceleration,
            waypoints=waypoints,
            curve=curve,
            profile=profile,
            milliseconds=watch.milliseconds,
        )

    def verify(self, request: Verify) -> None:
        """Check a motion as it will be played, straight from each row to the next.

        Raises:
            MotionCollides: The first contact along the motion.
            BadQuery, NotFinite: The rows make no sense.
            PlanTimeout: The time is up.
        """
        deadline = Deadline(self._clock, request.timeout)
        joints = [joint.name for joint in self._robot.actuated]
        check_motion(self.contacts, self.levers, joints, request, deadline)

    def _group(self, name: str) -> "_Group":
        if name not in self._groups:
            self._groups[name] = _Group(self._robot, name)
        return self._groups[name]

    def _space(self, group: "_Group", start: Array, deadline: Deadline) -> Space:
        return Space(
            contacts=self.contacts,
            start=start,
            columns=group.columns,
            levers=self.levers[group.columns],
            margin=self._robot.collision.margin,
            deadline=deadline,
        )

    def _check(self, space: Space, curve: Curve) -> None:
        """Look at all of a bent curve once more; a line was looked at whole.

        What was checked in steps of the margin has proved half the margin in between, so that is
        what it is held to at these other points; see `reach`.

        Raises:
            MotionCollides: It is not free, by a fault of ours.
        """
        rows, proved = space.whole(space.curve(curve)), 0.5 * space.margin
        hit = self.contacts.first_hit(rows, proved)
        if hit is not None:
            nearest = self.contacts.nearest(rows[hit])
            assert nearest
            raise MotionCollides(hit, None, *nearest, proved)


class _Group:
    """What is kept of a group between queries."""

    def __init__(self, robot: Robot, name: str) -> None:
        joints = robot.leaders(name)
        self.joints = tuple(joint.name for joint in joints)
        self.columns = columns(robot, name)
        self.velocity = np.array([joint.velocity for joint in joints])
        self.acceleration = np.array([joint.acceleration for joint in joints])
        self.search = Search(*bounds(robot, name))


def _timed(waypoints: Array, curve: Curve, group: _Group) -> tuple[Curve, Profile]:
    """The curve and its time law; with a stop at every waypoint where bends cannot be timed."""
    if not curve.length:
        return curve, Profile.still()
    profile = timed(curve, group.velocity, group.acceleration)
    if profile is None:
        curve = Curve.through(waypoints, np.zeros(len(waypoints) - 2))
        profile = timed(curve, group.velocity, group.acceleration)
    assert profile
    return curve, profile


def _check_limits(robot: Robot) -> None:
    for joint in robot.joints:
        if not (joint.velocity > 0.0 and joint.acceleration > 0.0 and joint.lower <= joint.upper):
            why = f"{joint.name} has limits [{joint.lower:g}, {joint.upper:g}] rad, "
            why += f"{joint.velocity:g} rad/s, {joint.acceleration:g} rad/s2"
            raise ModelUnusable(str(robot.path), why)
