"""Errors of skills.

SkillError
├── OutOfBounds     a target lies outside the limits
├── BadTarget       a target names no joint, the wrong one, or contradicts itself
├── BadBody         what shall stand around the arm cannot
├── NotReplayable   the frames of a recording cannot be sent to this arm
├── BadQuestion     a question is empty, or an answer is wanted that is no choice
├── StartMoved      the arm no longer stands where the plan begins
├── Interrupted     somebody stopped the motion from outside the tree
├── SkillBroken     the code of a skill raised what it must not
└── TaskFailed      the task itself says so
    ├── ConditionFails  something it asks for is not so
    ├── FunctionFailed  a registered function raised something
    ├── TookTooLong     a timeout of the task is over
    └── Unanswered      the operator said nothing
"""

from collections.abc import Sequence
from typing import Self, TypeVar

from hardware import BadPosition, HardwareError

from .motion.errors import MotionError


class SkillError(Exception):
    """Root of what skills raise; a failed skill keeps its `code` and message.

    Attributes:
        way: To the value that is wrong: its port, then names and numbers within; empty where it
            is none that a task can spell out.
        node: Path of the node that refuses it, where it is refused before the tree runs.
    """

    code = "skill.error"
    exit_status = 1
    meaning = "A skill failed without a cause of its own"
    hint = "report it"
    heading = "The task failed"
    node = ""
    location: tuple[str | int, ...] = ()

    def at(self, *location: str | int) -> Self:
        """The same, with the way to the value that is wrong."""
        self.location = location
        return self


def refuse(errors: Sequence[Exception]) -> None:
    """Raise all that is wrong: nothing, one error, or a group of them."""
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise ExceptionGroup("several things are wrong", errors)


class OutOfBounds(SkillError):
    """A target lies outside the limits of its joints.

    Args:
        errors: One per joint that is out.

    Attributes:
        joint: The first of them.
        value: Where it would be [rad].
        limit: Its limit there [rad]; None where the value is no number.
    """

    code = "goal.out_of_bounds"
    exit_status = 4
    meaning = "A target lies outside the limits of its joints"
    hint = "choose a target within"
    heading = "Target position out of boundaries"

    def __init__(self, errors: Sequence[BadPosition]) -> None:
        first = errors[0]
        self.joint, self.value, self.limit = first.joint, first.value, first.limit
        super().__init__("; ".join(map(str, errors)))


class BadTarget(SkillError):
    """A target names an unknown joint, leaves one out, or contradicts a mimic joint's leader."""

    code = "goal.bad_target"
    exit_status = 4
    meaning = "A target names no joint, the wrong one, or contradicts itself"
    hint = "correct what the message names"
    heading = "The target makes no sense"


class BadBody(SkillError):
    """What shall stand around the arm cannot: its file is not there, or a number makes no sense."""

    code = "goal.bad_body"
    exit_status = 4
    meaning = "A body that shall stand around the arm makes no sense"
    hint = "correct the task"
    heading = "The body makes no sense"


class BadQuestion(SkillError):
    """A question or a choice is empty or given twice, or no choice is what is wanted."""

    code = "goal.bad_question"
    exit_status = 4
    meaning = "A question cannot be asked as it stands"
    hint = "correct the task"
    heading = ""


class NotReplayable(SkillError):
    """The frames of a recording cannot be sent to this arm."""

    code = "goal.not_replayable"
    exit_status = 4
    meaning = "The frames of a recording cannot be sent to this arm"
    hint = "give the robot file it was recorded with"
    heading = ""


class StartMoved(SkillError):
    """The arm no longer stands where the plan begins."""

    code = "plan.start_moved"
    exit_status = 5
    meaning = "The arm no longer stands where the plan begins"
    hint = "plan again"
    heading = ""


class Interrupted(SkillError):
    """The motion was stopped from outside the tree."""

    code = "hw.stopped"
    exit_status = 6
    meaning = "Somebody stopped the arm from outside the task"
    hint = "run again"
    heading = ""


class SkillBroken(SkillError):
    """The code of a skill raised something that is no error of ours, or answered what is no answer.

    Args:
        where: What was called, such as `Wave.on_start`.
        what: What it raised, or did instead, such as `gave None, not a number`.
    """

    code = "skill.broken"
    exit_status = 11
    meaning = "The code of a skill raised something"
    hint = "correct it; --debug shows the line. If it is one of ours, report it"

    def __init__(self, where: str, what: BaseException | str) -> None:
        did = what if isinstance(what, str) else f"raised {type(what).__name__}: {what}"
        super().__init__(f"{where} {did}")


class TaskFailed(SkillError):
    """The task ends in failure by its own tree."""

    code = "task.failed"
    exit_status = 11
    meaning = "The task failed by its own tree"
    hint = "see its nodes"


class ConditionFails(TaskFailed):
    """Something that the task asks for is not so."""

    code = "task.condition"
    meaning = "Something the task asks for is not so"
    hint = "see what it asks for"


class FunctionFailed(TaskFailed):
    """A registered function raised something."""

    code = "task.function"
    meaning = "A function of a skill raised something"
    hint = "correct the function"


class TookTooLong(TaskFailed):
    """A timeout of the task is over."""

    code = "task.timeout"
    exit_status = 8
    meaning = "A time-out of the task is over"
    hint = "allow more time"


class Unanswered(TaskFailed):
    """The operator did not answer in time, or there is none."""

    code = "task.unanswered"
    meaning = "The operator did not answer"
    hint = "run again, and answer"


KnownError = SkillError | MotionError | HardwareError
Error = TypeVar("Error", bound=Exception)


def known_errors(raised: BaseException) -> list[KnownError]:
    """Return the errors of armtree in an exception: itself, or all members of a group.

    An empty list means that it is, or contains, an exception of another kind.
    """
    if isinstance(raised, KnownError):
        return [raised]
    if not isinstance(raised, ExceptionGroup):
        return []
    found = [known_errors(member) for member in raised.exceptions]
    return [error for errors in found for error in errors] if all(found) else []


def combine_errors(errors: Sequence[Error]) -> Error:
    """Return the first error with the messages of all; an OutOfBounds is preferred.

    Args:
        errors: At least one.
    """
    if len(errors) == 1:
        return errors[0]
    first = next((error for error in errors if isinstance(error, OutOfBounds)), errors[0])
    first.args = ("; ".join(dict.fromkeys(map(str, errors))),)
    return first
