"""Reads a recording, and returns the records that were recorded."""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

from logs.errors import RecordingEmpty, RecordingError
from logs.records.field_types import LARGEST, frozen, has_type
from logs.records.file_format import RECOVERED
from logs.records.packing import unpack
from logs.records.records import (
    QUANTITIES,
    Attachment,
    LeaderState,
    LogLine,
    Measured,
    Plan,
    Received,
    RunRecord,
    Schedule,
    Sent,
    Transition,
)

from .reader import MAX_BYTES, Message, content
from .tolerant_reader import TolerantReader

if TYPE_CHECKING:
    from mcap import records as mcap

_PLAN = "/plan/"

# Topics of the messages of one sent frame, in file order. A board setting has no joint states.
_SENT = ("/serial/tx", "/serial/timing", "/joint_states")
_TIMING = ("time", "scheduled", "hold")

_TOPICS: dict[type, tuple[str, ...]] = {
    Received: ("/serial/rx",),
    Measured: ("/joint_states/measured",),
    LeaderState: ("/leader/joint_states",),
    LogLine: ("/rosout",),
    Transition: ("/lifecycle",),
    Sent: _SENT,
    Plan: (),
}

# Fields whose lengths must be equal. Pairs of a field and a table: the table has one column for
# each element of the field.
_LENGTHS: dict[type, tuple[tuple[str, ...], ...]] = {
    Sent: (("joints", "positions"),),
    Measured: (("joints", "position"),),
    LeaderState: (("joints", "positions"),),
    Plan: (("joints", "velocity_limits", "acceleration_limits"), ("times", "positions")),
    Schedule: (("times", "frames", "delays_s"), ("sample_times", "samples")),
}
_COLUMNS: dict[type, tuple[tuple[str, str], ...]] = {
    Plan: (("joints", "waypoints"), ("joints", "positions")),
    Schedule: (("start", "samples"),),
}
_TIMES, _LONGEST = ("time", "duration"), 1e9  # [s]
_field_types = cache(get_type_hints)
_GOAL_ID = re.compile("[0-9a-f]{32}")


@dataclass
class _Facts:
    """Facts about a file that are known after it was read to its end."""

    files: dict[str, bytes] = field(default_factory=dict)
    notes: dict[str, dict[str, str]] = field(default_factory=dict)
    topics: set[str] = field(default_factory=set)
    messages: int = 0
    complete: bool = False


