"""Requests to the planner and their answers."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hardware.loading.dataclass import dataclass

from .errors import BadQuery, MotionError, shown
from .trajectory.plan import Plan
from .world import EMPTY, Body, Vector, World

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .arrays import Array

MIN_SPEED = 0.01  # smallest share of the robot's speed


@dataclass(frozen=True, slots=True)
class Query:
    """Request to move a group from the arm's configuration to a goal. The answer is a Plan.

    Attributes:
        group: Name of the group that moves. All other joints stay at the start.
        start: Positions of all actuated joints, in the order of `robot.actuated` [rad].
        goal: Positions of the group's joints, in the order of `robot.actuated_in(group)` [rad]. A
            continuous joint takes the shorter direction, so its position at the end may differ by
            whole turns. On a searched path, it may take the longer direction.
        seed: Seed of the search. Equal queries give equal plans.
        timeout: Longest time for planning, after the robot and the meshes of the world are loaded
            [s]. A timeout may make planning fail, but never changes a plan.
        via: Waypoints before the goal, in order, each in the form of `goal`. If there is room, the
            motion does not stop at a waypoint: every part of the arm then passes within
            `blend.VIA_TOLERANCE` of its place at the waypoint.
        world: Bodies around the arm and attached to it.
        spare: Distance to keep in addition to the robot's margin, except at start, via points and
            goal [m].
        speed: Share of the robot's speed, `MIN_SPEED` to 1. The motion takes 1 / speed times as
            long: velocity limits are multiplied by speed, acceleration limits by its square.
    """

    group: str
    start: tuple[float, ...]
    goal: tuple[float, ...]
    seed: int = 1
    timeout: float = 5.0
    via: tuple[tuple[float, ...], ...] = ()
    world: World = EMPTY
    spare: float = 0.0
    speed: float = 1.0


def _numbers(what: str, values: "ArrayLike", unit: str) -> "Array":
    from .arrays import readonly  # imports NumPy

    try:
        return readonly(values)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadQuery(f"The {what} {shown(values)} are not all numbers; give {unit}") from error


@dataclasses.dataclass(frozen=True, eq=False)
class Verify:
    """Request to check a motion as the board will execute it. The answer is None if it is free.

    Attributes:
        configurations: All actuated joints, in the order of `robot.actuated` (N, A) [rad]. The arm
            moves along a straight line from each row to the next.
        margin: Distance to keep [m]. As in a plan, links that are in contact at the start may stay
            as close as they are at the start. A single row must keep the margin.
        times: Time of each row (N,) [s], for the error's message. Default: not known.
        timeout: Longest time for the check [s].
        world: Bodies around the arm and attached to it.
        start: All actuated joints at the start of the motion (A,) [rad]. Default: the first row.

    Raises:
        BadQuery: Configurations or times are not all numbers.
    """

    configurations: "Array | Sequence[Sequence[float]]"
    margin: float
    times: "Array | Sequence[float] | None" = None
    timeout: float = 5.0
    world: World = EMPTY
    start: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        rows = _numbers("configurations", self.configurations, "radians")
        object.__setattr__(self, "configurations", rows)
        if self.times is not None:
            object.__setattr__(self, "times", _numbers("times", self.times, "seconds"))


@dataclass(frozen=True, slots=True)
class Rest:
    """Request to time the rest of a stopped motion, from standstill. The answer is a Plan.

    Attributes:
        plan: Plan of the motion that was stopped.
        time: Time of the stop, from the motion's start [s].
        start: All actuated joints at the stop [rad].
        timeout: Longest time for planning [s].
    """

    plan: Plan
    time: float
    start: tuple[float, ...]
    timeout: float = 5.0


@dataclass(frozen=True, slots=True)
class ToolQuery:
    """Request for joint positions that bring a tool to a point. The answer is a Reached.

    Attributes:
        group: Name of the group that moves. All other joints stay at the start.
        start: All actuated joints, in the order of `robot.actuated` [rad]. The answer is the
            solution with the shortest straight motion from this start.
        point: Target of the tool, in the URDF's root frame [m].
        direction: Direction of the tool's axis in the root frame. Default: any direction.
        link: Link that carries the tool. Default: the link of the robot's own tool if the group
            moves this tool, else the last link that the group moves.
        offset: Position of the tool in the frame of `link`; without `link`, relative to the
            robot's own tool [m].
        axis: Axis of the tool in the frame of the link. Default: the axis of the robot's own tool,
            or z.
        relative: True if `point` is relative to the tool's position at the start.
        turn: Roll, pitch and yaw of the tool from its orientation at the start [rad]; see `turned`.
            It replaces `direction`. Default: any orientation.
        seed: Seed of the search.
        timeout: Longest time for the search [s].
        world: Bodies around the arm and attached to it.
    """

    group: str
    start: tuple[float, ...]
    point: Vector
    direction: Vector | None = None
    link: str = ""
    offset: Vector = (0.0, 0.0, 0.0)
    axis: Vector | None = None
    relative: bool = False
    turn: Vector | None = None
    seed: int = 1
    timeout: float = 5.0
    world: World = EMPTY


@dataclass(frozen=True, slots=True)
class Reached:
    """Answer to a ToolQuery.

    Attributes:
        positions: The group's joints, in the order of `robot.actuated_in(group)` [rad].
        found: Number of solutions that were found.
    """

    positions: tuple[float, ...]
    found: int


@dataclass(frozen=True, slots=True)
class Carry:
    """Request to attach a body to another link at its current pose. The answer is the new Body.

    Attributes:
        world: World with the body.
        body: Name of the body.
        link: New link of the body; empty for the URDF's root frame, so that the body does not move
            with the arm.
        positions: All actuated joints at the moment of the change [rad].
        timeout: Longest time for the answer [s].
    """

    world: World
    body: str
    link: str
    positions: tuple[float, ...]
    timeout: float = 5.0


Request = Query | Verify | ToolQuery | Carry | Rest
Answer = Plan | Reached | Body | None
Result = Answer | MotionError

# Attributes of requests: name, type, and description of valid values for messages.
_TYPES: tuple[tuple[str, type | tuple[type, ...], str], ...] = (
    ("group", str, "the name of a group"),
    ("via", (tuple, list), "a tuple of points"),
    ("point", (tuple, list), "x, y, z"),
    ("plan", Plan, "a Plan of this planner"),
    ("world", World, "a World"),
)


def checked_world(request: Request) -> World:
    """Return the world in which a planner checks for collisions; the empty world if it does not."""
    return request.world if isinstance(request, Query | Verify | ToolQuery) else EMPTY


def check_types(request: Request) -> None:
    """Check the types of a request and of its attributes. The planner itself checks the values.

    Raises:
        BadQuery: The request or an attribute has a wrong type.
    """
    if not isinstance(request, Request):
        raise BadQuery(f"A planner does not answer a {type(request).__name__}; send a Query")
    for name, kind, wanted in _TYPES:
        value = getattr(request, name, None)
        if hasattr(request, name) and not isinstance(value, kind):
            raise BadQuery(f"The {name} is {shown(value)}; give {wanted}")
