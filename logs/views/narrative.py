"""A recording told: in figures, and as a story."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from logs.reading.file_state import being_written
from logs.reading.recording import Recording
from logs.records.conversions import LATE
from logs.records.records import (
    Feedback,
    Goal,
    LogLine,
    NodeStatus,
    Plan,
    Received,
    Result,
    RunRecord,
    Schedule,
    Sent,
    Transition,
)


@dataclass(frozen=True, slots=True)
class Overview:
    """What a recording amounts to.

    Attributes:
        path: The file.
        bytes: Its size [bytes].
        messages: How many messages it holds.
        complete: Whether it has its end and no damage.
        written: Whether it is still being written.
        goal: None where none was recorded, or each in a recording of its own.
        result: Likewise.
        frames: How many frames left, holds included.
        holds: How many of them were holds.
        late: How many frames left how late, to the hundredth [ms].
        planning: What planning each group took, last plan [ms].
        notes: Named facts, such as the versions of libraries.
        files: Names of what is attached.
    """

    path: Path
    bytes: int
    messages: int
    complete: bool
    written: bool
    goal: Goal | None
    result: Result | None
    frames: int
    holds: int
    late: Counter[float]
    planning: dict[str, float]
    notes: dict[str, dict[str, str]]
    files: tuple[str, ...]

    @property
    def waited(self) -> float:
        """How long the goal waited for its turn [s]; 0 where it did not, or has no end."""
        if self.goal is None or self.result is None:
            return 0.0
        return self.result.queued(self.goal)

    @property
    def outcome(self) -> str:
        """The goal's last state, or that the end of the run is missing; `-` without a goal."""
        if self.result:
            return self.result.state
        return "NO END" if self.goal else "-"


def overview(path: Path) -> Overview:
    """Sums a recording up.

    Raises:
        RecordingError: It cannot be read.
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
        recording.messages,
        recording.complete,
        not recording.complete and being_written(path),
        goal,
        result,
        frames,
        holds,
        late,
        planning,
        recording.notes,
        tuple(recording.files),
    )


def narrative(path: Path, everything: bool) -> Iterator[tuple[float, str]]:
    """What happened, line by line, with the time since the goal [s].

    Args:
        path: The recording.
        everything: Whether every frame, received byte and step of progress is told too.

    Raises:
        RecordingError: It cannot be read.
    """
    recording = Recording(path)
    first = next(recording.records(Goal), None) or next(recording.records(), None)
    frames, begun, paused = 0, set(), False
    for record in recording.records():
        assert first
        time = record.time - first.time
        if isinstance(record, Sent) and record.joints:
            frames += 1
            late = 0.0 if record.scheduled is None else record.time - record.scheduled
            if late > LATE and not everything:
                yield time, f"frame {frames} left {late * 1e3:.1f} ms late"
        if isinstance(record, Feedback) and record.paused != paused:
            paused = record.paused
            yield time, "paused" if paused else "resumed"
        if isinstance(record, NodeStatus) and record.path not in begun:
            if record.status == "INVALID":  # as every node is before it begins
                continue
            begun.add(record.path)
        held = isinstance(record, Sent) and record.hold
        if everything or held or not isinstance(record, Sent | Received | Feedback):
            yield time, in_words(record)


def in_words(record: RunRecord) -> str:  # noqa: C901, a table of words
    """One record as a line."""
    match record:
        case Goal() if record.elsewhere:
            return f"goal: task {record.task}"
        case Goal():
            return f"goal: task {record.task} {record.name}, seed {record.seed}"
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
            return f"schedule: {len(record.frames)} frames, {record.firmware}"
        case Sent() if not record.joints:
            return f"setting: {record.text}"
        case Sent(scheduled=None):
            return f"hold: {record.text}"
        case Sent():
            late = (record.time - (record.scheduled or 0.0)) * 1e3
            return f"sent: {record.text} {late:.1f} ms late"
        case Received():
            return f"received: {record.data!r}"
        case Feedback():
            share = "" if record.percentage is None else f"{record.percentage} % "
            return f"progress: {share}{record.phase} {record.node}"
        case LogLine():
            return f"log: {record.logger}: {record.message}"


def bodies_in_words(world: Sequence[Mapping[str, Any]]) -> str:
    """The bodies around the arm, and what holds them."""
    return ", ".join(f"{b['name']} on {b['link']}" if b["link"] else b["name"] for b in world)


def _around(plan: Plan) -> str:
    return f"; around it: {bodies_in_words(plan.world)}" if plan.world else ""
