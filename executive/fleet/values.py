"""The stored values of a fleet: a job, its record, an arm. Only this file reads and writes them."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache, partial
from typing import Any, TypeVar

from executive.api import strict_json
from executive.api.outcome import Ending, GoalState, cause_of
from hardware.loading.dataclass import dataclass
from logs.records.field_types import has_type

from .errors import BadJob

T = TypeVar("T")

PRIORITIES = ("high", "normal", "low")
READY, BUSY, HELD, UNREACHABLE = "ready", "busy", "held", "unreachable"  # states of an arm
IDENTITY = re.compile(r"[0-9a-f]{32}")


@dataclass(frozen=True, slots=True)
class Job:
    """A request to run a task on any arm of a pool.

    Attributes:
        identity: 32 hexadecimal digits: the identity of its goal on the arm, and of its message.
        pool: Name of the pool.
        task: Number or name of the task.
        arguments: Values of the task's parameters, by name.
        sent_ns: Time of sending, UTC [ns since 1970].
        priority: One of `PRIORITIES`.
        start_within_s: Longest time until its start [s], by the clock of the NATS server; None for
            no limit.
        end_within_s: Longest time until its end [s], by the same clock; None for no limit.
        attempt: Number of the attempt, from 1.
    """

    identity: str
    pool: str
    task: int | str
    arguments: Mapping[str, Any]
    sent_ns: int
    priority: str = "normal"
    start_within_s: float | None = None
    end_within_s: float | None = None
    attempt: int = 1


@dataclass(frozen=True, slots=True)
class JobRecord:
    """The record of a job that is not queued any more.

    Attributes:
        job: The job.
        arm: Arm that claimed it, as POOL.NAME; empty if it ended unclaimed.
        url: URL of the server of that arm.
        worker: Identity of the process that claimed it.
        claimed_ns: Time of the claim, UTC [ns since 1970].
        retry_safe: True if its task may run again after its arm was lost.
        result: The result; None before the end.
        ended_ns: Time of the end, UTC [ns since 1970]; 0 before the end.
        late: True if the arm was lost before it reported the result.
    """

    job: Job
    arm: str
    url: str
    worker: str
    claimed_ns: int
    retry_safe: bool = False
    result: Ending | None = None
    ended_ns: int = 0
    late: bool = False

    @property
    def state(self) -> str:
        """CLAIMED, or the state of the result."""
        return self.result.state.name if self.result else "CLAIMED"


@dataclass(frozen=True, slots=True)
class Member:
    """An arm of a fleet, from its joining until its worker leaves.

    Attributes:
        arm: POOL.NAME.
        url: URL of its server.
        host: Name of its machine.
        worker: Identity of its worker process.
        joined_ns: Time of joining, UTC [ns since 1970].
        held: Why the arm takes no jobs until a resume; empty if it takes jobs.
    """

    arm: str
    url: str
    host: str
    worker: str
    joined_ns: int
    held: str = ""


@dataclass(frozen=True, slots=True)
class Presence:
    """The last report of an arm. It expires.

    Attributes:
        worker: Identity of its worker process.
        state: `ready`, `busy`, `held`, `unreachable`, or the state of the hardware.
        job: Identity of its job; empty if it has no job.
        last: Code of the last outcome; empty before the first.
        done: Number of jobs that ended since it joined.
    """

    worker: str
    state: str
    job: str = ""
    last: str = ""
    done: int = 0


def failed(error: Exception, state: GoalState = GoalState.ABORTED) -> Ending:
    """Return the result of a job that failed before an arm reported an outcome."""
    cause = cause_of(error)
    return Ending(state, cause.code, cause.message, cause=cause)


def to_bytes(value: Any) -> bytes:
    """Return a value of this file as JSON."""
    return _encoder.encode(value).encode()


def to_json(value: Any) -> dict[str, Any]:
    """Return a value of this file as a JSON object. The encoder also calls it for nested values."""
    if isinstance(value, Ending):  # without the task of an `Outcome`, because readers drop it
        return {name: each for name, each in value.to_json().items() if name != "task"}
    return {name: getattr(value, name) for name in _names(value.__class__)}


_encoder = json.JSONEncoder(ensure_ascii=False, allow_nan=False, default=to_json)


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(each.name for each in fields(kind))


def from_bytes(kind: type[T], data: bytes | None) -> T:
    """Return a value of this file from JSON. Keys of later versions are ignored.

    Raises:
        BadJob: The JSON is not such a value.
    """
    try:
        found: T = _value(kind, strict_json.parse(data or b""))
    except (strict_json.NotJson, TypeError, KeyError) as error:
        raise BadJob(f"not a {kind.__name__} of a fleet: {error}") from error
    job = found if isinstance(found, Job) else getattr(found, "job", None)
    if not has_type(found, kind) or (
        isinstance(job, Job)
        and not (IDENTITY.fullmatch(job.identity) and job.priority in PRIORITIES)
    ):
        raise BadJob(f"a {kind.__name__} of a fleet has wrong fields")
    return found


def _value(kind: Any, plain: Mapping[str, Any]) -> Any:
    given = {name: plain[name] for name in _names(kind) if name in plain}
    for name, read in _INNER.items():
        if isinstance(given.get(name), dict):
            given[name] = read(given[name])
    return kind(**given)


_INNER: Mapping[str, Callable[[Any], Any]] = {
    "job": partial(_value, Job),
    "result": Ending.from_json,
}
