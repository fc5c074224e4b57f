"""A run as it is drawn: what happened when, in seconds since its goal."""

from dataclasses import dataclass, field
from itertools import dropwhile
from pathlib import Path
from typing import Any

from logs.errors import RecordingTruncated
from logs.reading.reader import Message, read
from logs.reading.recording import fields_of

_PLAN = "/plan/"
_INVALID = "INVALID"
_FAULT = "errorprocessing"
_PAUSED = "paused"  # a phase, and its mark

_Plans = dict[str, tuple[int, dict[str, Any]]]  # when the last of each group was made [ns], and it


@dataclass(frozen=True)
class Span:
    """A state that held from `start` to `end` [s since the goal]."""

    state: str
    start: float
    end: float


@dataclass(frozen=True)
class Row:
    """The states of one node of the tree, `depth` levels below the root."""

    name: str
    depth: int
    spans: tuple[Span, ...]


@dataclass(frozen=True)
class Trace:
    """The commanded positions [rad] of one joint at `times` [s since the goal]."""

    joint: str
    group: str
    times: tuple[float, ...]
    positions: tuple[float, ...]


@dataclass(frozen=True)
class Timeline:
    """Everything that a plot of a run shows; times are [s since the goal].

    Attributes:
        goal: Fields of the goal, empty where none was recorded.
        result: Fields of the result, empty where none was recorded.
        start: Where the drawing starts [s].
        end: Where it ends [s].
        traces: Commanded positions, joint by joint.
        frames: When frames were sent [s].
        holds: When a stop repeated the last frame [s].
        rows: The tree, parents above their children.
        lifecycle: States of the hardware.
        marks: Moments worth a line across everything, with what happened then.
        complete: Whether the recording has its end.
    """

    goal: dict[str, Any]
    result: dict[str, Any]
    start: float
    end: float
    traces: tuple[Trace, ...]
    frames: tuple[float, ...]
    holds: tuple[float, ...]
    rows: tuple[Row, ...]
    lifecycle: tuple[Span, ...]
    marks: tuple[tuple[float, str], ...]
    complete: bool


def timeline(recording: Path) -> Timeline:
    """Reads a run; of several goals in one file the last one counts.

    Raises:
        RecordingError: The file cannot be read. A cut one can: see `Timeline.complete`.
    """
    events = _Events()
    try:
        for message in read(recording):
            events.add(message)
    except RecordingTruncated:
        events.complete = False
    return events.timeline()


