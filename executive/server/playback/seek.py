"""Seeks in a recording: the events around any moment, with the state before them.

A recording is divided into windows of some hundred events. A client gets one window at a time, so
it never loads a whole recording.
"""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import chain, dropwhile, groupby, takewhile
from math import isfinite
from pathlib import Path
from typing import Any, Generic, TypeVar

import logs
from executive.api.events import EVENTS, STATUS, QuestionStatus, event_to_json
from executive.api.outcome import GoalState, GoalStatus, Outcome, cause_of
from executive.errors import ServerRestarted
from hardware.loading.dataclass import dataclass
from logs.reading.indexed import Chunk, Entry, IndexedRecording, OpenChunk
from logs.reading.mcap_records import Decoder

from .node_state import NodeState

POINTS = 2000  # largest number of samples of positions of a recording
_ROUNDING = 1e-6  # rounding error of times [s]
_AHEAD = 2  # number of chunks that are unpacked ahead
_EVENTS = 500  # smallest number of events in a window; a window ends at the end of a chunk

# A window also ends after this number of bytes, or after this number per node of the tree.
_WINDOW_BYTES, _PER_NODE = 4 << 20, 1000

# Largest sizes of messages that are in memory together [bytes]: those of nodes of the tree, plus a
# number for each byte of the file; those of a plot; those of an answer. The plans and the schedule
# of a motion of 10 minutes have up to 30 MB.
_NODE_BYTES, _NODE_BYTES_PER_BYTE, _PLOT_BYTES, _ANSWER_BYTES = 32 << 20, 16, 8 << 20, 64 << 20
_LINE_BYTES = 4 << 20  # largest size of the lines of the log in an answer [bytes]

_COMMANDED, _MEASURED = "/joint_states", "/joint_states/measured"
_SCHEDULE = "/schedule"
_TIMING, _PROGRESS, _LOG = "/serial/timing", "/progress", "/rosout"
_SENT = ("/serial/tx", _TIMING, _COMMANDED)  # messages of a frame, in file order
_GOAL, _RESULT, _TREE = "/goal", "/result", "/tree"
_STATE = (logs.Transition, logs.Feedback, logs.Plan, logs.Schedule, logs.Measured)
_STEPS = (logs.Goal, logs.NodeStatus, logs.Plan, logs.Schedule, logs.Result)
_SENT_AS_EVENTS = (
    *(kind for kind in EVENTS if kind not in (QuestionStatus, logs.Received)),
    logs.Result,
)

Json = dict[str, Any]
T = TypeVar("T")
_Sample = tuple[float, dict[str, float]]  # sample: time [s], and positions by joint
_Take = Callable[[logs.Message], logs.Message]  # limits the size of messages
_Node = tuple[NodeState, logs.Message]  # state of a node, and its last message


@dataclass(frozen=True, slots=True)
class _Place:
    """The position of a message in the file."""

    chunk: Chunk
    topic: str
    entry: Entry


@dataclass(frozen=True, slots=True)
class _Window:
    """A part of a recording.

    Attributes:
        begin: Start of the window [s].
        first: Number of its first chunk.
        nodes: State of each node before the window, with its last message, by path.
        newest: Newest message before the window, by topic.
    """

    begin: float
    first: int
    nodes: Mapping[str, _Node]
    newest: Mapping[str, _Place]


class _Allowance:
    """Limits the size of messages that are in memory together.

    Args:
        path: The recording.
        size: Largest size [bytes].
        what: The messages, in words.
    """

    def __init__(self, path: Path, size: int, what: str) -> None:
        self._path, self._size, self._left, self._what = path, size, size, what

    def take(self, message: logs.Message, in_place_of: logs.Message | None = None) -> logs.Message:
        """Count a message, and no longer count another message that it replaces.

        Raises:
            RecordingError: The messages are too large.
        """
        self._left -= len(message.cdr) - (len(in_place_of.cdr) if in_place_of else 0)
        if self._left < 0:
            what = f"{self._what} take more than {self._size >> 20} MiB"
            raise logs.RecordingError(self._path, f"{what}; another program recorded it")
        return message


