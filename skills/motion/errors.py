"""Errors of motion planning.

The base class is MotionError. Every error has a stable `code`, and its message says what to do
next. All errors can be pickled with their attributes.
"""

import math
import re
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from hardware import DISPLAY_UNITS, ArmtreeError
from hardware.printable import plural

NEARER = "choose a point within reach"  # advice for a point that is too far
_SHOWN = 20  # largest number of mistakes in a message
_MISSING_LIBRARY = re.compile(r"(\w+)\.so\.(\d+): cannot open shared object file")


class MotionError(ArmtreeError):
    """The planner found no motion. Base class of the errors of motion planning.

    Attributes:
        milliseconds: Duration of each stage of planning, up to the stage that failed [ms].
    """

    code = "plan.error"
    exit_status = 5
    http_status = 422
    hint = "choose another goal"
    heading = "One or more planners failed"
    milliseconds: Mapping[str, float] = MappingProxyType({})

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self), self.args, self.__dict__)


def _restore(kind: type[MotionError], args: tuple[Any, ...], attributes: dict[str, Any]) -> Any:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(attributes)
    return error


class BadQuery(MotionError, ValueError):
    """A request to the planner is not valid for this robot."""

    code = "plan.bad_query"
    hint = "correct the task"

    @classmethod
    def group(cls, group: str, groups: Iterable[str]) -> "BadQuery":
        """Return the error for an unknown group."""
        return cls(f"There is no group {shown(group)}; the groups are {', '.join(groups)}")

    @classmethod
    def count(cls, what: str, given: int, wanted: Iterable[str]) -> "BadQuery":
        """Return the error for a wrong number of values."""
        names = ", ".join(wanted)
        return cls(f"{_the(what)} has {plural(given, 'value')}; give one for each of {names}")


class NotFinite(BadQuery):
    """A request to the planner has a number that is NaN or infinite.

    Attributes:
        what: Name of the value, such as `start`, `via point 1` or `z of the axis`.
        joint: Name of the joint whose number it is; empty if the number is not of a joint.
        value: The number: NaN, infinity or minus infinity.
    """

    code = "plan.not_finite"

    def __init__(self, what: str, joint: str, value: float) -> None:
        self.what, self.joint, self.value = what, joint, value
        owner = f" of {joint}" if joint else ""
        super().__init__(f"{_the(what)}{owner} is {value}; give a finite number")


class BadWorld(BadQuery):
    """A body of the world is not valid, or refers to an unknown link or body.

    Attributes:
        location: Location of the wrong value in a list of bodies, such as (0, "box", "size"); empty
            if it is unknown.
    """

    code = "plan.bad_world"
    heading = "The world is invalid"
    _several: "Sequence[BadWorld]" = ()

    def __init__(self, message: str, *location: int | str) -> None:
        self.location = location
        super().__init__(message)

    @classmethod
    def of(cls, mistakes: "Sequence[BadWorld]") -> "BadWorld":
        """Return one error for all mistakes. Its message has the messages of the first mistakes."""
        lines = [str(each) for each in mistakes[:_SHOWN]]
        if len(mistakes) > _SHOWN:
            lines.append(f"and {plural(len(mistakes) - _SHOWN, 'more mistake')}")
        error = cls("\n".join(lines), *mistakes[0].location)
        error._several = mistakes
        return error

    @property
    def all(self) -> "Sequence[BadWorld]":
        """All mistakes that this error combines; only this error if it is a single mistake."""
        return self._several or (self,)


class ModelUnusable(MotionError):
    """The robot's URDF, or a number in its robot file, is unusable for planning.

    Attributes:
        path: Path of the URDF or of the robot file.
    """

    code = "plan.model"
    exit_status = 3
    hint = "correct the file, then run again"

    def __init__(self, path: str, why: str) -> None:
        self.path = path
        super().__init__(f"{path} is unusable for planning: {why}; {self.hint}")