class Recording:
    """A finished or unfinished recording. It can be read several times, and is read lazily.

    The properties below describe the whole file. The first access to a property reads the file to
    its end, unless all records were already read.

    Args:
        path: The file.

    Attributes:
        path: The file.
        epoch_ns: UTC time at time 0 of the records' clock [ns since 1970].
    """

    def __init__(self, path: Path | str) -> None:
        """Read the beginning of the file.

        Raises:
            RecordingError: The file does not exist, or is not a recording of armtree.
        """
        self.path = Path(path)
        self.epoch_ns = _epoch_ns(self.path)
        self._known: _Facts | None = None

    @property
    def files(self) -> dict[str, bytes]:
        """Attachments by name."""
        return self._facts().files

    @property
    def notes(self) -> dict[str, dict[str, str]]:
        """Notes by name, such as `versions`; each holds values by key."""
        return self._facts().notes

    @property
    def topics(self) -> Collection[str]:
        """All topics, also those without a message."""
        return self._facts().topics

    @property
    def messages(self) -> int:
        """Number of valid messages."""
        return self._facts().messages

    @property
    def complete(self) -> bool:
        """True if the file is undamaged and its end is not missing."""
        return self._facts().complete

    @property
    def whole(self) -> bool:
        """True if the recording is complete and was not recovered after a crash."""
        return self.complete and RECOVERED not in self.notes

    @cached_property
    def changed(self) -> str:
        """Name of the first topic, attachment or note that changed after the run was recorded.

        The name is empty if nothing changed, or if the recording is not finished.
        """
        from .digests import changed_part

        return changed_part(self.path)

    def records(self, *kinds: type) -> Iterator[RunRecord]:
        """Yield the records in file order, up to the first damage.

        Args:
            kinds: Types of records to yield. Default: all.

        Raises:
            RecordingError: A record cannot be decoded.
        """
        wanted = topic_filter(kinds)
        yield from self.grouped(each for each in self.all_messages() if wanted(each.topic))

    def grouped(self, messages: Iterable[Message]) -> Iterator[RunRecord]:
        """Yield the records that the given messages contain.

        Args:
            messages: Messages in file order. All messages of a record must be included.

        Raises:
            RecordingError: A record cannot be decoded.
        """
        sent: list[Message] = []
        for message in messages:
            if message.topic not in _SENT:
                yield self.record([message])
                continue
            sent.append(message)
            if message.topic == _SENT[-1] or _is_setting(message):
                yield self.record(sent)
                sent = []

    def all_messages(self) -> Iterator[Message]:
        """Yield the messages of all records in file order, up to the first damage.

        Raises:
            RecordingError: An attachment cannot be unpacked.
        """
        from mcap import records as mcap

        facts, reader = _Facts(), TolerantReader(self.path)
        for item in content(reader):
            match item:
                case Message():
                    yield item
                case mcap.Channel():
                    facts.topics.add(item.topic)
                case mcap.Attachment():
                    name, data = self._unpacked(item)
                    facts.files[name] = data
                case mcap.Metadata():
                    facts.notes[item.name] = dict(item.metadata)
        facts.messages, facts.complete = reader.messages, reader.intact
        self._known = facts

    def frames(self) -> Iterator[Sent]:
        """Yield the sent frames in file order. Holds are included, board settings are not.

        Raises:
            RecordingError: A frame cannot be decoded.
        """
        for record in self.records(Sent):
            if isinstance(record, Sent) and record.joints:
                yield record

    def record(self, messages: Sequence[Message]) -> RunRecord:
        """Return the record that the given messages contain.

        Args:
            messages: All messages of the record: three for a sent frame, two for a board setting,
                else one.

        Raises:
            RecordingError: A message cannot be decoded, or the messages are of several records.
        """
        message = messages[0]
        topic = message.topic
        if topic in _SENT:
            return _sent(messages)
        kind = Plan if topic.startswith(_PLAN) else _json_topics().get(topic)
        if kind:
            return _from_json(kind, message)
        time, data = (message.time_ns - self.epoch_ns) / 1e9, message.data
        match topic:
            case "/serial/rx":
                return Received(time, bytes(data.data))
            case "/joint_states/measured":
                values = {name: getattr(data, name) for name in QUANTITIES}
                facts = {"time": time, "joints": tuple(data.name), **values}
                measured: Measured = _checked(Measured, facts, message)
                return measured
            case "/leader/joint_states":
                facts = {"time": time, "joints": tuple(data.name), "positions": data.position}
                leader: LeaderState = _checked(LeaderState, facts, message)
                return leader
            case "/rosout":
                return LogLine(time, data.level, data.name, data.msg)
            case _:
                labels = data.transition.label, data.start_state.label, data.goal_state.label
                return Transition(time, *labels)

    def _facts(self) -> _Facts:
        if self._known is None:
            for _ in self.all_messages():
                pass
        assert self._known
        return self._known

    def _unpacked(self, item: "mcap.Attachment") -> tuple[str, bytes]:
        try:
            return unpack(Attachment(item.name, item.media_type, item.data))
        except ValueError as error:
            what = f"has an attachment of another program: {error}"
            raise RecordingError(self.path, what) from error


def _epoch_ns(path: Path) -> int:
    from mcap.records import Metadata

    reader = TolerantReader(path)
    for item in content(reader):
        match item:
            case Metadata(name="armtree", metadata={"epoch_ns": epoch}) if _is_time(epoch):
                return int(epoch)
            case Metadata() if item.name == RECOVERED:
                # The original file was cut off before its epoch, so it had no messages.
                return 0
            case Message():
                break
    if reader.intact or reader.messages:
        what = "was not recorded by armtree, or the beginning of the file is missing"
        raise RecordingError(path, what)
    raise RecordingEmpty(path)


