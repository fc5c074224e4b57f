"""How a goal ended, as it is recorded and as it is known again."""

import logs
from executive.codes import OK

from .goal import Cause, GoalState, Outcome


def record_of(identity: str, outcome: Outcome, time: float) -> logs.Result:
    """The record of the end of a goal, at a time [s]."""
    cause = outcome.cause or Cause(OK, "")
    return logs.Result(
        time=time,
        goal_id=identity,
        task=outcome.task,
        state=outcome.state.name,
        success=outcome.success,
        code=outcome.code,
        message=outcome.message,
        frames=outcome.frames,
        duration=outcome.duration,
        node=cause.node,
        joint=cause.joint,
        value=cause.value,
        limit=cause.limit,
        hint=cause.hint,
    )


def outcome_of(record: logs.Result, recording: str) -> Outcome:
    """What was recorded of the end of a goal that has a recording of its own, or none."""
    cause = Cause(
        code=record.code,
        message=record.message,
        node=record.node,
        joint=record.joint,
        value=record.value,
        limit=record.limit,
        hint=record.hint,
    )
    return Outcome(
        task=record.task,
        state=GoalState[record.state],
        code=record.code,
        message=record.message,
        frames=record.frames,
        duration=record.duration,
        recording=recording,
        cause=None if record.success else cause,
    )