class PositionOutOfBounds(MotionError, ValueError):
    """A joint would be outside its limits.

    Attributes:
        joint: Name of the joint.
        value: Position of the joint.
        lower: Lower limit.
        upper: Upper limit.
        unit: Unit of value and limits: rad or m.
        what: Name of the point: `start`, `goal`, or a via point such as `via point 1`.
    """

    what = "position"

    def __init__(
        self,
        joint: str,
        value: float,
        lower: float,
        upper: float,
        unit: str = "rad",
        what: str = "",
    ) -> None:
        self.what = what or self.what
        self.joint, self.value, self.unit = joint, value, unit
        self.lower, self.upper = lower, upper
        scale, display = DISPLAY_UNITS[unit]
        position, low, high = (f"{scale * x:.6g}" for x in (value, lower, upper))
        super().__init__(
            f"{_the(self.what)} of {joint}, {position} {display}, is outside its limits, "
            f"{low} {display} to {high} {display}; {self.hint}"
        )


class StartOutOfBounds(PositionOutOfBounds):
    """A joint is outside its limits at the start."""

    code = "plan.start_out_of_bounds"
    hint = "move the joint within its limits by hand, then run again"
    what = "start"


class GoalOutOfBounds(PositionOutOfBounds):
    """A joint would be outside its limits at the goal."""

    code = "plan.goal_out_of_bounds"
    hint = "choose a value within the limits"
    what = "goal"


class EndInCollision(MotionError):
    """Two links are closer than the margin at the start, at the goal or at a via point.

    Attributes:
        first: Name of one link or body, or `floor`.
        second: Name of the other link or body.
        distance: Distance between them, negative if they overlap [m].
        margin: Distance to keep [m].
        what: Name of the point: `start`, `goal`, or a via point such as `via point 1`.
    """

    what = "end"

    def __init__(
        self, first: str, second: str, distance: float, margin: float, what: str = ""
    ) -> None:
        self.what = what or self.what
        self.first, self.second = first, second
        self.distance, self.margin = distance, margin
        hint = "choose another via point" if what else self.hint
        super().__init__(
            f"At {_the(self.what).lower()}, {_contact(first, second, distance)} "
            f"(margin: {1e3 * margin:.1f} mm); {hint}"
        )


class StartInCollision(EndInCollision):
    """The arm is too close to itself or an obstacle at the start."""

    code = "plan.start_in_collision"
    hint = (
        "move the arm away by hand, with its power off if it holds, or correct the bodies around "
        "it, then run again"
    )
    what = "start"


class ContactDeepened(StartInCollision):
    """The arm is in contact at the start, and the motion would make this contact deeper."""

    code = "plan.contact_deepened"
    hint = f"the motion would make this contact deeper: {StartInCollision.hint}"


class GoalInCollision(EndInCollision):
    """The arm would be too close to itself or an obstacle at the goal."""

    code = "plan.goal_in_collision"
    what = "goal"


class Unreachable(MotionError):
    """The tool cannot reach the point, or not with its axis in the requested direction.

    Attributes:
        point: The requested point, in the URDF's root frame [m].
        nearest: Reachable point that was found nearest to the requested point, with the tool in any
            direction [m].
        distance: Distance between these two points [m]; at most `tolerance` if only the direction
            is out of reach.
        askew: Angle between the requested direction or orientation of the tool and the one at
            `nearest` [rad]. If the point is within reach, it is the smallest angle that was found.
            0 if no direction or orientation was requested.
        direction: The requested direction of the tool's axis; None for a turn, or if no direction
            was requested.
        tolerance: Distance at which the point counts as reached [m].
    """

    code = "plan.unreachable"
    hint = "choose a point within reach, or another direction"

    def __init__(
        self,
        point: tuple[float, ...],
        nearest: tuple[float, ...],
        distance: float,
        askew: float,
        direction: tuple[float, ...] | None = None,
        tolerance: float = 0.0,
    ) -> None:
        self.point, self.nearest, self.distance, self.askew = point, nearest, distance, askew
        self.direction, self.tolerance = direction, tolerance
        far = distance > tolerance
        if far:
            self.hint = NEARER
        elif direction is None:
            self.hint = "turn it another way, or move joints"
        else:
            self.hint = "choose another direction, or leave it out"
        super().__init__(f"{self._too_far() if far else self._too_askew()}; {self.hint}")

    def _too_far(self) -> str:
        # More digits if the two points would look equal.
        digits = max(1, -2 - math.floor(math.log10(self.distance)))
        off = f"{1e3 * self.distance:.{digits}f} mm away"
        if digits > 1:
            off += f" (tolerance: {1e3 * self.tolerance:g} mm)"
        anyhow = "" if self.direction is None else ", in any direction"
        return (
            f"The tool cannot reach {_place(self.point, digits)}{anyhow}. The nearest point is "
            f"{_place(self.nearest, digits)}, {off}"
        )

    def _too_askew(self) -> str:
        off = f"{math.degrees(self.askew):.3g} deg off"
        if self.direction is None:
            return (
                f"The arm cannot turn the tool this way and keep it at {_place(self.point)}; it "
                f"stays at least {off} the requested orientation"
            )
        direction = ", ".join(f"{x:.4g}" for x in self.direction)
        return (
            f"The tool can reach {_place(self.point)}, but its axis is then at least {off} the "
            f"direction ({direction})"
        )


