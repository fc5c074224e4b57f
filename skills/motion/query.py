"""What may be asked of the planner."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import readonly
from .errors import BadQuery, MotionError, shown
from .plan import Plan
from .world import EMPTY, Body, Vector, World


@dataclass(frozen=True, slots=True)
class Query:
    """Move a group from where the arm stands to a goal.

    Attributes:
        group: Name of the group that moves; all other joints stay at the start.
        start: All actuated joints, in the order of `robot.actuated` [rad].
        goal: The group's own joints, in the order of `robot.actuated_in(group)` [rad]. A joint
            without an end goes the short way, to the value that differs by whole turns; where a way
            has to be searched for, it may go the other way round.
        seed: Of everything random; equal queries give equal plans.
        timeout: Time there is [s], from when a worker has loaded the robot; it can only fail a
            plan, never change one.
        via: Points on the way, each as `goal`; passed in their order, without a stop where that
            is free, no part of the arm further off than `blend.NEARNESS`.
        world: What stands around the arm, and what it holds.
        spare: Distance to be kept between the ends, beyond the robot's own margin [m].
    """

    group: str
    start: tuple[float, ...]
    goal: tuple[float, ...]
    seed: int = 1
    timeout: float = 5.0
    via: tuple[tuple[float, ...], ...] = ()
    world: World = EMPTY
    spare: float = 0.0


def _numbers(what: str, values: ArrayLike, unit: str) -> NDArray[np.float64]:
    try:
        return readonly(values)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadQuery(f"The {what} {shown(values)} are not all numbers; give {unit}") from error


@dataclass(frozen=True, eq=False)
class Verify:
    """Check a motion as it will be played.

    Attributes:
        configurations: All actuated joints, in the order of `robot.actuated` (N, A) [rad]; from
            one row to the next the arm moves straight.
        margin: Distance to be kept [m].
        times: When each row is reached (N,) [s]; None where it does not matter.
        timeout: Time there is [s].
        world: What stands around the arm, and what it holds.

    Raises:
        BadQuery: Configurations or times are not all numbers.
    """

    configurations: NDArray[np.float64] | Sequence[Sequence[float]]
    margin: float
    times: NDArray[np.float64] | Sequence[float] | None = None
    timeout: float = 5.0
    world: World = EMPTY

    def __post_init__(self) -> None:
        rows = _numbers("configurations", self.configurations, "radians")
        object.__setattr__(self, "configurations", rows)
        if self.times is not None:
            object.__setattr__(self, "times", _numbers("times", self.times, "seconds"))


@dataclass(frozen=True, slots=True)
class Rest:
    """Time what is left of a motion that was stopped, from standstill; answered with a Plan.

    Attributes:
        plan: Of which motion.
        time: How far it was followed [s].
        start: Where the arm stands: all actuated joints [rad].
        timeout: Time there is [s].
    """

    plan: Plan
    time: float
    start: tuple[float, ...]
    timeout: float = 5.0


@dataclass(frozen=True, slots=True)
class ToolQuery:
    """Where must a group be for its tool to be at a point?

    Attributes:
        group: Name of the group that moves; all other joints stay at the start.
        start: All actuated joints, in the order of `robot.actuated` [rad]; of several answers the
            one soonest reached straight from there is given.
        point: Where the tool shall be, in the URDF's root frame [m].
        direction: Where the tool's axis shall point, in that frame; None for anywhere.
        link: The link that carries the tool; empty for the robot's own tool where it has one that
            the group moves, else for the last link that the group moves.
        offset: The tool's place in the frame of that link, or how far beyond the robot's own [m].
        axis: The tool's axis in that frame; None for that of the robot's own, or z.
        relative: Whether `point` counts from where the tool is at the start.
        seed: Of everything random.
        timeout: Time there is [s].
        world: What stands around the arm, and what it holds.
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
        positions: The group's own joints, in the order of `robot.actuated_in(group)` [rad].
        found: How many answers there were to choose from.
    """

    positions: tuple[float, ...]
    found: int


@dataclass(frozen=True, slots=True)
class Carry:
    """Hand a body over to another link, where it is; answered with that Body.

    Attributes:
        world: Where it is.
        body: Its name.
        link: The link it moves with from now on; empty for none, so that it stands.
        positions: All actuated joints at that moment [rad].
        timeout: Time there is [s].
    """

    world: World
    body: str
    link: str
    positions: tuple[float, ...]
    timeout: float = 5.0


Request = Query | Verify | ToolQuery | Carry | Rest
Answer = Plan | Reached | Body | None
Result = Answer | MotionError
