"""The goals of a server that ended before they did: known, and never gone on with."""

from collections.abc import Iterator
from pathlib import Path

import logs

from .causes import cause_of
from .errors import ServerRestarted
from .goal import GoalState, Outcome


def cut_off(folder: Path, since: float) -> Iterator[tuple[str, int, Outcome]]:
    """The goals that have no end.

    Args:
        folder: Where their recordings are.
        since: Only those whose recording was changed since then [s since 1970].

    Yields:
        Identity, stamp [ns since 1970], and what their end is said to be.
    """
    for recording in logs.cut_off(folder, since):
        goal = next(recording.records(logs.Goal))
        assert isinstance(goal, logs.Goal)
        sent = [r for r in recording.records(logs.Sent) if isinstance(r, logs.Sent) and r.joints]
        cause = cause_of(ServerRestarted())
        outcome = Outcome(
            task=goal.task,
            state=GoalState.ABORTED,
            code=cause.code,
            message=cause.message,
            frames=len(sent),
            duration=max(0.0, sent[-1].time - goal.time) if sent else 0.0,
            recording=str(recording.path),
            cause=cause,
        )
        yield goal.goal_id, recording.epoch_ns + round(goal.time * 1e9), outcome