class Barred(MotionError):
    """There is no path: every path passes a joint position at which the arm is always in collision.

    Attributes:
        joint: Name of the joint.
        value: Position of the joint.
        unit: Unit of the position: rad or m.
        first: Name of one of the two links that collide at this position, or `floor`.
        second: Name of the other link or body.
    """

    code = "plan.barred"

    def __init__(self, joint: str, value: float, unit: str, first: str, second: str) -> None:
        self.joint, self.value, self.unit = joint, value, unit
        self.first, self.second = first, second
        scale, display = DISPLAY_UNITS[unit]
        super().__init__(
            f"There is no path to the goal: {joint} would have to pass {scale * value:.4g} "
            f"{display}, where {first} is too close to {second} for all positions of the other "
            f"joints; {self.hint}"
        )


# If the search reached this many times fewer configurations from one end of the motion (start or
# goal) than from the other, this end is in a narrow place.
_FEWER = 4


def _tried(samples: int, searches: int, from_start: int, from_goal: int) -> str:
    """Return words for a message that say how a path was searched. Arguments as in NoPath."""
    counts = sorted(((from_start, "start"), (from_goal, "goal")))
    narrow, wide = counts
    place = f"; the {narrow[1]} is in the narrow place" if _FEWER * narrow[0] < wide[0] else ""
    count = "1 search" if searches == 1 else f"{searches} searches"
    return (
        f"by a line, by bends, or by {count} with {samples} samples, which reached {from_start} "
        f"configurations from the start and {from_goal} from the goal{place}"
    )


class NoPath(MotionError):
    """No search found a path with its number of samples.

    Attributes:
        samples: Number of samples of all searches.
        searches: Number of searches, each with different samples.
        from_start: Number of configurations that the searches reached from the start.
        from_goal: Number of configurations that the searches reached from the goal.
    """

    code = "plan.no_path"
    hint = "choose another goal, or add a via pose in front of the narrow place"

    def __init__(self, samples: int, searches: int, from_start: int, from_goal: int) -> None:
        self.samples, self.searches = samples, searches
        self.from_start, self.from_goal = from_start, from_goal
        tried = _tried(samples, searches, from_start, from_goal)
        super().__init__(f"No path was found {tried}; {self.hint}")


class TooLong(MotionError):
    """The motion would take too long, because the limits of a joint are very low.

    Attributes:
        joint: Name of the joint that moves longest.
        value: Duration of the motion [s].
        limit: Largest duration [s].

    Args:
        joint, value, limit: See the attributes.
        rates: Velocity and acceleration limits of the joint with units, for the message.
    """

    code = "plan.too_long"
    hint = "choose a nearer goal, or raise the limits of the joint in the robot file"

    def __init__(self, joint: str, value: float, limit: float, rates: str) -> None:
        self.joint, self.value, self.limit = joint, value, limit
        super().__init__(
            f"The motion would take {value:.6g} s; the limit is {limit:g} s. {joint} moves "
            f"longest, with at most {rates}; {self.hint}"
        )


