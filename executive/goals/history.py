"""The goals of a server that ended, known by their recordings, and never gone on with."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import logs
from executive.errors import ServerRestarted
from executive.recording.recordings import is_server_recording

from .outcome import GoalState, Outcome, cause_of


class _Goal:
    """What the recordings say of one goal."""

    def __init__(self, stamp_ns: int, record: logs.Goal) -> None:
        self.stamp_ns, self.record = stamp_ns, record
        self.own: logs.Recording | None = None
        self.result: logs.Result | None = None
        self.served = False

    @property
    def outcome(self) -> Outcome:
        """How it ended; where nothing says so, its server ended before it did."""
        path = str(self.own.path) if self.own else ""
        if self.result:
            return Outcome.from_record(self.result, path)
        sent = self.own.records(logs.Sent) if self.own else ()
        frames = [r for r in sent if isinstance(r, logs.Sent) and r.joints]
        duration = max(0.0, frames[-1].time - self.record.time) if frames else 0.0
        cause = cause_of(ServerRestarted())
        task = self.record.task
        return Outcome.of(task, GoalState.ABORTED, cause, len(frames), duration, path)


def load_goal_history(folder: Path, since: float) -> Iterator[tuple[str, int, Outcome]]:
    """The goals of servers before this one, and those that were cut off.

    Args:
        folder: Where recordings are.
        since: Only what was recorded since then [s since 1970].

    Yields:
        Identity, stamp [ns since 1970], and how it ended, by their stamps.
    """
    goals: dict[str, _Goal] = {}
    for recording in logs.closed_recordings(folder, since):
        with suppress(logs.LogError):  # what can be read of it counts
            _read(recording, goals)
    for identity, goal in sorted(goals.items(), key=lambda item: item[1].stamp_ns):
        if goal.served or goal.result is None:
            yield identity, goal.stamp_ns, goal.outcome


def _read(recording: logs.Recording, goals: dict[str, _Goal]) -> None:
    served = is_server_recording(recording.path)
    for record in recording.records(logs.Goal, logs.Result):
        if isinstance(record, logs.Goal):
            stamp_ns = recording.epoch_ns + round(record.time * 1e9)
            goal = goals.setdefault(record.goal_id, _Goal(stamp_ns, record))
            goal.served |= served
            goal.own = goal.own if served else recording
        elif isinstance(record, logs.Result) and record.goal_id in goals:
            goals[record.goal_id].result = record
