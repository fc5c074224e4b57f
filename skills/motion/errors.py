"""What can go wrong with a plan.

    MotionError
    ├── BadQuery                the question itself makes no sense
    │   ├── NotFinite           it holds a NaN or an infinity
    │   └── BadWorld            a body makes no sense, or names what is not there
    ├── ModelUnusable           the robot's URDF cannot be planned with
    ├── OutOfBounds             a joint would start or end outside its limits
    │   ├── StartOutOfBounds
    │   └── GoalOutOfBounds
    ├── EndInCollision          the arm would start or end touching something, or too near
    │   ├── StartInCollision
    │   └── GoalInCollision
    ├── Unreachable             the tool cannot get to where it shall go, or point that way there
    ├── Barred                  on every way there a joint would have to pass what it cannot
    ├── NoPath                  searched to the end of the budget, found nothing
    ├── PlanTimeout             the time was up
    ├── MotionCollides          the last check, on the motion as it will be played, found a contact
    ├── PlanCanceled            somebody said stop
    └── WorkerDied              the planning process ended or answered nonsense

Every error carries a stable `code`, and its message says what to do next. All of them travel
between processes with their attributes.
"""

import math
import reprlib
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any


class MotionError(Exception):
    """Root of everything motion planning raises.

    Attributes:
        milliseconds: What each rung of the ladder took, up to the one that failed [ms].
    """

    code = "plan.error"
    exit_status = 5
    meaning = "No motion was found"
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
    """The question makes no sense for this robot."""

    code = "plan.bad_query"
    meaning = "The planner was asked something that makes no sense"
    hint = "correct the task"

    @classmethod
    def group(cls, group: str, groups: Iterable[str]) -> "BadQuery":
        """An unknown group."""
        return cls(f"There is no group {shown(group)}; there are {', '.join(groups)}")

    @classmethod
    def count(cls, what: str, given: int, wanted: Iterable[str]) -> "BadQuery":
        """The wrong number of values."""
        names = ", ".join(wanted)
        return cls(f"{_the(what)} has {given} values; give one for each of {names}")


class NotFinite(BadQuery):
    """A NaN or an infinity.

    Attributes:
        what: Where it was found, such as `start`, `via point 1` or `z of the axis`.
        joint: The joint it was given for; empty where for none.
        value: NaN or an infinity.
    """

    code = "plan.not_finite"
    meaning = "The planner was given a NaN or an infinity"

    def __init__(self, what: str, joint: str, value: float) -> None:
        self.what, self.joint, self.value = what, joint, value
        whose = f" of {joint}" if joint else ""
        super().__init__(f"{_the(what)}{whose} is {value}; give a finite number")


class BadWorld(BadQuery):
    """A body makes no sense, or names what is not there."""

    code = "plan.bad_world"
    meaning = "A body around the arm makes no sense, or is not there"
    heading = "What is around the arm makes no sense"


class ModelUnusable(MotionError):
    """The robot's URDF cannot be planned with.

    Attributes:
        path: The URDF.
    """

    code = "plan.model"
    exit_status = 3
    meaning = "The robot's URDF cannot be planned with"
    hint = "correct it"

    def __init__(self, path: str, why: str) -> None:
        self.path = path
        super().__init__(f"{path} cannot be planned with: {why}. Correct the file, then run again")