class PlanTimeout(MotionError, TimeoutError):
    """The planner ran out of time.

    Attributes:
        timeout: Timeout of the request [s].
        samples, searches, from_start, from_goal: Counts of the searches until the timeout; see
            NoPath. All are 0 if no search ran, or if the worker was killed at the deadline.
    """

    code = "plan.timeout"
    exit_status = 8
    hint = "raise planning_timeout, add a via pose, or choose another goal"

    def __init__(
        self,
        timeout: float,
        samples: int = 0,
        searches: int = 0,
        from_start: int = 0,
        from_goal: int = 0,
    ) -> None:
        self.timeout, self.samples, self.searches = timeout, samples, searches
        self.from_start, self.from_goal = from_start, from_goal
        what = f"No plan within {timeout:g} s"
        if searches:
            self.hint = f"raise planning_timeout, {NoPath.hint}"
            what += f" {_tried(samples, searches, from_start, from_goal)}"
        super().__init__(f"{what}; {self.hint}")


class MotionCollides(MotionError):
    """The frames of the motion would cause a collision.

    Attributes:
        row: Number of the row of configurations, from 0, at or before the collision.
        time: Time of the collision from the start of the motion [s]; None if rows have no times.
        first: Name of one link or body, or `floor`.
        second: Name of the other link or body.
        distance: Distance between them, negative if they overlap [m].
        margin: Distance to keep [m].
        contact: The two links and their distance, in words.
    """

    code = "plan.motion_collides"
    hint = "add a via pose further away"
    heading = "The frames of the motion would cause a collision"

    def __init__(
        self,
        row: int,
        time: float | None,
        first: str,
        second: str,
        distance: float,
        margin: float,
    ) -> None:
        self.row, self.time, self.margin = row, time, margin
        self.first, self.second, self.distance = first, second, distance
        self.contact = f"{_contact(first, second, distance)} (margin: {1e3 * margin:.1f} mm)"
        where = f"row {row} of" if time is None else f"{time:.2f} s into"
        super().__init__(f"At {where} the motion, {self.contact}; {self.hint}")


class TooLittleMemory(MotionError):
    """The operating system allows less memory than planners need.

    Attributes:
        value: Memory that a process may use [bytes].
        limit: Memory that a process of armtree needs [bytes].

    Args:
        kind: Kind of memory that the operating system limits.
        option: Command that raises this limit.
    """

    code = "plan.memory"
    exit_status = 3
    hint = "raise the limit that the message names, then run again"

    def __init__(
        self, value: int, limit: int, kind: str = "address space", option: str = "ulimit -v"
    ) -> None:
        self.value, self.limit = value, limit
        self.hint = f"raise the limit (`{option}`), then run again"
        super().__init__(
            f"The operating system allows {value // 1024} KiB of {kind} to a process; "
            f"armtree needs {limit // 1024} KiB; {self.hint}"
        )


class PlanCanceled(MotionError):
    """Planning was canceled."""

    code = "plan.canceled"
    hint = "send the request again if it is still needed"

    def __init__(self) -> None:
        super().__init__(f"Planning was canceled; {self.hint}")


class WorkerDied(MotionError):
    """The planning process ended, or its answer was not valid.

    Attributes:
        why: Cause, in words.
    """

    code = "plan.worker_died"
    hint = "run again"

    def __init__(self, why: str) -> None:
        self.why = why
        if missing := _MISSING_LIBRARY.search(why):
            package = f"{missing[1]}{missing[2]}"
            self.hint = f"install the system's package of this library, on Debian {package}"
        super().__init__(f"The planning process failed: {why}. A new one starts; {self.hint}")


def shown(value: object) -> str:
    """Return a short text that shows any value in a message."""
    try:
        return reprlib.repr(value)
    except Exception:  # __repr__ fails, or a number has thousands of digits
        return f"a {type(value).__name__} that cannot be shown"


def _the(what: str) -> str:
    """Return a name with its article, to start a sentence: `The goal`, but `Via point 1`."""
    return what.capitalize() if what[-1].isdigit() else f"The {what}"


def _place(point: tuple[float, ...], digits: int = 1) -> str:
    return "(" + ", ".join(f"{1e3 * x:.{digits}f}" for x in point) + ") mm"


def _contact(first: str, second: str, distance: float) -> str:
    size = f"{1e3 * abs(distance):.1f} mm"
    if distance < 0:
        return f"{first} would be up to {size} deep in {second}"
    if distance == 0:
        return f"{first} would touch {second}"
    return f"{first} would come within {size} of {second}"
