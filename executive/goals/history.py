"""Goals of earlier servers, read from their recordings. They are never resumed."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import logs
from executive.api.outcome import GoalState, Outcome, cause_of
from executive.errors import ServerRestarted
from executive.recording.recordings import is_server_recording


class _RecordedGoal:
    """Recorded facts about one goal.

    Attributes:
        stamp_ns: Time of acceptance, UTC [ns since 1970].
        record: Record of its acceptance.
        own: Recording of the goal itself; None if there is none.
        result: Record of its end; None if it is missing.
        served: True if a server's recording contains the goal.
    """

    def __init__(self, stamp_ns: int, record: logs.Goal) -> None:
        self.stamp_ns, self.record = stamp_ns, record
        self.own: logs.Recording | None = None
        self.result: logs.Result | None = None
        self.served = False

    @property
    def outcome(self) -> Outcome:
        """The recorded outcome; if it is missing, one with the cause `ServerRestarted`."""
        path = str(self.own.path) if self.own else ""
        if self.result:
            return Outcome.from_record(self.result, path)
        count, duration = 0, 0.0
        with suppress(logs.LogError):  # keep the records before the error
            for frame in self.own.frames() if self.own else ():
                count, duration = count + 1, max(0.0, frame.time - self.record.time)
        cause, task = cause_of(ServerRestarted()), self.record.task
        return Outcome.of(task, GoalState.ABORTED, cause, count, duration, path)


def load_goal_history(folder: Path, since: float) -> Iterator[tuple[str, int, Outcome]]:
    """Yield the goals of earlier servers, and all other goals whose end is not recorded.

    Args:
        folder: Folder of recordings.
        since: Ignore recordings that were last changed before this time [s since 1970].

    Yields:
        Identity, time of acceptance [ns since 1970] and outcome, in order of acceptance.
    """
    goals: dict[str, _RecordedGoal] = {}
    for recording in logs.closed_recordings(folder, since):
        with suppress(logs.LogError):  # keep the records before the error
            _read(recording, goals)
    for identity, goal in sorted(goals.items(), key=lambda item: item[1].stamp_ns):
        if goal.served or goal.result is None:
            yield identity, goal.stamp_ns, goal.outcome


def _read(recording: logs.Recording, goals: dict[str, _RecordedGoal]) -> None:
    served = is_server_recording(recording.path)
    for record in recording.records(logs.Goal, logs.Result):
        if isinstance(record, logs.Goal):
            stamp_ns = recording.epoch_ns + round(record.time * 1e9)
            goal = goals.setdefault(record.goal_id, _RecordedGoal(stamp_ns, record))
            goal.served |= served
            goal.own = goal.own if served else recording
        elif isinstance(record, logs.Result) and record.goal_id in goals:
            goals[record.goal_id].result = record