class _Thinned(Generic[T]):
    """Values of at most `POINTS` messages on a topic, spread over the recording.

    Args:
        topic: The topic.
        recording: The recording.
        decode: Callback that returns the value of a message; None to leave it out.
    """

    def __init__(
        self, topic: str, recording: IndexedRecording, decode: Callable[[logs.Message], T | None]
    ) -> None:
        self._topic, self._decode = topic, decode
        self._next = recording.begin_ns
        self._step = (recording.end_ns - recording.begin_ns) // POINTS
        self._allowance = _Allowance(recording.path, _PLOT_BYTES, f"samples of {topic}")
        self.values: list[T] = []

    def add(self, opened: OpenChunk) -> None:
        """Add the messages of the next chunk.

        Raises:
            RecordingError: The messages are too large.
        """
        entries, at = opened.entries(self._topic), 0
        while len(self.values) < POINTS:
            at = bisect_left(entries, (self._next, 0), at)
            if at == len(entries):
                break
            self._next = entries[at][0] + self._step
            value = self._decode(self._allowance.take(opened.message(self._topic, entries[at])))
            self.values += [] if value is None else [value]
            at += 1


class Timeline:
    """The events of a recording with an index, around any moment. Any thread may call.

    Args:
        path: The recording.
        written: True if the run may still be under way. If False, and the recording has no end of
            the run, the last event is an end with the cause `ServerRestarted`.

    Attributes:
        goal: The goal, or None.
        began: Start of the goal, or of the recording if it has no goal [s].
        duration: Time from `began` to the last message [s].
    """

    def __init__(self, path: Path, written: bool = False) -> None:
        """Read the whole recording once, decoding only a part.

        Raises:
            LogError: The recording is being written, damaged, or not of armtree.
        """
        self._recording = recording = IndexedRecording(path)
        self._topics = recording.topics_of(*_SENT_AS_EVENTS)
        self._windows: list[_Window] = []
        self.steps: list[float] = []
        self._goal_chunk = len(recording.chunks)
        self._commanded = _Thinned(_COMMANDED, recording, self._sample)
        self._measured = _Thinned(_MEASURED, recording, self._sample)
        self._timing = _Thinned(_TIMING, recording, _lateness)
        self._progress: _Thinned[logs.Record] = _Thinned(_PROGRESS, recording, self._record_of)
        self._lines = deque[_Place](maxlen=POINTS)
        self._plan_topics = set(recording.topics_of(logs.Plan))
        self._plans: dict[str, _Place] = {}  # one plan of each topic
        self.goal: logs.Goal | None = None
        self._frames = 0  # number of sent frames
        self._read()
        self.began = self.goal.time if self.goal else self._time(recording.begin_ns)
        self.duration = max(0.0, self._time(recording.end_ns) - self.began)
        self._ended = bool(recording.with_topic((_RESULT,)))
        self._cut_off = not (self._ended or written)
        self.steps = sorted({round(max(0.0, each - self.began), 6) for each in self.steps})

    def to_json(self) -> Json:
        """Return a JSON object: name, start, duration, and True if the run's end is recorded."""
        return {
            "name": self._recording.path.name,
            "began_s": self.began,
            "duration_s": self.duration,
            "ended": self._ended,
        }

    def events(self, at: float) -> Json:
        """Return the window around a moment.

        Args:
            at: The moment, from the beginning of the goal [s].

        Returns:
            `from_s` and `to_s`, start and end of the window; `state`, events that restore the state
            before the window; `events` of the window; `previous_s` and `next_s`, times of the last
            step before the window and of the first step after it, or None. Times are from the
            beginning of the goal [s]. `state` and `events` are iterators, which may also raise
            RecordingError.

        Raises:
            RecordingError: The recording is damaged, or its messages are too large.
        """
        begins = [window.begin for window in self._windows]
        number = max(0, bisect_right(begins, at + self.began + _ROUNDING) - 1)
        window = self._windows[number]
        is_last = number == len(self._windows) - 1
        end = self.duration if is_last else self._windows[number + 1].begin - self.began
        chunks = self._recording.chunks
        until = len(chunks) if is_last else self._windows[number + 1].first
        begin = window.begin - self.began if number else 0.0
        take = _Allowance(self._recording.path, _ANSWER_BYTES, "events of one moment").take
        before = bisect_right(self.steps, begin - _ROUNDING)
        after = bisect_right(self.steps, end)
        return {
            "from_s": begin,
            "to_s": end,
            "state": self._state(window, take),
            "events": chain(
                map(self._event, self._records(window.first, until, take)),
                self._lost_end() if is_last else (),
            ),
            "previous_s": self.steps[before - 1] if before else None,
            "next_s": None if after >= len(self.steps) else self.steps[after],
        }

    def mesh(self, name: str) -> bytes | None:
        """Return a mesh of a body by its name in the record of a plan, or None."""
        return self._recording.files.get(name)

    def series(self, points: int) -> Json:
        """Return the data of the plots of the whole run.

        Args:
            points: Largest number of samples, up to `POINTS`.

        Raises:
            RecordingError: The recording is damaged, or its messages are too large.

        Returns:
            `commanded` and `measured` positions, the `lateness` of frames, the
            `velocity_limits` by joint, and as `events` the progress and the newest lines of the
            log. Times of samples are from the beginning of the goal [s].
        """
        return {
            "commanded": self._sampled(self._commanded, points, self._last_pose()),
            "measured": self._sampled(self._measured, points, []),
            "lateness": {
                "times_s": [time - self.began for time, _ in self._timing.values],
                "late_s": [late for _, late in self._timing.values],
            },
            "velocity_limits": {
                joint: limit
                for plan in map(self._record_of, self._read_places(self._plans.values()))
                if isinstance(plan, logs.Plan)
                for joint, limit in zip(plan.joints, plan.velocity_limits, strict=False)
                if isfinite(limit)
            },
            "events": [
                event_to_json(record) for record in (*self._progress.values, *self._newest_lines())
            ],
        }

    def _read_places(self, places: Iterable[_Place]) -> Iterator[logs.Message]:
        for chunk, group in groupby(places, lambda place: place.chunk):
            opened = self._recording.open(chunk)
            for place in group:
                yield opened.message(place.topic, place.entry)

    def _newest_lines(self) -> list[logs.Record]:
        """Return the newest lines of the log, up to `_LINE_BYTES`."""
        found, size = list[logs.Record](), 0
        for message in self._read_places(reversed(self._lines)):
            size += len(message.cdr)
            if size > _LINE_BYTES:
                break
            found.append(self._record_of(message))
        return found[::-1]

    def _message(self, place: _Place) -> logs.Message:
        return self._recording.open(place.chunk).message(place.topic, place.entry)

    def _record_of(self, message: logs.Message) -> logs.Record:
        return self._recording.record([message])

    def _sample(self, message: logs.Message) -> _Sample | None:
        row = dict(zip(message.data.name, message.data.position, strict=False))
        return (self._time(message.time_ns), row) if all(map(isfinite, row.values())) else None

    def _sampled(self, samples: _Thinned[_Sample], points: int, last: list[_Sample]) -> Json:
        step = max(1, -(-len(samples.values) // max(1, points - len(last))))
        found = samples.values[::step]
        found = [each for each in found if not last or each[0] < last[0][0]] + last
        joints = list(dict.fromkeys(joint for _, row in found for joint in row))
        return {
            "times_s": [time - self.began for time, _ in found],
            "positions": {joint: [row.get(joint) for _, row in found] for joint in joints},
        }

    def _last_pose(self) -> list[_Sample]:
        """Return the target of the last frame as a sample at its time; empty if there is none."""
        frame = self._last_frame(self._newest, len(self._recording.chunks))
        if not frame or not all(map(isfinite, frame.positions)):
            return []
        positions = frame.positions
        place = self._newest.get(_SCHEDULE)
        schedule = self._record_of(self._message(place)) if place else None
        if isinstance(schedule, logs.Schedule) and _ends(schedule, frame):
            positions = schedule.samples[-1]
        return [(frame.time, dict(zip(frame.joints, positions, strict=True)))]

    def _time(self, time_ns: int) -> float:
        return (time_ns - self._recording.epoch_ns) / 1e9

    def _read(self) -> None:
        recording, step_times = self._recording, set[int]()
        newest_of = [*recording.topics_of(*_STATE), _COMMANDED]
        steps_of = recording.topics_of(*_STEPS)
        nodes: dict[str, _Node] = {}
        newest: dict[str, _Place] = {}
        changed = set[str]()  # nodes with a change in this window
        size = _NODE_BYTES + _NODE_BYTES_PER_BYTE * recording.path.stat().st_size
        allowance = _Allowance(recording.path, size, "nodes of its tree")
        count = size = 0
        for chunk, opened in self._opened():
            state = len(nodes) + len(newest)
            full = count >= max(_EVENTS, state) or size >= max(_WINDOW_BYTES, _PER_NODE * state)
            if full or not self._windows:
                self._windows.append(
                    _Window(self._time(chunk.begin_ns), chunk.number, dict(nodes), dict(newest))
                )
                changed, count, size = set(), 0, 0
            size += opened.size
            for message in opened.messages((_TREE,)):
                path, status, time = self._change(message)
                before, last = nodes.get(path, (NodeState(), None))
                allowance.take(message, last if path in changed else None)
                changed.add(path)
                nodes[path] = before.after(status, time), message
                count += 1
            if self.goal is None:
                self._find_goal(chunk, opened)
            for topic in steps_of:
                step_times.update(time for time, _ in opened.entries(topic))
            for topic in newest_of:
                if entry := opened.newest(topic):
                    # Keep the order of the newest messages, in which plans are numbered.
                    newest.pop(topic, None)
                    newest[topic] = _Place(chunk, topic, entry)
            count += sum(map(opened.count, newest_of))
            self._frames += opened.count(_COMMANDED)
            self._thin(chunk, opened)
        self.steps = list(map(self._time, step_times))
        self._newest = newest

    def _opened(self) -> Iterator[tuple[Chunk, OpenChunk]]:
        """Yield the chunks. A second thread unpacks some chunks ahead."""
        decoder, coming = Decoder(), deque[tuple[Chunk, Future[OpenChunk]]]()
        with ThreadPoolExecutor(1, "unpack") as unpacker:
            for chunk in self._recording.chunks:
                coming.append((chunk, unpacker.submit(self._recording.open, chunk, decoder)))
                if len(coming) > _AHEAD:
                    found, opened = coming.popleft()
                    yield found, opened.result()
            for found, opened in coming:
                yield found, opened.result()

    def _change(self, message: logs.Message) -> tuple[str, str, float]:
        """Return path, status and time [s] of a message on the tree, without decoding all of it."""
        fields = message.fields()
        path, status, time = fields.get("path"), fields.get("status"), fields.get("time")
        if isinstance(path, str) and isinstance(status, str) and isinstance(time, float):
            return path, status, time
        record = self._recording.record([message])
        assert isinstance(record, logs.NodeStatus)
        return record.path, record.status, record.time

    def _find_goal(self, chunk: Chunk, opened: OpenChunk) -> None:
        for message in opened.messages((_GOAL,))[:1]:
            goal = self._recording.record([message])
            if isinstance(goal, logs.Goal):
                self.goal, self._goal_chunk = goal, chunk.number

    def _thin(self, chunk: Chunk, opened: OpenChunk) -> None:
        """Store the values of a chunk for `series`."""
        for samples in (self._commanded, self._measured, self._timing, self._progress):
            samples.add(opened)
        self._lines += (_Place(chunk, _LOG, entry) for entry in opened.entries(_LOG))
        for topic in self._plan_topics - self._plans.keys():
            if entry := opened.newest(topic):
                self._plans[topic] = _Place(chunk, topic, entry)

    def _state(self, window: _Window, take: _Take) -> Iterator[Json]:
        if self.goal and self._goal_chunk < window.first:
            yield event_to_json(self.goal)
        for node, message in window.nodes.values():
            event = event_to_json(self._record_of(take(message))) | {"status": node.status}
            yield event | {"began_s": node.began, "ended_s": node.ended, "starts": node.starts}
        for place in window.newest.values():
            if place.topic != _COMMANDED:
                message = take(self._message(place))
                yield from map(self._event, self._recording.grouped([message]))
            elif frame := self._last_frame(window.newest, window.first):
                yield event_to_json(frame)

    def _last_frame(self, newest: Mapping[str, _Place], first: int) -> logs.Sent | None:
        """Return the last frame that began before a chunk, or None."""
        if _COMMANDED not in newest:
            return None
        number = newest[_COMMANDED].chunk.number
        take = _Allowance(self._recording.path, _ANSWER_BYTES, "frames of one moment").take
        messages = [
            take(message)
            for each in sorted({max(0, number - 1), number, first - 1})
            for message in self._recording.open(self._recording.chunks[each]).messages(_SENT)
        ]
        messages += self._rest_of_frame(first)
        records = self._recording.grouped(dropwhile(_continues, messages))
        frames = [each for each in records if isinstance(each, logs.Sent) and each.joints]
        return frames[-1] if frames else None

    def _rest_of_frame(self, number: int) -> Iterator[logs.Message]:
        """Yield the first messages of a chunk that belong to a frame of the previous chunk."""
        for chunk in self._recording.chunks[number : number + 1]:
            messages = self._recording.open(chunk).messages(_SENT)
            yield from takewhile(_continues, messages)

    def _records(self, first: int, until: int, take: _Take) -> Iterator[logs.Record]:
        """Yield the records of some chunks. A frame belongs to the chunk in which it begins."""
        chunks = self._recording.chunks
        messages = [
            take(message)
            for chunk in chunks[first:until]
            for message in self._recording.open(chunk).messages(self._topics)
        ]
        if first:  # the rest of a frame of the previous window
            of_frames = (message for message in messages if message.topic in _SENT)
            rest = set(map(id, takewhile(_continues, of_frames)))
            messages = [message for message in messages if id(message) not in rest]
        messages += self._rest_of_frame(until)
        return self._recording.grouped(messages)

    def _event(self, record: logs.Record) -> Json:
        if isinstance(record, logs.Result):
            outcome = Outcome.from_record(record, str(self._recording.path))
            return self._end(record.goal_id, outcome, record.time)
        return event_to_json(record)

    def _lost_end(self) -> Iterator[Json]:
        """Yield the end of a run whose recording was cut off."""
        if self.goal and self._cut_off:
            cause, path = cause_of(ServerRestarted()), str(self._recording.path)
            state, task = GoalState.ABORTED, self.goal.task
            outcome = Outcome.of(task, state, cause, self._frames, self.duration, path)
            yield self._end(self.goal.goal_id, outcome, self.began + self.duration)

    def _end(self, goal_id: str, outcome: Outcome, time: float) -> Json:
        stamp_ns = self._recording.epoch_ns + round(self.began * 1e9)
        goal = GoalStatus(goal_id, outcome.task, outcome.state, stamp_ns, outcome)
        return {**event_to_json(goal), "event": STATUS, "time_s": time}


def _ends(schedule: logs.Schedule, frame: logs.Sent) -> bool:
    """Return True if a frame is the last of a motion. Its positions may be just before the end."""
    return (
        frame.scheduled is not None
        and schedule.time <= frame.time
        and schedule.frames[-1:] == (frame.text,)
        and tuple(schedule.start) == frame.joints
        and len(schedule.samples) > 0
    )


def _continues(message: logs.Message) -> bool:
    """Return True if a message is not the first one of its frame."""
    return message.topic != _SENT[0]


def _lateness(message: logs.Message) -> tuple[float, float] | None:
    """Return the time [s] and lateness [s] of a frame; None for a frame without a schedule."""
    timing = message.fields()
    time, due = timing.get("time"), timing.get("scheduled")
    if not (isinstance(time, float) and isinstance(due, float) and isfinite(time - due)):
        return None
    return time, time - due
