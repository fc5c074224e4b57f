"""Reads a run from its recording, as a timeline: the values that the figure of a run shows."""

import dataclasses
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import field
from itertools import dropwhile
from pathlib import Path

from hardware.loading.dataclass import dataclass
from logs.errors import RecordingEmpty, RecordingError
from logs.reading.recording import Recording
from logs.records.records import (
    Feedback,
    Goal,
    LeaderState,
    Measured,
    NodeStatus,
    Plan,
    Result,
    RunRecord,
    Sent,
    Transition,
)

_INVALID = "INVALID"
_FAULT = "errorprocessing"
_CANCEL = "cancel"  # first word of the phases of a cancel
_PAUSED = "paused"  # name of a phase and of its mark
_DEEPEST = 200  # largest depth of a node; armtree itself records no deeper tree

_Change = tuple[float, str]  # time at which a state starts [s], and name of the state
_Curves = dict[str, list[tuple[float, float]]]  # times [s] and positions [rad], by joint


@dataclass(frozen=True, slots=True)
class Span:
    """A period in one state, from time `start` to time `end` [s]. Time 0 is the goal's start."""

    state: str
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the figure: the states of one node of the tree.

    Attributes:
        name: Name of the node.
        depth: Number of levels from the root to the node; 0 for the root.
        spans: Periods of the node's states, in order of time.
        message: Last feedback message of the node; empty if there is none.
    """

    name: str
    depth: int
    spans: tuple[Span, ...]
    message: str = ""


@dataclass(frozen=True, slots=True)
class Trace:
    """The positions of one joint during a run. Time 0 is the start of the goal.

    Attributes:
        joint: Name of the joint.
        group: Group of the joint; `joints` if no plan names its group.
        times: Times of the commanded positions [s].
        positions: Commanded positions [rad].
        measured_times: Times of the measured positions [s]; empty if the joint is not measured.
        measured: Measured positions [rad].
        leader_times: Times of the leader's positions [s]; empty if the arm follows no leader.
        leader: Measured positions of the leader that the arm follows [rad].
    """

    joint: str
    group: str
    times: tuple[float, ...]
    positions: tuple[float, ...]
    measured_times: tuple[float, ...] = ()
    measured: tuple[float, ...] = ()
    leader_times: tuple[float, ...] = ()
    leader: tuple[float, ...] = ()

    @property
    def errors(self) -> list[float]:
        """Measured position minus commanded position, for each measurement [rad]."""
        commands = (bisect_right(self.times, time) - 1 for time in self.measured_times)
        pairs = zip(commands, self.measured, strict=True)
        return [q - self.positions[max(command, 0)] for command, q in pairs]


@dataclass(frozen=True, slots=True)
class Timeline:
    """The values that the figure of a run shows.

    Time 0 is the start of the goal. Without a goal, it is the first record.

    Attributes:
        goal: The goal; None if it was not recorded.
        result: Result of the goal; None if it was not recorded.
        start: Start of the time axis [s].
        end: End of the time axis [s].
        traces: Commanded and measured positions, one trace per joint.
        frames: Times at which frames were sent, without holds [s].
        holds: Times at which a stop repeated the last frame [s].
        rows: Nodes of the tree, one row per node, parents above their children.
        lifecycle: Periods of the lifecycle states of the hardware.
        marks: Time [s] and name of each event that all panels show, such as a cancel.
        complete: True if the end of the recording is not missing.
    """

    goal: Goal | None
    result: Result | None
    start: float
    end: float
    traces: tuple[Trace, ...]
    frames: tuple[float, ...]
    holds: tuple[float, ...]
    rows: tuple[Row, ...]
    lifecycle: tuple[Span, ...]
    marks: tuple[tuple[float, str], ...]
    complete: bool


def timeline(path: Path) -> Timeline:
    """Return the timeline of a recorded run. If a file has several goals, the last goal counts.

    Raises:
        RecordingError: The file cannot be read, or its tree is too deep. A file that was cut off
            raises no error; `Timeline.complete` is then False.
    """
    try:
        recording = Recording(path)
    except RecordingEmpty:
        return timeline_of((), complete=False)
    events = _Events()
    for record in recording.records():
        if isinstance(record, NodeStatus) and record.path.count("/") > _DEEPEST:
            raise RecordingError(path, f"its tree is deeper than {_DEEPEST} nodes")
        events.add(record)
    return events.timeline(recording.complete)  # `complete` is known after all records


def timeline_of(records: Iterable[RunRecord], complete: bool = True) -> Timeline:
    """Return the timeline of a run.

    Args:
        records: Records of the run, in order of time.
        complete: True if no record is missing at the end of the run.
    """
    events = _Events()
    for record in records:
        events.add(record)
    return events.timeline(complete)


@dataclasses.dataclass
class _Events:
    """Collects the records of a run for its timeline. Times are on the records' clock [s]."""

    goal: Goal | None = None
    result: Result | None = None
    first: float | None = None
    last: float = 0.0
    motions: list[dict[str, Plan]] = field(default_factory=list)  # plans of each motion, by group
    moved: bool = True  # True if the arm moved since the last plan
    starts: dict[str, tuple[float, float]] = field(default_factory=dict)
    joints: _Curves = field(default_factory=dict)
    measured: _Curves = field(default_factory=dict)
    leader: _Curves = field(default_factory=dict)
    sent: list[Sent] = field(default_factory=list)
    tree: dict[str, list[_Change]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    messages: dict[str, str] = field(default_factory=dict)
    lifecycle: list[_Change] = field(default_factory=list)
    canceled: float | None = None
    pauses: list[_Change] = field(default_factory=list)
    faults: list[float] = field(default_factory=list)

    def add(self, record: RunRecord) -> None:
        if self.first is None:
            self.first = record.time
        self.last = max(self.last, record.time)
        match record:
            case Goal() if not record.elsewhere:
                self.goal, self.result, self.canceled = record, None, None
                self.faults, self.pauses, self.motions, self.moved = [], [], [], True
            case Result() if self.goal:
                self.result = record
            case Sent() | Measured() | LeaderState() if record.joints:
                self._add_positions(record)
            case Plan():
                self._add_plan(record)
            case NodeStatus():
                self.names[record.path] = record.name
                self.messages[record.path] = record.message or self.messages.get(record.path, "")
                self.tree.setdefault(record.path, []).append((record.time, record.status))
            case Feedback():
                self._add_progress(record)
            case Transition():
                self._add_transition(record, self.first)

    def _add_positions(self, record: Sent | Measured | LeaderState) -> None:
        match record:
            case Measured():
                _add(self.measured, record.time, record.joints, record.position)
            case LeaderState():
                _add(self.leader, record.time, record.joints, record.positions)
            case Sent():
                self._add_frame(record)

    def _add_frame(self, record: Sent) -> None:
        self.moved = True
        self.sent.append(record)
        for joint, position in zip(record.joints, record.positions, strict=True):
            known = self.joints.setdefault(joint, [])
            if not known and joint in self.starts:
                known.append(self.starts[joint])
            known.append((record.time, position))

    def _add_plan(self, plan: Plan) -> None:
        if self.moved:
            self.motions.append({})
            self.moved = False
        self.motions[-1][plan.group] = plan
        if plan.positions:  # the first row has the positions before the first frame
            for joint, position in zip(plan.joints, plan.positions[0], strict=True):
                self.starts.setdefault(joint, (plan.time, position))

    def _add_progress(self, feedback: Feedback) -> None:
        if self.canceled is None and feedback.phase.lower().startswith(_CANCEL):
            self.canceled = feedback.time
        paused = bool(self.pauses) and self.pauses[-1][1] == _PAUSED
        if feedback.paused != paused:
            self.pauses.append((feedback.time, "resumed" if paused else _PAUSED))

    def _add_transition(self, transition: Transition, first: float) -> None:
        if not self.lifecycle:
            self.lifecycle.append((first, transition.start))
        self.lifecycle.append((transition.time, transition.goal))
        if transition.goal == _FAULT:
            self.faults.append(transition.time)

    def timeline(self, complete: bool) -> Timeline:
        end = self._since(self.last)
        first = self._since(self.first or 0.0)
        start = max(min(first, 0.0), -0.1 * max(end, 0.1))
        return Timeline(
            goal=self.goal,
            result=self.result,
            start=start,
            end=max(end, start + 1e-3),
            traces=tuple(self._traces(end)),
            frames=tuple(self._since(sent.time) for sent in self.sent if not sent.hold),
            holds=tuple(self._since(sent.time) for sent in self.sent if sent.hold),
            rows=tuple(self._row(path, end) for path in _in_tree_order(self.tree)),
            lifecycle=self._spans(self.lifecycle, end),
            marks=tuple(sorted((self._since(time), name) for time, name in self._marks())),
            complete=complete,
        )

    def _since(self, time: float) -> float:
        return time - (self.goal.time if self.goal else self.first or 0.0)

    def _spans(self, changes: list[_Change], end: float) -> tuple[Span, ...]:
        starts = [self._since(time) for time, _ in changes]
        states = [state for _, state in changes]
        return tuple(map(Span, states, starts, [*starts[1:], end]))

    def _row(self, path: str, end: float) -> Row:
        spans = self._spans(_begun(self.tree[path]), end)
        return Row(self.names[path], len(_parts(path)) - 1, spans, self.messages[path])

    def _traces(self, end: float) -> list[Trace]:
        plans = [plan for motion in self.motions for plan in motion.values()]
        groups = {joint: plan.group for plan in plans for joint in plan.joints}
        traces = []
        for joint, known in self.joints.items():
            times, positions = zip(*known, strict=True)
            since = (*map(self._since, times), end)
            group = groups.get(joint, "joints")
            measured, leader = (self._curve(each, joint) for each in (self.measured, self.leader))
            traces.append(
                Trace(joint, group, since, (*positions, positions[-1]), *measured, *leader)
            )
        return traces

    def _curve(self, curves: _Curves, joint: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the times [s] and positions [rad] of a joint. Time 0 is the start of the goal."""
        samples = curves.get(joint, [])
        return tuple(self._since(time) for time, _ in samples), tuple(q for _, q in samples)

    def _marks(self) -> list[_Change]:
        marks = []
        for motion in self.motions:
            failed = any(plan.code for plan in motion.values())
            ready = max(plan.time for plan in motion.values())
            marks.append((ready, "no plan" if failed else "plan ready"))
        if (cancel := self._cancel()) is not None:
            marks.append((cancel, _CANCEL))
        return [*marks, *self.pauses, *((time, "fault") for time in self.faults)]

    def _cancel(self) -> float | None:
        """Return the time of the cancel [s], or None if the goal was not canceled.

        This is the start of the phase `canceling`. Without this phase, it is the first hold or
        interrupted node.
        """
        if self.canceled is not None or self.result is None or self.result.state != "CANCELED":
            return self.canceled
        effects = [sent.time for sent in self.sent if sent.hold]
        changes = [change for node in self.tree.values() for change in _begun(node)]
        effects += [time for time, state in changes if state == _INVALID]
        return min(effects, default=None)


def _add(curves: _Curves, time: float, joints: Sequence[str], positions: Sequence[float]) -> None:
    for joint, position in zip(joints, positions, strict=True):
        curves.setdefault(joint, []).append((time, position))


def _begun(changes: list[_Change]) -> list[_Change]:
    """Return the changes of a node's state without those before its first tick (INVALID)."""
    return list(dropwhile(lambda change: change[1] == _INVALID, changes))


def _parts(path: str) -> list[str]:
    return path.strip("/").split("/")


def _in_tree_order(paths: Iterable[str]) -> list[str]:
    """Return paths of nodes in tree order: parents before their children.

    Siblings keep the order of the given paths.
    """
    rank: dict[tuple[str, ...], int] = {}
    for path in paths:
        parts = _parts(path)
        for depth in range(1, len(parts) + 1):
            rank.setdefault(tuple(parts[:depth]), len(rank))

    def place(path: str) -> list[int]:
        parts = _parts(path)
        return [rank[tuple(parts[:depth])] for depth in range(1, len(parts) + 1)]

    return sorted(paths, key=place)
