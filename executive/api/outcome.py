"""Reports about a goal: its state, the cause of a failure, its outcome, and answers.

Only this file converts these values to and from JSON, and an outcome to and from a record. The
numbers of `GoalState` and `CancelCode` are those of ROS 2.
"""

import sys
from collections.abc import Mapping
from dataclasses import asdict, field, fields
from enum import Enum
from typing import Any, Self, TypeVar

import logs
from hardware import ArmtreeError, InternalError, host_limit
from hardware.loading.dataclass import dataclass
from hardware.printable import plural

from .codes import LOST, OK

T = TypeVar("T")

# Names of the attributes of errors that hold the wrong value, and of those that hold its limit.
_VALUES = ("value", "distance")
_LIMITS = ("limit", "margin", "timeout")


class GoalState(Enum):
    """States of a ROS 2 goal; the values are ROS 2's numbers."""

    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class CancelCode(Enum):
    """Return codes of a cancel; the values are ROS 2's numbers."""

    NONE = 0
    REJECTED = 1
    UNKNOWN_GOAL_ID = 2
    GOAL_TERMINATED = 3


@dataclass(frozen=True, slots=True)
class Cause:
    """Cause of the failure of a goal or a request.

    Attributes:
        code: Stable name; the page *Messages* lists all.
        message: Description for people.
        node: Path of the failed node in the tree; empty if the cause is outside the tree.
        joint: Name of the joint; empty if the cause concerns no joint.
        value: Wrong value: a position [rad], a distance [m] or a time [s].
        limit: Limit of the value, in the same unit.
        hint: Advice for the user.
        place: Place in the task files, as `FILE:LINE, used by FILE:LINE`, if a node was refused
            before the run; else empty.
        argument: Name of the task's argument with the wrong value; empty if there is none.
    """

    code: str
    message: str
    node: str = ""
    joint: str = ""
    value: float | None = None
    limit: float | None = None
    hint: str = ""
    place: str = ""
    argument: str = ""

    def __str__(self) -> str:
        """Return the message, with the code and the node."""
        return f"{self.message} [{self.code}{f' at {self.node}' if self.node else ''}]"

    @property
    def advice(self) -> str:
        """Advice for the user; empty if the message contains it (case is ignored)."""
        return "" if self.hint.lower() in self.message.lower() else self.hint

    def to_json(self) -> dict[str, Any]:
        """Return the cause as a JSON object."""
        return asdict(self)

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "Cause":
        """Return the cause from the result of `to_json`.

        Raises:
            KeyError: A key is missing.
        """
        return from_fields(cls, plain)


@dataclass(frozen=True, slots=True)
class Ending:
    """The end of a goal, or of a job of a fleet.

    Attributes:
        state: SUCCEEDED, ABORTED or CANCELED.
        code: Stable name of the cause, `ok` for success.
        message: Description for people.
        frames: Number of frames sent.
        duration: Time from acceptance to the end [s].
        recording: Path of the recording; empty if there is none.
        cause: Cause of a failure; None if it succeeded.
    """

    state: GoalState
    code: str
    message: str
    frames: int = 0
    duration: float = 0.0
    recording: str = ""
    cause: Cause | None = None

    @property
    def success(self) -> bool:
        """True if the state is SUCCEEDED."""
        return self.state is GoalState.SUCCEEDED

    @property
    def hint(self) -> str:
        """Advice for the user; empty if the message contains it, or if there is no cause."""
        return self.cause.advice if self.cause else ""

    def to_json(self) -> dict[str, Any]:
        """Return the ending as a JSON object."""
        plain = asdict(self) | {"state": self.state.name, "success": self.success}
        return plain | {"duration_s": round(plain.pop("duration"), 6)}

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> Self:
        """Return the ending from the result of `to_json`.

        Raises:
            KeyError: A key is missing.
        """
        values = {
            **plain,
            "state": GoalState[plain["state"]],
            "duration": plain["duration_s"],
            "cause": plain["cause"] and Cause.from_json(plain["cause"]),
        }
        return from_fields(cls, values)


@dataclass(frozen=True, slots=True)
class Outcome(Ending):
    """The end of a goal.

    Attributes:
        task: Task number.
    """

    task: int = field(kw_only=True)

    @classmethod
    def of(
        cls,
        task: int,
        state: GoalState,
        cause: Cause | None,
        frames: int = 0,
        duration: float = 0.0,
        recording: str = "",
    ) -> "Outcome":
        """Return the outcome with the code and message of its cause."""
        code, message = (cause.code, cause.message) if cause else (OK, "Done")
        return cls(state, code, message, frames, duration, recording, cause, task=task)

    def text(self) -> str:
        """Return the outcome in words, with its hint and its recording on further lines."""
        state = f"{self.state.name} ({self.duration:.2f} s, {plural(self.frames, 'frame')})"
        if self.state is GoalState.ABORTED and not (self.duration or self.recording):
            state = "lost" if self.code == LOST else "not started"
        text = f"{logs.goal_title(self.task)} {state}: {self.cause or self.message}"
        text += f"\n  -> {self.hint}" if self.hint else ""
        return f"{text}\n  recording {self.recording}" if self.recording else text

    def to_json(self) -> dict[str, Any]:
        """Return the outcome as a JSON object."""
        return {"task": self.task, **Ending.to_json(self)}

    def to_record(self, identity: str, time: float) -> logs.Result:
        """Return the record of the end of a goal.

        Args:
            identity: Identity of the goal.
            time: Time of the end of the goal [s].
        """
        values = asdict(self.cause or Cause(OK, "")) | asdict(self)
        values |= {"time": time, "goal_id": identity}
        values |= {"state": self.state.name, "success": self.success}
        return from_fields(logs.Result, values)

    @classmethod
    def from_record(cls, record: logs.Result, recording: str) -> "Outcome":
        """Return a recorded outcome.

        Args:
            record: Record of the end of the goal.
            recording: Path of the goal's own recording; empty if there is none.
        """
        values = asdict(record) | {"state": GoalState[record.state], "recording": recording}
        cause = None if record.success else from_fields(Cause, values)
        return from_fields(cls, values | {"cause": cause})


