"""Whether a recording agrees with itself: what is told on several topics was one thing."""

import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import MISSING, fields, is_dataclass
from itertools import zip_longest
from json import loads
from math import isclose
from typing import Any

import numpy as np

from hardware.description.kinematics import ForwardKinematics
from logs.errors import RecordingError, RecordingTruncated
from logs.records.conversions import Stamp
from logs.records.file_format import RECOVERED
from logs.records.records import Description, LogLine, Plan, Received, Record, Transition
from logs.records.ros_types import ros_types
from logs.records.topics import TOPICS, topics_of

from .reader import Message, read
from .recording import Recording

_ROWS = {topic.name: (topic.record, row) for row, topic in enumerate(TOPICS)}
_OPINION = "/diagnostics"  # what is worth a word there may change, and the words
_URDF = "/robot_description"
_PLAN, _PLANS = "/plan/", [row for row, topic in enumerate(TOPICS) if topic.record is Plan]

# What is made of messages that are there too.
_DERIVED = ("/feedback", "/plan/{record.group}/trajectory", "/tf")

# What bears no time but its message's.
_UNDATED = (Description, Received, LogLine, Transition)

# What processors make of the same sine differs by less.
_TOLERANCE = 1e-12


def inconsistency(recording: Recording) -> tuple[str, str]:
    """The first message that is not what its record makes of it: its topic, and what is wrong.

    A proof looks at the records; most tools look at what was made of them, such as transforms,
    trajectories and the text of a frame. What cannot be decoded disagrees, too.

    Returns:
        Both empty where there is none.
    """
    teller = _Teller(recording)
    for group in _groups(recording):
        try:
            words = teller.difference(group)
        except RecordingError as error:
            words = str(error)
        except (ArithmeticError, ValueError, struct.error) as error:
            words = f"no message on {group[0].topic} can tell of that: {error}"
        if words:
            return group[0].topic, words
    return "", ""


def _groups(recording: Recording) -> Iterator[list[Message]]:
    """The messages of one record each, but for a last one that was cut."""
    group: list[Message] = []
    before: tuple[type | None, int] = None, 0
    for message in _valid(recording):
        if (place := _place(message.topic)) is None:
            continue
        if group and (place[0] is not before[0] or place[1] <= before[1]):
            yield group
            group = []
        group.append(message)
        before = place
    if group and recording.complete and RECOVERED not in recording.notes:
        yield group


def _valid(recording: Recording) -> Iterator[Message]:
    try:
        yield from read(recording.path)
    except RecordingTruncated:
        return


def _place(name: str) -> tuple[type, int] | None:
    """Whose topic it is, and its row in the table; None for one that proves nothing."""
    if name.startswith(_PLAN):
        return Plan, _PLANS[name.count("/") > 2]
    return None if name == _OPINION else _ROWS.get(name)


def _derived(name: str) -> bool:
    place = _place(name)
    return place is not None and TOPICS[place[1]].name in _DERIVED


class _Teller:
    """Tells the records of a recording again, as its journal did."""

    def __init__(self, recording: Recording) -> None:
        self._recording, self._ros = recording, ros_types()
        self._kinematics: ForwardKinematics | None = None
        self._counts = Counter[str]()

    def difference(self, group: list[Message]) -> str:
        """What is wrong with the messages of one record, or nothing."""
        first = group[0]
        record = self._record(group)
        if words := self._misdated(record, first.time_ns):
            return words
        made = dict(self._made(record, first.time_ns)) if record else {}
        told = [message.topic for message in group if message.time_ns == first.time_ns]
        if told != list(made):
            return f"{self._number(first)} is told on {told}, not on {list(made)}"
        for message in group:
            if words := self._change(message, made[message.topic]):
                return f"{self._number(message)}: {words}"
            self._counts[message.topic] += 1
        return ""

    def _change(self, message: Message, made: Any) -> str:
        same = message.cdr == self._ros.encode(made)
        return "" if same else _difference("", message.data, made)

    def _misdated(self, record: Record | None, time_ns: int) -> str:
        if record is None or isinstance(record, _UNDATED):
            return ""
        if time_ns == self._recording.epoch_ns + round(record.time * 1e9):
            return ""
        happened = (time_ns - self._recording.epoch_ns) / 1e9
        return (
            f"a {type(record).__name__} is recorded at {record.time} s in a message of {happened} s"
        )

    def _number(self, message: Message) -> str:
        return f"message {self._counts[message.topic] + 1} on {message.topic}"

    def _record(self, group: list[Message]) -> Record | None:
        """The record that messages tell of; None where the one that tells it in full is missing."""
        told = [message for message in group if not _derived(message.topic)]
        if told and told[0].topic == _URDF:
            return self._description(told[0].data.data)
        return self._recording.record(told) if told else None

    def _description(self, urdf: str) -> Description:
        files = self._recording.files.values()
        if urdf.encode().splitlines() not in (data.splitlines() for data in files):
            raise RecordingError(self._recording.path, "has a URDF that is none of its files")
        self._kinematics = ForwardKinematics(urdf)
        return Description(0.0, urdf)

    def _made(self, record: Record, time_ns: int) -> Iterator[tuple[str, Any]]:
        """By topic; those that the writer of the file did not know are left out."""
        for topic in topics_of(type(record)):
            name = topic.name_for(record)
            stamp = Stamp(time_ns, self._counts[name], self._kinematics)
            message = topic.convert(record, stamp, self._ros)
            if message is not None and _place(name) and name in self._recording.topics:
                yield name, message


def _difference(place: str, told: Any, made: Any) -> str:
    """The first part of a message that is not what it was made as, with its place; or nothing."""
    parts: Iterable[tuple[str, Any, Any]]
    if told is not None and is_dataclass(made):
        names = [field.name for field in fields(made) if field.default is MISSING]
        parts = ((f"{place}.{name}", getattr(told, name), getattr(made, name)) for name in names)
    elif isinstance(made, list | np.ndarray):
        pairs = zip_longest(_plain(told), _plain(made))
        parts = ((f"{place}[{number}]", *pair) for number, pair in enumerate(pairs))
    elif isinstance(made, str) and made.startswith("{"):
        facts, now = loads(told), loads(made)
        parts = ((f"{place}.{name}", facts[name], now[name]) for name in facts.keys() & now.keys())
    else:
        same = told == made or (isinstance(made, float) and _close(told, made))
        return "" if same else f"{place[1:]} is {told!r}, its record tells of {made!r}"
    return next(filter(None, (_difference(*part) for part in parts)), "")


def _plain(values: Any) -> list[Any]:
    return values.tolist() if isinstance(values, np.ndarray) else list(values)


def _close(a: Any, b: float) -> bool:
    return isinstance(a, float) and isclose(a, b, abs_tol=_TOLERANCE)