def _is_time(epoch: str) -> bool:
    return epoch.isdecimal() and len(epoch) < 20 and int(epoch) < LARGEST


@cache
def _json_topics() -> dict[str, type[Any]]:
    """Return the record type of each topic whose records are one JSON message each."""
    from logs.records.topics import TOPICS

    return {topic.name: topic.record for topic in TOPICS if topic.every_field}


def topic_filter(kinds: tuple[type, ...]) -> Callable[[str], bool]:
    """Return a function that returns True for each topic of these record types.

    Args:
        kinds: Record types; empty for all types.
    """
    topics = _TOPICS | {kind: (topic,) for topic, kind in _json_topics().items()}
    names = {topic for kind in kinds or topics for topic in topics[kind]}
    plans = not kinds or Plan in kinds
    return lambda topic: (
        topic in names or (plans and topic.startswith(_PLAN) and topic.count("/") == 2)
    )


def _is_setting(message: Message) -> bool:
    """Return True if this message is the last one of a sent setting of the board."""
    return message.topic == "/serial/timing" and bool(message.fields().get("setting"))


def _sent(messages: Sequence[Message]) -> Sent:
    topics, times = zip(*((message.topic, message.time_ns) for message in messages), strict=True)
    if topics not in (_SENT, _SENT[:2]) or len(set(times)) > 1:
        what = f"a frame lacks a message on one of {', '.join(_SENT)}"
        raise RecordingError(messages[0].path, f"{what}; another program wrote the file")
    frame, timing, *joints = messages
    facts, state = timing.fields(), joints[0].data if joints else None
    known: dict[str, Any] = {name: facts[name] for name in _TIMING if name in facts}
    known["data"] = bytes(frame.data.data)
    known["joints"] = tuple(state.name) if state else ()
    known["positions"] = state.position if state else ()
    sent: Sent = _checked(Sent, known, timing)
    return sent


def _from_json(kind: type, message: Message) -> RunRecord:
    given = message.fields()
    known = {name: frozen(given[name]) for name in _field_types(kind).keys() & given.keys()}
    record: RunRecord = _checked(kind, known, message)
    return record


def _checked(kind: type, known: dict[str, Any], message: Message) -> Any:
    """Check the fields of a record and create it. Any program may have written the file."""
    if missing := sorted(_needed(kind) - known.keys()):
        why = "another version of armtree recorded it"
        what = f"a message on {message.topic} lacks {', '.join(missing)}; {why}"
        raise RecordingError(message.path, what)
    if wrong := _invalid_field(kind, known):
        what = f"the {wrong} of a message on {message.topic} is invalid"
        raise RecordingError(message.path, f"{what}; another program recorded it")
    return kind(**known)


@cache
def _needed(kind: type) -> frozenset[str]:
    """Return the names of the fields of a dataclass that have no default."""
    return frozenset(
        field.name
        for field in fields(kind)
        if field.default is MISSING and field.default_factory is MISSING
    )


def _invalid_field(kind: type, values: Mapping[str, Any]) -> str:
    """Return the name of the first invalid field; empty if all fields are valid.

    A field may have a wrong type, a wrong length or a value out of range.
    """
    for name, type_ in _field_types(kind).items():
        if name not in values:
            continue
        if not (has_type(values[name], type_) and _in_range(name, values[name])):
            return name
    for names in _LENGTHS.get(kind, ()):
        if len({len(values[name]) for name in names}) > 1:
            return names[-1]
    for columns, table in _COLUMNS.get(kind, ()):
        if any(len(row) != len(values[columns]) for row in values[table]):
            return table
    return ""


def _in_range(name: str, value: Any) -> bool:
    if name in _TIMES:
        return abs(float(value)) < _LONGEST
    if isinstance(value, str) and len(value) > MAX_BYTES:
        return False
    return name != "goal_id" or _GOAL_ID.fullmatch(value) is not None
