"""A recording as the events around any moment, with the state before them.

A recording is cut into windows of some hundred events. A client gets one window at a time, so
it never loads a whole recording.
"""

from bisect import bisect_right
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import takewhile
from math import isfinite, nan
from pathlib import Path
from typing import Any

import logs
from executive.api.events import EVENTS, STATUS, QuestionStatus, event_to_json
from executive.api.outcome import GoalState, GoalStatus, Outcome
from logs.reading.indexed import Chunk, Entry, IndexedRecording, OpenChunk
from logs.reading.mcap_records import Decoder
from logs.reading.recording import topic_filter

POINTS = 2000  # most samples of the positions over the whole recording
_ROUNDING = 1e-6  # of times that were added and subtracted [s]
_EVENTS = 500  # a window ends with the chunk in which it reaches this number

_COMMANDED, _MEASURED = "/joint_states", "/joint_states/measured"
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


@dataclass(frozen=True, slots=True)
class NodeState:
    """What the events of a node so far amount to.

    Attributes:
        record: The last one.
        halted: True if it was interrupted: `INVALID` after `RUNNING`.
        began, ended: Time of its last start and end [s]; None if there is none.
        starts: Number of starts.
    """

    record: logs.NodeStatus
    halted: bool = False
    began: float | None = None
    ended: float | None = None
    starts: int = 0

    def after(self, record: logs.NodeStatus) -> "NodeState":
        """Return the state after another event of the node."""
        ran, time = self.record.status == "RUNNING", record.time
        known = self.began if record.status == "RUNNING" else self.ended
        if time == known:  # a repeated event
            return replace(self, record=record, halted=record.status == "INVALID" and ran)
        if record.status == "RUNNING":
            return NodeState(record, False, time, None, self.starts + 1)
        if record.status == "INVALID" and not ran:
            return replace(self, record=record, halted=False)
        started = (self.began, self.starts) if ran else (time, self.starts + 1)
        return NodeState(record, record.status == "INVALID", started[0], time, started[1])

    def to_json(self) -> Json:
        """Return the event that gives a node this state at once."""
        known = {"began_s": self.began, "ended_s": self.ended, "starts": self.starts}
        status = {"status": "HALTED"} if self.halted else {}
        return {**event_to_json(self.record), **status, **known}


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a message is."""

    chunk: Chunk
    topic: str
    entry: Entry


@dataclass(frozen=True, slots=True)
class _Window:
    """A part of a recording.

    Attributes:
        begin: When it begins [s].
        first: Number of its first chunk.
        nodes: State of the nodes before it, by path.
        newest: Newest message before it, by topic.
    """

    begin: float
    first: int
    nodes: Mapping[str, NodeState]
    newest: Mapping[str, _Place]


class _Samples:
    """Positions by joint, sampled at most `POINTS` times.

    Args:
        begin_ns, end_ns: What is sampled [ns].
    """

    def __init__(self, begin_ns: int, end_ns: int) -> None:
        self._begin, self._step = begin_ns, max(1, (end_ns - begin_ns) // POINTS)
        self._next = begin_ns
        self.times: list[int] = []
        self.rows: list[dict[str, float]] = []

    def add(self, topic: str, opened: OpenChunk) -> None:
        for entry in opened.entries(topic):
            time, _ = entry
            if time < self._next or len(self.rows) > POINTS:
                continue
            steps = (time - self._begin) // self._step
            self._next = self._begin + (steps + 1) * self._step
            row = _positions(opened.message(topic, entry))
            if all(map(isfinite, row.values())):
                self.times.append(time)
                self.rows.append(row)


class _Thinned:
    """Places of messages on a topic, at most `POINTS` of them, spread over the recording.

    Args:
        topic: The topic.
        begin_ns, end_ns: What is covered [ns].
    """

    def __init__(self, topic: str, begin_ns: int, end_ns: int) -> None:
        self._topic, self._next = topic, begin_ns
        self._step = (end_ns - begin_ns) // POINTS
        self.places: list[_Place] = []

    def add(self, chunk: Chunk, opened: OpenChunk) -> None:
        for entry in opened.entries(self._topic):
            if entry[0] >= self._next and len(self.places) < POINTS:
                self._next = entry[0] + self._step
                self.places.append(_Place(chunk, self._topic, entry))


class Timeline:
    """The events of a finished recording around any moment. Any thread may call.

    Args:
        path: The recording.

    Attributes:
        goal: The goal; None if there is none.
        began: When the goal, or else the recording, began [s].
        duration: From then to the last message [s].
    """

    def __init__(self, path: Path) -> None:
        """Read the whole recording once, but decode little of it.

        Raises:
            LogError: It is being written, damaged, or not a recording of armtree.
        """
        self._recording = recording = IndexedRecording(path)
        self._topics = _topics(recording, _SENT_AS_EVENTS)
        self._windows: list[_Window] = []
        self.steps: list[float] = []
        self._goal_chunk = len(recording.chunks)
        self._commanded = _Samples(recording.begin_ns, recording.end_ns)
        self._measured = _Samples(recording.begin_ns, recording.end_ns)
        self._timing = _Thinned(_TIMING, recording.begin_ns, recording.end_ns)
        self._progress = _Thinned(_PROGRESS, recording.begin_ns, recording.end_ns)
        self._lines = deque[_Place](maxlen=POINTS)
        self._plan_topics = set(_topics(recording, (logs.Plan,)))
        self._plans: dict[str, _Place] = {}  # one of each topic
        self.goal: logs.Goal | None = None
        self._read()
        self.began = self.goal.time if self.goal else self._time(recording.begin_ns)
        self.duration = max(0.0, self._time(recording.end_ns) - self.began)
        self.steps = sorted({round(max(0.0, each - self.began), 6) for each in self.steps})

    def to_json(self) -> Json:
        """Return what a client needs first."""
        return {
            "name": self._recording.path.name,
            "began_s": self.began,
            "duration_s": self.duration,
        }

    def events(self, at: float) -> Json:
        """Return the window around a moment.

        Args:
            at: The moment, from the beginning of the goal [s].

        Returns:
            `from_s` and `to_s`, where it begins and ends; `state`, the events that give the state
            before it; `events`, those in it; `previous_s` and `next_s`, the last step of the run
            before it, and the first one after it, or None. Times are from the beginning of the
            goal [s].

        Raises:
            RecordingError: It is damaged.
        """
        begins = [window.begin for window in self._windows]
        number = max(0, bisect_right(begins, at + self.began + _ROUNDING) - 1)
        window = self._windows[number]
        is_last = number == len(self._windows) - 1
        end = self.duration if is_last else self._windows[number + 1].begin - self.began
        chunks = self._recording.chunks
        until = len(chunks) if is_last else self._windows[number + 1].first
        begin = window.begin - self.began if number else 0.0
        before = bisect_right(self.steps, begin - _ROUNDING)
        after = bisect_right(self.steps, end)
        return {
            "from_s": begin,
            "to_s": end,
            "state": list(self._state(window)),
            "events": list(map(self._event, self._records(window.first, until))),
            "previous_s": self.steps[before - 1] if before else None,
            "next_s": None if after >= len(self.steps) else self.steps[after],
        }

    def mesh(self, name: str) -> bytes | None:
        """Return a mesh of a body by its name in the record of a plan; None if there is none."""
        return self._recording.files.get(name)

    def series(self, points: int) -> Json:
        """Return what plots show of the whole run.

        Args:
            points: Largest number of samples, up to `POINTS`.

        Returns:
            `commanded` and `measured` positions, the `lateness` of frames, the
            `velocity_limits` by joint, and as `events` the progress and the newest lines of the
            log. Times of samples are from the beginning of the goal [s].
        """
        return {
            "commanded": self._sampled(self._commanded, points),
            "measured": self._sampled(self._measured, points),
            "lateness": self._lateness(),
            "velocity_limits": {
                joint: limit
                for plan in self._read_places(self._plans.values())
                if isinstance(plan, logs.Plan)
                for joint, limit in zip(plan.joints, plan.velocity_limits, strict=False)
                if isfinite(limit)
            },
            "events": [
                event_to_json(record)
                for record in self._read_places((*self._progress.places, *self._lines))
            ],
        }

    def _lateness(self) -> Json:
        messages = map(self._message, self._timing.places)
        timings = [message.fields() for message in messages]
        due = [each for each in timings if isfinite(each["time"] - (each["scheduled"] or nan))]
        return {
            "times_s": [each["time"] - self.began for each in due],
            "late_s": [each["time"] - each["scheduled"] for each in due],
        }

    def _read_places(self, places: Iterable[_Place]) -> Iterator[logs.Record]:
        for place in places:
            yield from self._recording.grouped([self._message(place)])

    def _message(self, place: _Place) -> logs.Message:
        return self._recording.open(place.chunk).message(place.topic, place.entry)

    def _sampled(self, samples: _Samples, points: int) -> Json:
        step = max(1, -(-len(samples.rows) // points))
        rows = samples.rows[::step]
        joints = list(dict.fromkeys(joint for row in rows for joint in row))
        return {
            "times_s": [self._time(each) - self.began for each in samples.times[::step]],
            "positions": {joint: [row.get(joint) for row in rows] for joint in joints},
        }

    def _time(self, time_ns: int) -> float:
        return (time_ns - self._recording.epoch_ns) / 1e9

    def _read(self) -> None:
        recording, decoder = self._recording, Decoder()
        newest_of = [*_topics(recording, _STATE), _COMMANDED]
        steps_of = _topics(recording, _STEPS)
        nodes: dict[str, NodeState] = {}
        newest: dict[str, _Place] = {}
        count = 0
        for chunk in recording.chunks:
            if not self._windows or count >= max(_EVENTS, len(nodes)):
                self._windows.append(
                    _Window(self._time(chunk.begin_ns), chunk.number, dict(nodes), dict(newest))
                )
                count = 0
            opened = recording.open(chunk, decoder)
            for record in recording.grouped(opened.messages((_GOAL, _TREE))):
                if isinstance(record, logs.NodeStatus):
                    before = nodes.get(record.path)
                    before = before or NodeState(replace(record, status=""))
                    nodes[record.path] = before.after(record)
                    count += 1
                elif self.goal is None and isinstance(record, logs.Goal):
                    self.goal, self._goal_chunk = record, chunk.number
            for topic in steps_of:
                self.steps += (self._time(time) for time, _ in opened.entries(topic))
            for topic in newest_of:
                if entry := opened.newest(topic):
                    newest.pop(topic, None)  # plans count in the order of their last messages
                    newest[topic] = _Place(chunk, topic, entry)
            count += sum(map(opened.count, newest_of))
            self._commanded.add(_COMMANDED, opened)
            self._measured.add(_MEASURED, opened)
            self._thin(chunk, opened)

    def _thin(self, chunk: Chunk, opened: OpenChunk) -> None:
        """Note what `series` returns of a chunk."""
        self._timing.add(chunk, opened)
        self._progress.add(chunk, opened)
        self._lines += (_Place(chunk, _LOG, entry) for entry in opened.entries(_LOG))
        for topic in self._plan_topics - self._plans.keys():
            if entry := opened.newest(topic):
                self._plans[topic] = _Place(chunk, topic, entry)

    def _state(self, window: _Window) -> Iterator[Json]:
        if self.goal and self._goal_chunk < window.first:
            yield event_to_json(self.goal)
        for node in window.nodes.values():
            yield node.to_json()
        for place in window.newest.values():
            message = self._message(place)
            if place.topic == _COMMANDED:
                # The last frame before the window may end in it.
                rest = self._rest_of_frame(window.first)
                message = next((each for each in rest if each.topic == _COMMANDED), message)
                row = _positions(message)
                time = self._time(message.time_ns)
                joints, positions = tuple(row), tuple(row.values())
                yield event_to_json(logs.Sent(time, b"", None, False, joints, positions))
            else:
                yield from map(self._event, self._recording.grouped([message]))

    def _rest_of_frame(self, number: int) -> Iterator[logs.Message]:
        """Yield the messages at the start of a chunk of a frame that began in the one before."""
        for chunk in self._recording.chunks[number : number + 1]:
            messages = self._recording.open(chunk).messages(_SENT)
            yield from takewhile(_continues, messages)

    def _records(self, first: int, until: int) -> Iterator[logs.Record]:
        """Yield the records of some chunks. A frame belongs to the chunk in which it begins."""
        chunks = self._recording.chunks
        messages = [
            message
            for chunk in chunks[first:until]
            for message in self._recording.open(chunk).messages(self._topics)
        ]
        if first:  # the rest of a frame of the window before
            rest = set(map(id, takewhile(_continues, filter(_is_of_frame, messages))))
            messages = [message for message in messages if id(message) not in rest]
        messages += self._rest_of_frame(until)
        return self._recording.grouped(messages)

    def _event(self, record: logs.Record) -> Json:
        if isinstance(record, logs.Result):
            outcome = Outcome.from_record(record, str(self._recording.path))
            stamp_ns = self._recording.epoch_ns + round(self.began * 1e9)
            goal = GoalStatus(
                record.goal_id, record.task, GoalState[record.state], stamp_ns, outcome
            )
            return {**event_to_json(goal), "event": STATUS, "time_s": record.time}
        return event_to_json(record)


def _is_of_frame(message: logs.Message) -> bool:
    return message.topic in _SENT


def _continues(message: logs.Message) -> bool:
    """Return whether a message of a frame is not the first one."""
    return message.topic != _SENT[0]


def _topics(recording: IndexedRecording, kinds: tuple[type, ...]) -> list[str]:
    """Return the topics of a recording with records of these types."""
    return list(filter(topic_filter(kinds), recording.types))


def _positions(message: logs.Message) -> dict[str, float]:
    """Return the positions in a message of the joints' states, by joint."""
    data = message.data
    return dict(zip(data.name, data.position.tolist(), strict=False))
