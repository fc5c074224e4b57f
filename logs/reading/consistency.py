"""Checks that all messages of a record agree with each other.

A record is written as several messages. Verification uses only one of these messages. Most tools
use the others, such as transforms, trajectories and the text of a frame. This module converts each
record to messages again, and compares these with the messages in the file. It also finds changes in
files without digests, or with forged digests.
"""

import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from json import loads
from math import isclose
from typing import Any

from hardware.description.forward_kinematics import ForwardKinematics
from hardware.description.urdf import Urdf
from logs.errors import RecordingError
from logs.records.cdr import Message as Values, encode
from logs.records.conversions import Stamp
from logs.records.records import (
    Description,
    LeaderState,
    LogLine,
    Measured,
    Plan,
    Received,
    Record,
    Transition,
)
from logs.records.topics import TOPICS, topics_of

from .reader import Message
from .recording import Recording

_ROWS = {topic.name: (topic.record, row) for row, topic in enumerate(TOPICS)}
_UNCHECKED = "/diagnostics"  # messages and thresholds of this topic may differ between versions
_URDF = "/robot_description"
_PLAN, _PLANS = "/plan/", [row for row, topic in enumerate(TOPICS) if topic.record is Plan]

# Topics whose messages only repeat a part of another message of the same record.
_DERIVED = ("/feedback", "/plan/{record.group}/trajectory", "/tf")

# Records without a time of their own in the file.
_UNDATED = (Description, Received, Measured, LeaderState, LogLine, Transition)

# Largest difference of a float from its recorded value: processors compute sines differently.
_TOLERANCE = 1e-12


def inconsistency(recording: Recording) -> tuple[str, str]:
    """Return the topic of the first record whose messages disagree, and the difference in words.

    A message that cannot be decoded counts as a difference.

    Returns:
        The topic and the difference; two empty strings if all messages agree.
    """
    checker = _Checker(recording)
    for group in _groups(recording):
        try:
            words = checker.difference(group)
        except RecordingError as error:
            words = str(error)
        except (ArithmeticError, ValueError, struct.error) as error:
            words = f"a message on {group[0].topic} cannot be converted again: {error}"
        if words:
            return group[0].topic, words
    return "", ""


def _groups(recording: Recording) -> Iterator[list[Message]]:
    """Yield the messages of each record, except for a last record that was cut off."""
    group: list[Message] = []
    before: tuple[type | None, int] = None, 0
    for message in recording.all_messages():
        if (place := _place(message.topic)) is None:
            continue
        if group and (place[0] is not before[0] or place[1] <= before[1]):
            yield group
            group = []
        group.append(message)
        before = place
    if group and recording.whole:
        yield group


def _place(name: str) -> tuple[type, int] | None:
    """Return a topic's record type, and its row in `TOPICS`; None if the topic is not checked."""
    if name.startswith(_PLAN):
        return Plan, _PLANS[name.count("/") > 2]
    return None if name == _UNCHECKED else _ROWS.get(name)


def _derived(name: str) -> bool:
    place = _place(name)
    return place is not None and TOPICS[place[1]].name in _DERIVED


class _Checker:
    """Converts the records of a recording again, in file order, as the journal did."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._kinematics: ForwardKinematics | None = None
        self._counts = Counter[str]()

    def difference(self, group: list[Message]) -> str:
        """Return the first difference in the messages of one record; empty if there is none."""
        first = group[0]
        record = self._record(group)
        if words := self._time_difference(record, first.time_ns):
            return words
        converted = dict(self._converted(record, first.time_ns)) if record else {}
        topics = [message.topic for message in group if message.time_ns == first.time_ns]
        if topics != list(converted):
            return f"{self._number(first)}: the record is on {topics}, not on {list(converted)}"
        for message in group:
            type_, expected = converted[message.topic]
            same = message.cdr == encode(type_, expected)
            if words := "" if same else _difference("", message.data, expected):
                return f"{self._number(message)}: {words}"
            self._counts[message.topic] += 1
        return ""

    def _time_difference(self, record: Record | None, time_ns: int) -> str:
        if record is None or isinstance(record, _UNDATED):
            return ""
        if time_ns == self._recording.epoch_ns + round(record.time * 1e9):
            return ""
        stamp = (time_ns - self._recording.epoch_ns) / 1e9
        kind = type(record).__name__
        return f"the time of a {kind} is {record.time} s, but the time of its message is {stamp} s"

    def _number(self, message: Message) -> str:
        return f"message {self._counts[message.topic] + 1} on {message.topic}"

    def _record(self, group: list[Message]) -> Record | None:
        """Return the record that the messages contain; None if all messages are of `_DERIVED`."""
        messages = [message for message in group if not _derived(message.topic)]
        if messages and messages[0].topic == _URDF:
            return self._description(messages[0].data.data)
        return self._recording.record(messages) if messages else None

    def _description(self, urdf: str) -> Description:
        files = self._recording.files.values()
        if urdf.encode().splitlines() not in (data.splitlines() for data in files):
            raise RecordingError(self._recording.path, "has a URDF that is not one of its files")
        self._kinematics = ForwardKinematics(Urdf(urdf).checked())
        return Description(0.0, urdf)

    def _converted(self, record: Record, time_ns: int) -> Iterator[tuple[str, tuple[str, Values]]]:
        """Yield the topic, type and content of each message. Skip topics that the file lacks."""
        for topic in topics_of(type(record)):
            name = topic.name_for(record)
            stamp = Stamp(time_ns, self._counts[name], self._kinematics)
            message = topic.convert(record, stamp)
            if message is not None and _place(name) and name in self._recording.topics:
                yield name, (topic.type, message)


def _difference(place: str, found: Any, expected: Any) -> str:
    """Return the first difference of a message from the expected one, in words.

    Args:
        place: Path of the field in the message, such as `.pose.x`; empty for the whole message.
        found: The value in the file.
        expected: The value that the record converts to.

    Returns:
        The path of the field and both values; empty if the message is as expected.
    """
    parts: Iterable[tuple[str, Any, Any]]
    if found is not None and isinstance(expected, Values):
        parts = (
            (f"{place}.{name}", getattr(found, name), value)
            for name, value in vars(expected).items()
        )
    elif isinstance(expected, list | tuple | bytes):
        pairs = zip_longest(found, expected)
        parts = ((f"{place}[{number}]", *pair) for number, pair in enumerate(pairs))
    elif isinstance(expected, str) and expected.startswith("{"):
        then, now = loads(found), loads(expected)
        parts = ((f"{place}.{name}", then[name], now[name]) for name in then if name in now)
    else:
        same = found == expected or (isinstance(expected, float) and _close(found, expected))
        return "" if same else f"{place[1:]} is {found!r}, its record has {expected!r}"
    return next(filter(None, (_difference(*part) for part in parts)), "")


def _close(a: Any, b: float) -> bool:
    return isinstance(a, float) and isclose(a, b, abs_tol=_TOLERANCE)