class OutOfBounds(MotionError, ValueError):
    """A joint would be outside its limits.

    Attributes:
        joint: Its name.
        value: Where it would be.
        lower: Its smallest position.
        upper: Its largest position.
        unit: Of all three.
        what: Which end, such as `start`, or `via point 1`.
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
        super().__init__(
            f"{_the(self.what)} of {joint}, {value:.6g} {unit}, is outside "
            f"[{lower:.6g}, {upper:.6g}]; choose a value within"
        )


class StartOutOfBounds(OutOfBounds):
    """The motion would start outside the limits."""

    code = "plan.start_out_of_bounds"
    meaning = "The arm stands outside its limits"
    hint = "free it by hand, then run again"
    what = "start"


class GoalOutOfBounds(OutOfBounds):
    """The motion would end outside the limits."""

    code = "plan.goal_out_of_bounds"
    meaning = "The motion would end outside the limits"
    hint = "choose a goal within"
    what = "goal"


class EndInCollision(MotionError):
    """One end of the motion touches something or comes too near.

    Attributes:
        first: One link, or `floor`.
        second: The other.
        distance: Between them, negative where they overlap [m].
        margin: Distance to be kept [m].
        what: Which end, such as `start`, or `via point 1`.
    """

    what = "end"
    advice = ""

    def __init__(
        self, first: str, second: str, distance: float, margin: float, what: str = ""
    ) -> None:
        self.what = what or self.what
        self.first, self.second = first, second
        self.distance, self.margin = distance, margin
        advice = "choose another via point" if what else self.advice
        super().__init__(
            f"At {_the(self.what).lower()}, {_contact(first, second, distance)} "
            f"({1e3 * margin:.1f} mm must be kept); {advice}"
        )


class StartInCollision(EndInCollision):
    """The arm stands too near to something to move by plan."""

    code = "plan.start_in_collision"
    meaning = "The arm stands too near to something"
    hint = "free it by hand, then run again"
    what = "start"
    advice = "free the arm by hand, then run again"


class GoalInCollision(EndInCollision):
    """The goal is too near to something."""

    code = "plan.goal_in_collision"
    meaning = "The goal is too near to something"
    what = "goal"
    advice = "choose another goal"


class Unreachable(MotionError):
    """The tool cannot be brought there, or cannot point that way there.

    Attributes:
        point: Where it shall go, in the URDF's root frame [m].
        nearest: Where it gets, wherever it points then, as far as was found [m].
        distance: Between the two [m]; at most `tolerance` where it is the direction that cannot be
            kept.
        askew: Angle between the direction asked for and that of the tool there, where it gets to
            the point the least that was found; 0 where any will do [rad].
        direction: Where the tool's axis shall point, in that frame; None for anywhere.
        tolerance: Distance at which the point counts as reached [m].
    """

    code = "plan.unreachable"
    meaning = "The tool cannot be brought there, or cannot point that way there"
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
        super().__init__(self._too_far() if distance > tolerance else self._too_askew())

    def _too_far(self) -> str:
        # Two places that differ are not to look the same.
        digits = max(4, 1 - math.floor(math.log10(self.distance)))
        off = f"{1e3 * self.distance:.{max(1, digits - 3)}f} mm off"
        if digits > 4:
            off += f" where {1e3 * self.tolerance:g} mm would do"
        anyhow = "" if self.direction is None else ", wherever it points"
        return (
            f"The tool cannot reach {_place(self.point, digits)}{anyhow}: the nearest it comes is "
            f"{_place(self.nearest, digits)}, {off}; choose a point within reach"
        )

    def _too_askew(self) -> str:
        direction = ", ".join(f"{x:.4g}" for x in self.direction or ())
        return (
            f"The tool can reach {_place(self.point)}, but there its axis comes no nearer than "
            f"{math.degrees(self.askew):.3g} deg to the direction ({direction}); "
            "choose another direction, or leave it out"
        )


class Barred(MotionError):
    """There is no way: a joint would have to pass a place that it cannot, wherever others are.

    Attributes:
        joint: Its name.
        value: A place where it cannot be.
        unit: Of that.
        first: One of the two links that are too near each other there, or `floor`.
        second: The other.
    """

    code = "plan.barred"
    meaning = "A joint cannot pass what is between start and goal"

    def __init__(self, joint: str, value: float, unit: str, first: str, second: str) -> None:
        self.joint, self.value, self.unit = joint, value, unit
        self.first, self.second = first, second
        super().__init__(
            f"No way leads there: {joint} would have to pass {value:.4g} {unit}, where {first} is "
            f"too near to {second} however the other joints stand; choose another goal"
        )


class NoPath(MotionError):
    """The search came to the end of its budget.

    Attributes:
        iterations: How many steps it took.
    """

    code = "plan.no_path"
    meaning = "No way round was found"
    hint = "choose another goal, or one on the way to it"

    def __init__(self, iterations: int) -> None:
        self.iterations = iterations
        super().__init__(
            f"No way round was found in {iterations} steps of search; "
            "choose another goal, go by way of a pose between, or try another seed"
        )


class PlanTimeout(MotionError, TimeoutError):
    """The time was up.

    Attributes:
        timeout: Time there was [s].
    """

    code = "plan.timeout"
    exit_status = 8
    meaning = "The planner ran out of time"
    hint = "choose a nearer goal, or go by way of a pose between"

    def __init__(self, timeout: float) -> None:
        self.timeout = timeout
        super().__init__(
            f"No plan within {timeout:g} s; choose a nearer goal, or go by way of a pose between"
        )


class MotionCollides(MotionError):
    """The motion, as it will be played, touches something.

    Attributes:
        row: Row of the configurations at or after which it does.
        time: When, from the start of the motion [s]; None where no times were given.
        first: One link, or `floor`.
        second: The other.
        distance: Between them, negative where they overlap [m].
        margin: Distance to be kept [m].
        contact: Which two, and how near, in words.
    """

    code = "plan.motion_collides"
    meaning = "The motion would touch something as its frames play it"
    hint = "go by way of a pose further off"
    heading = "The motion would collide as its frames play it"

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
        self.contact = f"{_contact(first, second, distance)} ({1e3 * margin:.1f} mm must be kept)"
        where = f"row {row} of" if time is None else f"{time:.2f} s into"
        super().__init__(f"At {where} the motion, {self.contact}; go by way of a pose further off")


class PlanCanceled(MotionError):
    """Planning was canceled."""

    code = "plan.canceled"
    meaning = "Planning was canceled"
    hint = "ask again"

    def __init__(self) -> None:
        super().__init__("Planning was canceled; ask again when ready")


class WorkerDied(MotionError):
    """The planning process ended or answered nonsense.

    Attributes:
        why: What is known of it.
    """

    code = "plan.worker_died"
    meaning = "The planning process ended; a new one takes over"
    hint = "run again"

    def __init__(self, why: str) -> None:
        self.why = why
        super().__init__(f"The planning process failed: {why}. A new one takes over; ask again")


def shown(value: object) -> str:
    """Somebody's value in a message, whatever it is, and short."""
    try:
        return reprlib.repr(value)
    except Exception:  # somebody else's, or a number of thousands of digits
        return f"a {type(value).__name__} that cannot be shown"


def _the(what: str) -> str:
    """As a sentence begins: `The goal`, but `Via point 1`."""
    return what.capitalize() if what[-1].isdigit() else f"The {what}"


def _place(point: tuple[float, ...], digits: int = 4) -> str:
    return "(" + ", ".join(f"{x:.{digits}f}" for x in point) + ") m"


def _contact(first: str, second: str, distance: float) -> str:
    size = f"{1e3 * abs(distance):.1f} mm"
    if distance < 0:
        return f"{first} would be up to {size} deep in {second}"
    if distance == 0:
        return f"{first} would touch {second}"
    return f"{first} would come within {size} of {second}"
