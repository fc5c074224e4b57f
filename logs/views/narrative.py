"""A recording in words: a summary of the run, and a narrative with one line per event."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hardware.loading.dataclass import dataclass
from hardware.printable import plural, wire_text
from logs.errors import RecordingError, RecordingInUse
from logs.reading.file_state import being_written
from logs.reading.indexed import IndexedRecording
from logs.reading.recording import Recording
from logs.records.conversions import LATE
from logs.records.file_format import RECOVERED
from logs.records.records import (
    Feedback,
    Goal,
    LeaderState,
    LogLine,
    Measured,
    NodeStatus,
    Plan,
    Received,
    Result,
    RunRecord,
    Schedule,
    Sent,
    Transition,
    goal_title,
)

_FREQUENT = Sent | Received | Measured | LeaderState | Feedback


@dataclass(frozen=True, slots=True)
class Listing:
    """A short summary of a recording, for a list.

    Attributes:
        path: The file.
        bytes: Size of the file [bytes].
        complete: True if the end of the file is not missing, and no part that was read is damaged.
        written: True if the recording is being written.
        recovered: True if the recording was cut off or damaged, and was recovered. The end of the
            run may then be missing.
        goal: Goal of the run; None in a recording without a goal, such as a server's own recording.
        result: Result of the goal; None if it has none.
        frames: Number of frames sent, including holds.
    """

    path: Path
    bytes: int
    complete: bool
    written: bool
    recovered: bool
    goal: Goal | None
    result: Result | None
    frames: int

    @property
    def waited(self) -> float:
        """How long the goal waited in the queue [s]; 0 if it did not wait or has no result."""
        if self.goal is None or self.result is None:
            return 0.0
        return self.result.queued(self.goal)

    @property
    def outcome(self) -> str:
        """Final state of the goal; `NO END` if the goal has no result; `-` if there is no goal."""
        if self.result:
            return self.result.state
        return "NO END" if self.goal else "-"

    def to_json(self) -> dict[str, Any]:
        """Return the summary as `log_ls` in `docs/output.schema.json`, but without `pinned`."""
        goal, result = self.goal, self.result
        return {
            "file": str(self.path),
            "bytes": self.bytes,
            "complete": self.complete,
            "being_written": self.written,
            "recovered": self.recovered,
            "task": goal.task if goal else None,
            "name": goal.name if goal else None,
            "seed": goal.seed if goal else None,
            "state": result.state if result else None,
            "code": result.code if result else None,
            "message": result.message if result else None,
            "duration_s": result.duration if result else None,
            "queued_s": self.waited,
            "frames": self.frames,
        }


@dataclass(frozen=True, slots=True)
class Overview(Listing):
    """A full summary of a recording that was read to its end.

    Attributes:
        messages: Number of messages.
        holds: Number of holds.
        late: Number of frames for each delay [ms]. Delays are rounded to 0.01 ms.
        planning: Planning time of the last plan of each group [ms], by group.
        notes: Notes by name, such as `versions`.
        files: Names of the attachments.
    """

    messages: int
    holds: int
    late: Counter[float]
    planning: dict[str, float]
    notes: dict[str, dict[str, str]]
    files: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the summary as `log_info` in `docs/output.schema.json`."""
        late = sorted(self.late.elements())
        return Listing.to_json(self) | {
            "messages": self.messages,
            "holds": self.holds,
            "median_late_ms": late[(len(late) - 1) // 2] if late else None,
            "most_late_ms": late[-1] if late else None,
            "planning_ms": self.planning,
            "attached": list(self.files),
            "configuration": self.notes.get("configuration", {}),
            "versions": self.notes.get("versions", {}),
        }


def listing(path: Path) -> Listing:
    """Return a short summary of a recording. Reads only its index, goal and result.

    If the recording has no index, or a part is damaged, reads the whole file.

    Raises:
        RecordingError: The recording cannot be read.
    """
    try:
        recording = IndexedRecording(path)
        goal, result = recording.record_at(0, Goal), recording.record_at(-1, Result)
        frames, recovered = recording.count("/joint_states"), RECOVERED in recording.notes
    except (RecordingInUse, RecordingError):
        return overview(path)
    if goal is None or goal.elsewhere:
        goal = result = None
    return Listing(path, path.stat().st_size, True, False, recovered, goal, result, frames)


def overview(path: Path) -> Overview:
    """Return a full summary of a recording. Reads the whole file.

    Raises:
        RecordingError: The recording cannot be read.
    """
    recording = Recording(path)
    goal: Goal | None = None
    result: Result | None = None
    late: Counter[float] = Counter()
    frames, holds, planning = 0, 0, {}
    for record in recording.records(Goal, Result, Sent, Plan):
        match record:
            case Goal() if not record.elsewhere:
                goal = record
            case Result() if goal:
                result = record
            case Plan():
                planning[record.group] = sum(record.milliseconds.values())
            case Sent():
                frames += bool(record.joints)
                holds += record.hold
                if record.scheduled is not None:
                    late[round((record.time - record.scheduled) * 1e3, 2)] += 1
    return Overview(
        path,
        path.stat().st_size,
        recording.complete,
        not recording.complete and being_written(path),
        RECOVERED in recording.notes,
        goal,
        result,
        frames,
        recording.messages,
        holds,
        late,
        planning,
        recording.notes,
        tuple(recording.files),
    )


def narrative(path: Path, everything: bool) -> Iterator[tuple[float, str]]:
    """Yield a line for each event of a run, with its time [s].

    Time 0 is the time of the first goal, or of the first record if there is no goal.

    Args:
        path: The recording.
        everything: True to include all frames, received bytes, measurements and progress reports.

    Raises:
        RecordingError: The recording cannot be read.
    """
    recording = Recording(path)
    first = next(recording.records(Goal), None) or next(recording.records(), None)
    frames, started, paused = 0, set(), False
    for record in recording.records():
        assert first
        time = record.time - first.time
        if isinstance(record, Sent) and record.joints:
            frames += 1
            late = 0.0 if record.scheduled is None else record.time - record.scheduled
            if late > LATE and not everything:
                yield time, f"frame {frames} was sent {late * 1e3:.1f} ms late"
        if isinstance(record, Feedback) and record.paused != paused:
            paused = record.paused
            yield time, "paused" if paused else "resumed"
        if isinstance(record, NodeStatus) and record.path not in started:
            if record.status == "INVALID":  # the status of a node before its start
                continue
            started.add(record.path)
        held = isinstance(record, Sent) and record.hold
        if everything or held or not isinstance(record, _FREQUENT):
            yield time, line(record)


def line(record: RunRecord) -> str:  # noqa: C901, a table of words
    """Return a line of text that describes a record."""
    match record:
        case Goal() if record.elsewhere:
            return f"goal: {goal_title(record.task)}"
        case Goal():
            return f"goal: {goal_title(record.task, record.name)}, seed {record.seed}"
        case Result():
            return f"result: {record.state} ({record.code}) {record.message}"
        case Transition(label=""):
            return f"arm: {record.goal}"
        case Transition():
            return f"arm: {record.start} -> {record.goal} ({record.label})"
        case NodeStatus():
            return f"tree: {record.path} {record.status} {record.message}".rstrip()
        case Plan(code=""):
            spent = sum(record.milliseconds.values())
            motion = f"{record.duration:.2f} s of motion in {spent:.1f} ms"
            return f"plan: {record.group}, {motion}{_around(record)}"
        case Plan():
            return f"no plan: {record.group}, {record.message}{_around(record)}"
        case Schedule():
            return f"schedule: {plural(len(record.frames), 'frame')}, {record.firmware}"
        case Sent() if not record.joints:
            return f"setting: {record.text}"
        case Sent(scheduled=None):
            return f"hold: {record.text}"
        case Sent():
            late = (record.time - (record.scheduled or 0.0)) * 1e3
            return f"sent: {record.text} {late:.1f} ms late"
        case Received():
            return f"received: {wire_text(record.data)!r}"
        case Measured():
            return f"measured [rad]: {_positions_text(record.joints, record.position)}"
        case LeaderState():
            return f"leader [rad]: {_positions_text(record.joints, record.positions)}"
        case Feedback():
            share = "" if record.percentage is None else f"{record.percentage} % "
            return f"progress: {share}{record.phase} {record.node}"
        case LogLine():
            return f"log: {record.logger}: {record.message}"


def bodies_text(world: Sequence[Mapping[str, Any]]) -> str:
    """Return the names of bodies as a str. An attached body has the name of its link, too."""
    return ", ".join(f"{b['name']} on {b['link']}" if b["link"] else b["name"] for b in world)


def _positions_text(joints: Sequence[str], positions: Sequence[float]) -> str:
    return ", ".join(f"{name} {q:.3f}" for name, q in zip(joints, positions, strict=True))


def _around(plan: Plan) -> str:
    return f"; bodies: {bodies_text(plan.world)}" if plan.world else ""
