"""Requests to the planner and their answers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .errors import BadQuery, MotionError, shown
from .trajectory.plan import Plan
from .world import EMPTY, Body, Vector, World

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .arrays import Array

MIN_SPEED = 0.01  # least share of the robot's speed


@dataclass(frozen=True, slots=True)
class Query:
    """Move a group from the arm's configuration to a goal. The answer is a Plan.

    Attributes:
        group: Name of the group that moves. All other joints stay at the start.
        start: All actuated joints, in the order of `robot.actuated` [rad].
        goal: The group's joints, in the order of `robot.actuated_in(group)` [rad]. A continuous
            joint takes the shorter direction, so its value at the end may differ by whole turns. If
            a path must be searched, it may take the longer one.
        seed: Seed of the search. Equal queries give equal plans.
        timeout: Time for planning [s], from when a worker has loaded the robot. It can make a plan
            fail, and never changes one.
        via: Waypoints before the goal, each as `goal`, in order. The motion does not stop there if
            it can be blended. No part of the arm is then further off than `blend.VIA_TOLERANCE`.
        world: Bodies around the arm and attached to it.
        spare: Distance to keep between the ends, in addition to the robot's margin [m].
        speed: Share of the robot's speed, `MIN_SPEED` to 1. The motion takes 1 / speed times as
            long: velocity limits are scaled by it, acceleration limits by its square.
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


@dataclass(frozen=True, eq=False)
class Verify:
    """Check a motion as it will be played. The answer is None if it is free.

    Attributes:
        configurations: All actuated joints, in the order of `robot.actuated` (N, A) [rad]. The arm
            moves along a straight line from each row to the next.
        margin: Distance to keep [m].
        times: Time of each row (N,) [s], for the error's message. Default: not known.
        timeout: Time for the check [s].
        world: Bodies around the arm and attached to it.

    Raises:
        BadQuery: Configurations or times are not all numbers.
    """

    configurations: "Array | Sequence[Sequence[float]]"
    margin: float
    times: "Array | Sequence[float] | None" = None
    timeout: float = 5.0
    world: World = EMPTY

    def __post_init__(self) -> None:
        rows = _numbers("configurations", self.configurations, "radians")
        object.__setattr__(self, "configurations", rows)
        if self.times is not None:
            object.__setattr__(self, "times", _numbers("times", self.times, "seconds"))


@dataclass(frozen=True, slots=True)
class Rest:
    """Time the rest of a stopped motion, from standstill. The answer is a Plan.

    Attributes:
        plan: The motion.
        time: Time of the stop, from the motion's start [s].
        start: All actuated joints at the stop [rad].
        timeout: Time for planning [s].
    """

    plan: Plan
    time: float
    start: tuple[float, ...]
    timeout: float = 5.0


@dataclass(frozen=True, slots=True)
class ToolQuery:
    """Solve inverse kinematics for a tool of a group. The answer is a Reached.

    Attributes:
        group: Name of the group that moves. All other joints stay at the start.
        start: All actuated joints, in the order of `robot.actuated` [rad]. The answer is the
            solution with the shortest straight motion from there.
        point: Target of the tool, in the URDF's root frame [m].
        direction: Direction of the tool's axis in that frame. Default: any.
        link: Link that carries the tool. Default: that of the robot's own tool if the group moves
            it, else the last link that the group moves.
        offset: Position of the tool in the frame of `link`; without `link`, relative to the
            robot's own tool [m].
        axis: Axis of the tool in that frame. Default: that of the robot's own tool, or z.
        relative: True if `point` is relative to the tool's position at the start.
        seed: Seed of the search.
        timeout: Time for the search [s].
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
    """Attach a body to another link without moving it. The answer is the new Body.

    Attributes:
        world: World with the body.
        body: Name of the body.
        link: Link to attach it to; empty for the URDF's root frame, so that it stays in place.
        positions: All actuated joints at that moment [rad].
        timeout: Time for the answer [s].
    """

    world: World
    body: str
    link: str
    positions: tuple[float, ...]
    timeout: float = 5.0


Request = Query | Verify | ToolQuery | Carry | Rest
Answer = Plan | Reached | Body | None
Result = Answer | MotionError

# Attributes of requests: name, type, and what to give instead.
_TYPES: tuple[tuple[str, type | tuple[type, ...], str], ...] = (
    ("group", str, "the name of a group"),
    ("via", (tuple, list), "a tuple of points"),
    ("point", (tuple, list), "x, y, z"),
    ("plan", Plan, "a Plan of this planner"),
    ("world", World, "a World"),
)


def check_types(request: Request) -> None:
    """Check the types of a request and its attributes. The planner checks their values.

    Raises:
        BadQuery: One is of another type.
    """
    if not isinstance(request, Request):
        raise BadQuery(f"A planner does not answer a {type(request).__name__}; send a Query")
    for name, kind, wanted in _TYPES:
        value = getattr(request, name, None)
        if hasattr(request, name) and not isinstance(value, kind):
            raise BadQuery(f"The {name} is {shown(value)}; give {wanted}")