@dataclass
class _Events:
    """What is met in the file, times being [ns] until the goal's is known."""

    goal: dict[str, Any] = field(default_factory=dict)
    result: dict[str, Any] = field(default_factory=dict)
    goal_ns: int | None = None
    first_ns: int | None = None
    last_ns: int = 0
    motions: list[_Plans] = field(default_factory=list)  # what was planned between any two frames
    moved: bool = True  # since what was planned last
    starts: dict[str, list[tuple[int, float]]] = field(default_factory=dict)
    joints: dict[str, list[tuple[int, float]]] = field(default_factory=dict)
    timing: list[tuple[int, bool]] = field(default_factory=list)
    tree: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    lifecycle: list[tuple[int, str]] = field(default_factory=list)
    cancel_ns: int | None = None
    pauses: list[tuple[int, str]] = field(default_factory=list)  # and what followed them
    faults_ns: list[int] = field(default_factory=list)
    complete: bool = True

    def add(self, message: Message) -> None:
        take = _TAKERS.get(message.topic)
        if take is not None:
            take(self, message)
        elif message.topic.startswith(_PLAN) and hasattr(message.data, "data"):
            self._take_plan(message)
        if self.first_ns is None:
            self.first_ns = message.time_ns
        self.last_ns = max(self.last_ns, message.time_ns)

    def take_goal(self, message: Message) -> None:
        goal = fields_of(message)
        if not goal["seed"]:  # a recording of its own tells of it
            return
        self.goal, self.goal_ns = goal, message.time_ns
        self.result, self.cancel_ns, self.faults_ns, self.pauses = {}, None, [], []
        self.motions, self.moved = [], True

    def take_result(self, message: Message) -> None:
        if self.goal:
            self.result = fields_of(message)

    def take_joints(self, message: Message) -> None:
        self.moved = True
        state = message.data
        for joint, position in zip(state.name, state.position, strict=False):
            known = self.joints.setdefault(joint, self.starts.get(joint, []))
            known.append((message.time_ns, float(position)))

    def _take_plan(self, message: Message) -> None:
        plan = fields_of(message)
        if self.moved:
            self.motions.append({})
            self.moved = False
        self.motions[-1][plan["group"]] = (message.time_ns, plan)
        if plan["positions"]:  # where a joint stands before its first frame
            for joint, position in zip(plan["joints"], plan["positions"][0], strict=True):
                self.starts.setdefault(joint, [(message.time_ns, position)])

    def take_timing(self, message: Message) -> None:
        self.timing.append((message.time_ns, bool(message.fields().get("hold"))))

    def take_node(self, message: Message) -> None:
        node = fields_of(message)
        self.names[node["path"]] = node["name"]
        self.tree.setdefault(node["path"], []).append((message.time_ns, node["status"]))

    def take_progress(self, message: Message) -> None:
        phase = fields_of(message)["phase"]
        if self.cancel_ns is None and phase.lower().startswith("cancel"):
            self.cancel_ns = message.time_ns
        paused = bool(self.pauses) and self.pauses[-1][1] == _PAUSED
        if (phase == _PAUSED) != paused:
            self.pauses.append((message.time_ns, "resumed" if paused else _PAUSED))

    def take_transition(self, message: Message) -> None:
        if not self.lifecycle and self.first_ns is not None:
            self.lifecycle.append((self.first_ns, message.data.start_state.label))
        self.lifecycle.append((message.time_ns, message.data.goal_state.label))
        if message.data.goal_state.label == _FAULT:
            self.faults_ns.append(message.time_ns)

    def timeline(self) -> Timeline:
        end = self._since(self.last_ns)
        first = self._since(self.first_ns or 0)
        start = max(min(first, 0.0), -0.1 * max(end, 0.1))
        return Timeline(
            goal=self.goal,
            result=self.result,
            start=start,
            end=max(end, start + 1e-3),
            traces=tuple(self._traces(end)),
            frames=tuple(self._since(ns) for ns, hold in self.timing if not hold),
            holds=tuple(self._since(ns) for ns, hold in self.timing if hold),
            rows=tuple(self._row(path, end) for path in _in_tree_order(self.tree)),
            lifecycle=self._spans(self.lifecycle, end),
            marks=tuple(sorted(self._marks())),
            complete=self.complete,
        )

    def _since(self, time_ns: int) -> float:
        zero = self.goal_ns if self.goal_ns is not None else self.first_ns or 0
        return (time_ns - zero) / 1e9

    def _spans(self, changes: list[tuple[int, str]], end: float) -> tuple[Span, ...]:
        starts = [self._since(ns) for ns, _ in changes]
        ends = [*starts[1:], end]
        states = [state for _, state in changes]
        return tuple(map(Span, states, starts, ends))

    def _row(self, path: str, end: float) -> Row:
        depth = len(_parts(path)) - 1
        return Row(self.names[path], depth, self._spans(_begun(self.tree[path]), end))

    def _traces(self, end: float) -> list[Trace]:
        plans = [plan for motion in self.motions for _, plan in motion.values()]
        groups = {joint: plan["group"] for plan in plans for joint in plan["joints"]}
        traces = []
        for joint, known in self.joints.items():
            times, positions = zip(*known, strict=True)
            since = (*map(self._since, times), end)
            group = groups.get(joint, "joints")
            traces.append(Trace(joint, group, since, (*positions, positions[-1])))
        return traces

    def _marks(self) -> list[tuple[float, str]]:
        marks = []
        for motion in self.motions:
            failed = any(plan["code"] for _, plan in motion.values())
            ready = max(time_ns for time_ns, _ in motion.values())
            marks.append((self._since(ready), "no plan" if failed else "plan ready"))
        if (cancel := self._cancel()) is not None:
            marks.append((self._since(cancel), "cancel"))
        marks += [(self._since(time_ns), what) for time_ns, what in self.pauses]
        return marks + [(self._since(time_ns), "fault") for time_ns in self.faults_ns]

    def _cancel(self) -> int | None:
        if self.cancel_ns is not None or self.result.get("state") != "CANCELED":
            return self.cancel_ns
        signs = [ns for ns, hold in self.timing if hold]
        changes = [change for node in self.tree.values() for change in _begun(node)]
        signs += [time_ns for time_ns, state in changes if state == _INVALID]
        return min(signs, default=None)


_TAKERS = {
    "/goal": _Events.take_goal,
    "/result": _Events.take_result,
    "/joint_states": _Events.take_joints,
    "/serial/timing": _Events.take_timing,
    "/tree": _Events.take_node,
    "/progress": _Events.take_progress,
    "/lifecycle": _Events.take_transition,
}


def _begun(changes: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """A node's changes from its first tick on: before that it is invalid, yet nothing failed."""
    return list(dropwhile(lambda change: change[1] == _INVALID, changes))


def _parts(path: str) -> list[str]:
    return path.strip("/").split("/")


def _in_tree_order(paths: dict[str, Any]) -> list[str]:
    """Parents above their children, siblings in the order in which they first changed."""
    rank: dict[tuple[str, ...], int] = {}
    for path in paths:
        parts = _parts(path)
        for depth in range(1, len(parts) + 1):
            rank.setdefault(tuple(parts[:depth]), len(rank))

    def place(path: str) -> list[int]:
        parts = _parts(path)
        return [rank[tuple(parts[:depth])] for depth in range(1, len(parts) + 1)]

    return sorted(paths, key=place)
