"""A recording as the records it was made of."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from logs.errors import RecordingError
from logs.records.fields import misshapen
from logs.records.records import (
    Feedback,
    Goal,
    LogLine,
    NodeStatus,
    Plan,
    Received,
    Result,
    Schedule,
    Sent,
    Told,
    Transition,
)
from logs.writing.compaction import RECOVERED

from .reader import Message, content
from .tolerant_reader import Salvage

# What is recorded whole, as JSON.
_WHOLE: dict[str, type[Any]] = {
    "/goal": Goal,
    "/result": Result,
    "/progress": Feedback,
    "/tree": NodeStatus,
    "/schedule": Schedule,
}
_PLAN = "/plan/"


@dataclass
class _Facts:
    """What a reading of a whole file met beside its messages."""

    files: dict[str, bytes] = field(default_factory=dict)
    notes: dict[str, dict[str, str]] = field(default_factory=dict)
    topics: set[str] = field(default_factory=set)
    messages: int = 0
    complete: bool = False


class Recording:
    """A file that can be read as often as one likes, lazily.

    What it says of the whole file is known once its records were read through; if they were not,
    the file is read through for it.

    Args:
        path: The file, a finished recording or a journal.

    Attributes:
        path: The same.
        epoch_ns: UTC at the zero of the records' clock [ns].
    """

    def __init__(self, path: Path | str) -> None:
        """Looks at its head.

        Raises:
            RecordingError: There is no such file, or it is no recording of armtree.
        """
        self.path = Path(path)
        self.epoch_ns = _epoch_ns(self.path)
        self._known: _Facts | None = None

    @property
    def files(self) -> dict[str, bytes]:
        """What is attached, by name."""
        return self._facts().files

    @property
    def notes(self) -> dict[str, dict[str, str]]:
        """Named facts, such as the versions of libraries, by what they are about."""
        return self._facts().notes

    @property
    def topics(self) -> Collection[str]:
        """What messages may be on; not every one has some."""
        return self._facts().topics

    @property
    def messages(self) -> int:
        """How many valid messages it holds."""
        return self._facts().messages

    @property
    def complete(self) -> bool:
        """Whether the file has its end and no damage."""
        return self._facts().complete

    @cached_property
    def changed(self) -> str:
        """The first topic, file or note that is not as the recording was finished with; or nothing.

        A file that was not finished, or by an older armtree, does not say how it was.
        """
        from logs.writing.digests import changed

        return changed(self.path)

    def records(self, *kinds: type) -> Iterator[Told]:
        """Gives what was recorded, in the order of the file, up to where it is damaged.

        Args:
            kinds: Only these types of records; all if none is named.

        Raises:
            RecordingError: A record cannot be decoded.
        """
        wanted = _wanted(kinds)
        sent: list[Message] = []
        for message in filter(wanted, self._messages()):
            if message.topic not in _SENT:
                yield self.record([message])
                continue
            sent.append(message)
            if message.topic == _SENT[-1] or _is_setting(message):
                yield self.record(sent)
                sent = []

    def record(self, messages: Sequence[Message]) -> Told:
        """Gives the record that messages were made of: of a frame two or three, else one.

        Raises:
            RecordingError: They cannot be decoded, or do not belong together.
        """
        message = messages[0]
        topic = message.topic
        if topic in _SENT:
            return _sent(messages)
        kind = Plan if topic.startswith(_PLAN) else _WHOLE.get(topic)
        if kind:
            return _whole(kind, message)
        time, data = (message.time_ns - self.epoch_ns) / 1e9, message.data
        match topic:
            case "/serial/rx":
                return Received(time, bytes(data.data))
            case "/rosout":
                return LogLine(time, data.level, data.name, data.msg)
            case _:
                labels = data.transition.label, data.start_state.label, data.goal_state.label
                return Transition(time, *labels)

    def _facts(self) -> _Facts:
        if self._known is None:
            for _ in self._messages():
                pass
        assert self._known
        return self._known

    def _messages(self) -> Iterator[Message]:
        from mcap import records as mcap

        facts, salvage = _Facts(), Salvage(self.path)
        for item in content(salvage):
            match item:
                case Message():
                    yield item
                case mcap.Channel():
                    facts.topics.add(item.topic)
                case mcap.Attachment():
                    facts.files[item.name] = item.data
                case mcap.Metadata():
                    facts.notes[item.name] = dict(item.metadata)
        facts.messages, facts.complete = salvage.messages, salvage.intact
        self._known = facts


def _epoch_ns(path: Path) -> int:
    from mcap.records import Metadata

    for item in content(Salvage(path)):
        match item:
            case Metadata(name="armtree", metadata={"epoch_ns": said}) if said.isdecimal():
                return int(said)
            case Metadata() if item.name == RECOVERED:  # cut before that, so nothing has a time
                return 0
            case Message():
                break
    raise RecordingError(path, "was not recorded by armtree, or lacks its head")


def fields_of(message: Message) -> dict[str, Any]:
    """What a message on a topic such as `/goal`, `/tree` or `/plan/arm` says, as its record has it.

    Raises:
        RecordingError: It is none that armtree has recorded.
    """
    kind = Plan if message.topic.startswith(_PLAN) else _WHOLE[message.topic]
    record = _whole(kind, message)
    return {field.name: getattr(record, field.name) for field in fields(kind)}


# What one frame becomes, in the order of the file.
_SENT = ("/serial/tx", "/serial/timing", "/joint_states")
_TIMING = ("time", "scheduled", "hold")
_TOPICS: dict[type, tuple[str, ...]] = {
    **{kind: (topic,) for topic, kind in _WHOLE.items()},
    Received: ("/serial/rx",),
    LogLine: ("/rosout",),
    Transition: ("/lifecycle",),
    Sent: _SENT,
    Plan: (),
}


def _wanted(kinds: tuple[type, ...]) -> Callable[[Message], bool]:
    """Which messages the records of these kinds are made from."""
    names = {topic for kind in kinds or _TOPICS for topic in _TOPICS[kind]}
    plans = not kinds or Plan in kinds
    return lambda message: message.topic in names or (plans and _is_plan(message.topic))


def _is_plan(topic: str) -> bool:
    return topic.startswith(_PLAN) and topic.count("/") == 2


def _whole(kind: type[Any], message: Message) -> Told:
    names = {field.name for field in fields(kind)}
    given = {name: value for name, value in message.fields().items() if name in names}
    record: Told = _made(kind, {name: _frozen(value) for name, value in given.items()}, message)
    return record


def _made(kind: type[Any], known: dict[str, Any], message: Message) -> Any:
    needed = {field.name for field in fields(kind) if field.default is MISSING}
    if missing := sorted(needed - known.keys()):
        what = f"what {message.topic} says lacks {', '.join(missing)}; another armtree recorded it"
        raise RecordingError(message.path, what)
    if wrong := misshapen(kind, known):
        what = f"what {message.topic} says of {wrong} makes no sense; another program recorded it"
        raise RecordingError(message.path, what)
    return kind(**known)


def _frozen(value: Any) -> Any:
    """JSON knows lists only."""
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def _is_setting(message: Message) -> bool:
    """Whether nothing more is told of what was sent: a setting of the board moves no joint."""
    return message.topic == "/serial/timing" and bool(message.fields().get("setting"))


def _sent(messages: Sequence[Message]) -> Sent:
    topics, times = zip(*((message.topic, message.time_ns) for message in messages), strict=True)
    if topics not in (_SENT, _SENT[:2]) or len(set(times)) > 1:
        what = f"a frame is not told by {', '.join(_SENT)} at once; another program wrote the file"
        raise RecordingError(messages[0].path, what)
    frame, timing, *joints = messages
    facts, state = timing.fields(), joints[0].data if joints else None
    known: dict[str, Any] = {name: facts[name] for name in _TIMING if name in facts}
    known["data"] = bytes(frame.data.data)
    known["joints"] = tuple(state.name) if state else ()
    known["positions"] = tuple(state.position.tolist()) if state else ()
    sent: Sent = _made(Sent, known, timing)
    return sent
