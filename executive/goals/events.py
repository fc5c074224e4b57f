"""What happens, as plain values: one shape for `--json`, the network and its clients."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

import logs

from .goal import Cause, GoalState, GoalStatus, Outcome, QuestionStatus

if TYPE_CHECKING:
    from executive.executive import Event, Snapshot

EVENTS: dict[type, str] = {
    logs.Goal: "goal",
    logs.Sent: "sent",
    logs.Received: "received",
    logs.Transition: "lifecycle",
    logs.Feedback: "feedback",
    logs.NodeStatus: "node",
    logs.Plan: "plan",
    logs.Schedule: "schedule",
    logs.LogLine: "log",
    QuestionStatus: "question",
}
STATUS = "status"
KINDS = frozenset({STATUS, *EVENTS.values()})

UNITS = {"time": "time_s", "duration": "duration_s", "scheduled": "scheduled_s"}

_RECORDS = {name: kind for kind, name in EVENTS.items()}
_FIELDS = {unit: name for name, unit in UNITS.items()}


def kind_of(event: "Event") -> str:
    """The name of an event; empty for what is recorded but not told."""
    return STATUS if isinstance(event, GoalStatus) else EVENTS.get(type(event), "")


def as_event(event: "Event") -> dict[str, Any]:
    """An event that has a name."""
    if isinstance(event, GoalStatus):
        return {"event": STATUS, **as_goal(event)}
    fields = {UNITS.get(key, key): value for key, value in dataclasses.asdict(event).items()}
    for key, value in fields.items():
        if isinstance(value, bytes):
            fields[key] = value.decode("ascii", "backslashreplace")
    return {"event": EVENTS[type(event)], **fields}


def as_result(outcome: Outcome) -> dict[str, Any]:
    """How a goal ended."""
    return {
        "task": outcome.task,
        "state": outcome.state.name,
        "success": outcome.success,
        "code": outcome.code,
        "message": outcome.message,
        "frames": outcome.frames,
        "duration_s": round(outcome.duration, 6),
        "recording": outcome.recording,
        "cause": dataclasses.asdict(outcome.cause) if outcome.cause else None,
    }


def as_goal(goal: GoalStatus) -> dict[str, Any]:
    """What a goal is at."""
    result = goal.outcome and {"goal_id": goal.identity, **as_result(goal.outcome)}
    return {
        "goal_id": goal.identity,
        "task": goal.task,
        "state": goal.state.name,
        "stamp_ns": goal.stamp_ns,
        "result": result,
    }


def as_status(snapshot: "Snapshot") -> dict[str, Any]:
    """How things are at one moment."""
    progress = snapshot.progress
    return {
        "arm": snapshot.arm.value,
        "fault": snapshot.fault and dataclasses.asdict(snapshot.fault),
        "port": snapshot.port,
        "commanded": snapshot.commanded and dict(snapshot.commanded),
        "goal": snapshot.goal and as_goal(snapshot.goal),
        "percentage": progress.percentage if progress else None,
        "phase": progress.phase if progress else "",
        "node": progress.node if progress else "",
        "attempt": progress.attempt if progress else 1,
        "waiting": list(snapshot.waiting),
        "policy": snapshot.policy.value,
        "paused": snapshot.paused,
        "breakpoints": list(snapshot.breakpoints),
        "uptime_s": round(snapshot.uptime, 3),
    }


def to_event(plain: Mapping[str, Any]) -> "Event":
    """An event from what `as_event` made of it.

    Raises:
        KeyError: It is none, or one of another version.
    """
    if plain["event"] == STATUS:
        return to_goal(plain)
    kind = _RECORDS[plain["event"]]
    values = {_FIELDS.get(key, key): _frozen(value) for key, value in plain.items()}
    names = [field.name for field in dataclasses.fields(kind)]
    if "data" in names:
        values["data"] = values["data"].encode()
    return cast("Event", kind(**{name: values[name] for name in names}))


def to_goal(plain: Mapping[str, Any]) -> GoalStatus:
    """The same of a goal."""
    result = plain["result"]
    return GoalStatus(
        plain["goal_id"],
        plain["task"],
        GoalState[plain["state"]],
        plain["stamp_ns"],
        result and to_outcome(result),
    )


def to_outcome(plain: Mapping[str, Any]) -> Outcome:
    """The same of a result."""
    return Outcome(
        task=plain["task"],
        state=GoalState[plain["state"]],
        code=plain["code"],
        message=plain["message"],
        frames=plain["frames"],
        duration=plain["duration_s"],
        recording=plain["recording"],
        cause=plain["cause"] and Cause(**plain["cause"]),
    )


def _frozen(value: Any) -> Any:
    """JSON's lists as the tuples that records have."""
    return tuple(_frozen(each) for each in value) if isinstance(value, list) else value