@dataclass(frozen=True, slots=True)
class GoalStatus:
    """State of a goal at one moment.

    Attributes:
        identity: 32 hexadecimal digits.
        task: Task number.
        state: State of the goal.
        stamp_ns: Time of acceptance, UTC [ns since 1970].
        outcome: The outcome; None before the end.
    """

    identity: str
    task: int
    state: GoalState
    stamp_ns: int
    outcome: Outcome | None

    def to_json(self) -> dict[str, Any]:
        """Return the status as a JSON object."""
        return {
            "goal_id": self.identity,
            "task": self.task,
            "state": self.state.name,
            "stamp_ns": self.stamp_ns,
            "result": self.outcome and {"goal_id": self.identity, **self.outcome.to_json()},
        }

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "GoalStatus":
        """Return the status from the result of `to_json`.

        Raises:
            KeyError: A key is missing.
        """
        return cls(
            plain["goal_id"],
            plain["task"],
            GoalState[plain["state"]],
            plain["stamp_ns"],
            plain["result"] and Outcome.from_json(plain["result"]),
        )


@dataclass(frozen=True, slots=True)
class Acceptance:
    """The answer to a request for a goal.

    Attributes:
        identity: Identity of the goal, 32 hexadecimal digits.
        stamp_ns: Time of acceptance, UTC [ns since 1970]; 0 if the goal was refused.
        cause: Cause of a refusal; None if the goal was accepted.
    """

    identity: str
    stamp_ns: int
    cause: Cause | None = None

    @property
    def accepted(self) -> bool:
        """True if the goal will be executed."""
        return self.cause is None

    @property
    def code(self) -> str:
        """Stable name of the cause, `ok` if the goal was accepted."""
        return self.cause.code if self.cause else OK

    @property
    def message(self) -> str:
        """Description for people."""
        return self.cause.message if self.cause else "accepted"

    def to_json(self) -> dict[str, Any]:
        """Return the answer as a JSON object. The goal must be accepted."""
        return {"goal_id": self.identity, "stamp_ns": self.stamp_ns}


@dataclass(frozen=True, slots=True)
class CancelResult:
    """The answer to a cancel.

    Attributes:
        code: Return code, as in ROS 2.
        goals: Identities of the canceled goals.
    """

    code: CancelCode
    goals: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the answer as a JSON object."""
        return {"return_code": self.code.value, "goals": list(self.goals)}

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "CancelResult":
        """Return the answer from the result of `to_json`.

        Raises:
            KeyError: A key is missing.
        """
        return cls(CancelCode(plain["return_code"]), tuple(plain["goals"]))


def cause_of(error: Exception, node: str = "", message: str = "") -> Cause:
    """Return the `cause` of an error. If the error has none, make a cause from the error.

    Args:
        error: The error. The cause keeps its joint, value and limit.
        node: Path of the node that failed; default: the node that the error names.
        message: Description for people; default: the message of the error.
    """
    if isinstance(cause := getattr(error, "cause", None), Cause):
        return cause
    error = host_limit(error) or error
    known = error if isinstance(error, ArmtreeError) else InternalError
    words = message or str(error)
    return Cause(
        code=known.code,
        message=f"{known.heading}: {words}" if known.heading else words,
        node=node or str(getattr(error, "node", None) or ""),
        joint=str(getattr(error, "joint", "")),
        value=_number(error, _VALUES),
        limit=_limit(error),
        hint=known.hint,
        place=str(getattr(error, "place", "")),
        argument=str(getattr(error, "argument", "")),
    )


def from_fields(kind: type[T], values: Mapping[str, Any]) -> T:
    """Return a dataclass from the values of its fields. Other values are ignored.

    Raises:
        KeyError: The value of a field is missing.
    """
    return kind(**{field.name: values[field.name] for field in fields(kind)})  # type: ignore[arg-type]


def _number(error: Exception, names: tuple[str, ...]) -> float | None:
    """Return the first of several attributes of an error that is present, if it is finite."""
    value = next((getattr(error, name) for name in names if hasattr(error, name)), None)
    fits = isinstance(value, (int, float)) and abs(value) <= sys.float_info.max
    return float(value) if fits and value is not None else None


def _limit(error: Exception) -> float | None:
    """Return `lower` or `upper`, whichever the value exceeds; else the only limit, or None."""
    value = _number(error, _VALUES)
    lower, upper = _number(error, ("lower",)), _number(error, ("upper",))
    if value is None or lower is None or upper is None:
        return _number(error, _LIMITS)
    return lower if value < lower else upper
