"""The file while it is being written: unchunked, and on its way to disk piece by piece."""

from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from io import BufferedWriter

from mcap import records as mcap
from mcap.data_stream import RecordBuilder

from hardware.description.kinematics import ForwardKinematics
from logs.records.conversions import Stamp
from logs.records.records import Attachment, Description, Item, Note, Record
from logs.records.ros_types import ros_types
from logs.records.topics import ROSBAG2, TOPICS, Topic, offered_qos, topics_of

from .checksums import END, MAGIC, UNFINISHED, checked
from .tail import Tail

_SEQUENCE_BITS = 0xFFFFFFFF

_SCHEMAS = {name: number for number, name in enumerate({topic.type: 0 for topic in TOPICS}, 1)}
_CHANNELS = {topic.name: number for number, topic in enumerate(TOPICS, 1) if topic.fixed}
_TOPICS = {topic.record: topics_of(topic.record) for topic in TOPICS}


@dataclass
class _Channel:
    number: int
    sequence: int = 0


class Journal:
    """Writes records as they come; `kill -9` costs at most the record being written.

    For one thread. A journal that ends well is a complete file without a summary, one that does
    not is a valid prefix; `compact` makes the final recording of either.
    """

    def __init__(self, stream: BufferedWriter, epoch_ns: int) -> None:
        """Writes header, metadata, schemas and channels.

        Args:
            stream: The new file; the journal owns it from here on.
            epoch_ns: UTC at the zero of the records' clock [ns].

        Raises:
            OSError: The stream cannot be written.
        """
        self._tail = Tail(stream)
        self._epoch_ns = epoch_ns
        self._last_ns = 0
        self._kinematics: ForwardKinematics | None = None
        self._ros = ros_types()
        self._channels = {name: _Channel(number) for name, number in _CHANNELS.items()}
        self._tail.write(checked(_head(epoch_ns)))

    def write(self, *items: Item) -> None:
        """Adds files, facts, and what the table of topics makes of records; all in one piece.

        Raises:
            OSError: The disk did not take it.
            Exception: One of them cannot be converted; nothing was written.
        """
        self._tail.write(checked(b"".join(map(self._encoded, items))))

    def finish(self) -> None:
        """Completes the file, brings it to the disk and closes it.

        Raises:
            OSError: The disk did not take it.
        """
        self._tail.write(END)
        self._tail.close()

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written: after `finish`, and after a failed write."""
        return self._tail.closed

    @property
    def full(self) -> bool:
        """Whether the disk is full, so that only what was kept free for the end is left."""
        return self._tail.full

    def _encoded(self, item: Item) -> bytes:
        if isinstance(item, Attachment):
            named = item.name, item.media_type, item.data
            return _bytes(mcap.Attachment(0, self._last_ns, *named))
        if isinstance(item, Note):
            return _bytes(mcap.Metadata(item.name, dict(item.facts)))
        if isinstance(item, Description):
            self._kinematics = _kinematics(item.urdf)
        time_ns = self._epoch_ns + round(item.time * 1e9)
        messages = []
        for channel, data in self._convert(item, time_ns):
            sequence = channel.sequence & _SEQUENCE_BITS
            messages.append(mcap.Message(channel.number, time_ns, data, time_ns, sequence))
            channel.sequence += 1
        self._last_ns = time_ns
        return _bytes(*messages)

    def _convert(self, record: Record, time_ns: int) -> list[tuple[_Channel, bytes]]:
        messages = []
        for topic in _TOPICS[type(record)]:
            channel = self._channel(topic, record)
            stamp = Stamp(time_ns, channel.sequence, self._kinematics)
            message = topic.convert(record, stamp, self._ros)
            if message is not None:
                messages.append((channel, self._ros.encode(message)))
        return messages

    def _channel(self, topic: Topic, record: Record) -> _Channel:
        name = topic.name_for(record)
        if name not in self._channels:
            number = len(TOPICS) + len(self._channels)
            self._tail.write(checked(_bytes(_described(topic, name, number))))
            self._channels[name] = _Channel(number)
        return self._channels[name]


def _described(topic: Topic, name: str, number: int) -> mcap.Channel:
    facts = {
        "offered_qos_profiles": offered_qos(topic),
        "topic_type_hash": ros_types().hash(topic.type),
    }
    return mcap.Channel(number, name, "cdr", facts, _SCHEMAS[topic.type])


@lru_cache(maxsize=1)
def _head(epoch_ns: int) -> bytes:
    """What every journal of a process begins with; generates the code for every type, too."""
    ros = ros_types()
    ros.warm_up(_SCHEMAS)
    schemas = (
        mcap.Schema(number, ros.schema(name).encode(), "ros2msg", name)
        for name, number in _SCHEMAS.items()
    )
    named = {topic.name: topic for topic in TOPICS}
    return MAGIC + _bytes(
        mcap.Header("ros2", _library() + UNFINISHED),
        mcap.Metadata("armtree", {"epoch_ns": str(epoch_ns)}),
        mcap.Metadata("rosbag2", ROSBAG2),
        *schemas,
        *(_described(named[name], name, number) for name, number in _CHANNELS.items()),
    )


def _bytes(*records: mcap.McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


@cache
def _library() -> str:
    try:
        return f"armtree {version('armtree')}"
    except PackageNotFoundError:
        return "armtree"


@lru_cache(maxsize=1)
def _kinematics(urdf: str) -> ForwardKinematics:
    """Parsed once, for a server's recordings are all of one robot."""
    return ForwardKinematics(urdf)
