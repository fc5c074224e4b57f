"""Errors of skills.

The base class is SkillError. TaskFailed and its subclasses report that the tree of a task failed.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Self, TypeVar

from hardware import ArmtreeError, BadPosition, HardwareError

from .motion.errors import MotionError


class SkillError(ArmtreeError):
    """A skill failed without a specific cause. Base class of the errors of skills.

    Attributes:
        location: Location of the invalid value: the port, then keys and indices within its value;
            empty if no value in the task is invalid.
        node: Path of the node in the tree; empty if the error was not found before the run.
        place: Place of the node in a file, and the places that refer to it; empty if `node` is.
        files: Texts of the task's files, by name; empty if `node` is.
        argument: Name of the argument with the invalid value; empty if no argument is invalid.
    """

    code = "skill.error"
    exit_status = 1
    http_status = 422
    hint = "report this bug"
    heading = "The task failed"
    node = ""
    place = ""
    argument = ""
    files: Mapping[str, str] = MappingProxyType({})
    location: tuple[str | int, ...] = ()

    def at(self, *location: str | int) -> Self:
        """Set the location of the invalid value, and return this error.

        Args:
            location: Name of the port, then keys and indices within its value.
        """
        self.location = location
        return self


def refuse(errors: Sequence[Exception]) -> None:
    """Raise the errors: a single error as it is, several errors as an ExceptionGroup.

    Args:
        errors: The errors. If there is none, the function returns.
    """
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise ExceptionGroup("several errors", errors)


class OutOfBounds(SkillError):
    """A target is outside the limits of its joints.

    Args:
        errors: One error per joint outside its limits.

    Attributes:
        joint: Name of the first joint outside its limits.
        value: Target of this joint [rad].
        limit: The exceeded limit of this joint [rad]; None if the target is not finite.
    """

    code = "goal.out_of_bounds"
    exit_status = 4
    hint = "choose a target within the limits"
    heading = "Target position out of boundaries"

    def __init__(self, errors: Sequence[BadPosition]) -> None:
        first = errors[0]
        self.joint, self.value, self.limit = first.joint, first.value, first.limit
        super().__init__("; ".join(map(str, errors)))


class BadTarget(SkillError):
    """A target names an unknown joint, lacks a joint, or contradicts the leader of a mimic joint.

    Attributes:
        superfluous: True if the target becomes valid when the value at `location` is removed.
    """

    code = "goal.bad_target"
    exit_status = 4
    hint = "give joints within their limits, a saved pose, or a point within reach"
    heading = "The target is invalid"

    def __init__(self, why: str, superfluous: bool = False) -> None:
        self.superfluous = superfluous
        super().__init__(why)


class BadBody(SkillError):
    """A body for the world is invalid: its file is missing, or a number is invalid."""

    code = "goal.bad_body"
    exit_status = 4
    hint = "correct the task"
    heading = "The body is invalid"


class BadQuestion(SkillError):
    """A question is empty, a choice is empty or repeated, or the wanted answer is not a choice."""

    code = "goal.bad_question"
    exit_status = 4
    hint = "correct the task"
    heading = ""


class NotReplayable(SkillError):
    """This arm cannot play the frames of the recording."""

    code = "goal.not_replayable"
    exit_status = 4
    hint = "give the robot file of the recording"
    heading = ""


class StartMoved(SkillError):
    """The arm is no longer at the start of the plan."""

    code = "plan.start_moved"
    exit_status = 5
    hint = "plan again"
    heading = ""


class Interrupted(SkillError):
    """The motion was stopped from outside the task."""

    code = "hw.stopped"
    exit_status = 6
    hint = "run again"
    heading = ""


class SkillBroken(SkillError):
    """The code of a skill raised an unexpected exception, or returned an invalid value.

    Args:
        where: Name of the method, such as `Wave.on_start`.
        what: The exception, or a description of the invalid result: `gave None, not a number`.
    """

    code = "skill.broken"
    exit_status = 11
    hint = "correct the skill; --debug shows the line. If the skill ships with armtree, report it"

    def __init__(self, where: str, what: BaseException | str) -> None:
        problem = what if isinstance(what, str) else f"raised {type(what).__name__}: {what}"
        super().__init__(f"{where} {problem}")


class TaskFailed(SkillError):
    """The tree of the task failed, although no part of armtree or the arm failed."""

    code = "task.failed"
    exit_status = 11
    hint = "`armtree show RECORDING` shows which node failed"


class ConditionFails(TaskFailed):
    """A condition of the task is false."""

    code = "task.condition"
    hint = "see the condition in the message"


class FunctionFailed(TaskFailed):
    """The function of a skill raised an exception."""

    code = "task.function"
    hint = "correct the function"


class TookTooLong(TaskFailed):
    """A timeout of the task expired."""

    code = "task.timeout"
    exit_status = 8
    hint = "allow more time"


class Unanswered(TaskFailed):
    """The operator did not answer in time, or there is no operator."""

    code = "task.unanswered"
    hint = "run again, and answer"


class NoLeader(TaskFailed):
    """There is no hand-guided arm to follow."""

    code = "task.no_leader"
    hint = "type: armtree teleop --leader PORT"


KnownError = SkillError | MotionError | HardwareError
Error = TypeVar("Error", bound=Exception)


def known_errors(raised: BaseException) -> list[KnownError]:
    """Return the errors of armtree that an exception contains.

    An ExceptionGroup contains its members; any other exception contains itself. The list is empty
    if one of these is not an error of armtree.
    """
    if isinstance(raised, KnownError):
        return [raised]
    if not isinstance(raised, ExceptionGroup):
        return []
    found = [known_errors(member) for member in raised.exceptions]
    return [error for errors in found for error in errors] if all(found) else []


def combine_errors(errors: Sequence[Error]) -> Error:
    """Return one of the errors, with the messages of all errors joined.

    Args:
        errors: One or more errors. The first OutOfBounds is returned, or else the first error.
    """
    if len(errors) == 1:
        return errors[0]
    first = next((error for error in errors if isinstance(error, OutOfBounds)), errors[0])
    first.args = ("; ".join(dict.fromkeys(map(str, errors))),)
    return first
