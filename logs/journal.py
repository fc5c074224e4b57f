"""The file while it is being written: unchunked, and on its way to disk after every record."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from io import BufferedWriter
from typing import cast

from mcap.writer import Writer

from .compaction import UNFINISHED
from .conversions import Stamp
from .kinematics import Links
from .records import Description, Record
from .ros_types import ros_types
from .tail import Tail
from .topics import TOPICS, Topic, offered_qos, topics_of

_SEQUENCE_BITS = 0xFFFFFFFF


@dataclass
class _Channel:
    number: int
    sequence: int = 0


class Journal:
    """Writes records as they come; `kill -9` costs at most the record being written.

    For one thread. A journal that ends well is a complete file, one that does not is a valid
    prefix; `compact` makes the final recording of either.
    """

    def __init__(self, stream: BufferedWriter, epoch_ns: int) -> None:
        """Writes header, metadata and channels, and generates the code for every type.

        Args:
            stream: The new file; the journal owns it from here on.
            epoch_ns: UTC at the zero of the records' clock [ns].

        Raises:
            OSError: The stream cannot be written.
        """
        self._tail = Tail(stream)
        self._epoch_ns = epoch_ns
        self._last_ns = 0
        self._links: Links | None = None
        self._ros = ros_types()
        self._writer = Writer(cast("BufferedWriter", self._tail), use_chunking=False)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, _Channel] = {}
        self._topics = {topic.record: topics_of(topic.record) for topic in TOPICS}
        self._start()

    def write(self, record: Record) -> None:
        """Adds what the table of topics makes of a record, and flushes.

        Raises:
            OSError: The disk did not take it.
            Exception: The record cannot be converted; nothing of it was written.
        """
        time_ns = self._epoch_ns + round(record.time * 1e9)
        if isinstance(record, Description):
            self._links = _links(record.urdf)
        messages = self._convert(record, time_ns)
        for channel, data in messages:
            sequence = channel.sequence & _SEQUENCE_BITS
            self._writer.add_message(channel.number, time_ns, data, time_ns, sequence)
            channel.sequence += 1
        self._tail.flush()
        self._last_ns = time_ns

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Adds a named file, such as the task's YAML, dated as the record before it.

        Raises:
            OSError: The disk did not take it.
        """
        self._writer.add_attachment(0, self._last_ns, name, media_type, data)
        self._tail.flush()

    def note(self, name: str, facts: Mapping[str, str]) -> None:
        """Adds named facts, such as the versions of libraries.

        Raises:
            OSError: The disk did not take it.
        """
        self._writer.add_metadata(name, dict(facts))
        self._tail.flush()

    def finish(self) -> None:
        """Completes the file, brings it to the disk and closes it.

        Raises:
            OSError: The disk did not take it.
        """
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._tail.flush()
        self._tail.close()

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written: after `finish`, and after a failed write."""
        return self._tail.closed

    @property
    def full(self) -> bool:
        """Whether the disk is full, so that only what was kept free for the end is left."""
        return self._tail.full

    def _start(self) -> None:
        self._writer.start("ros2", _library() + UNFINISHED)
        self._writer.add_metadata("armtree", {"epoch_ns": str(self._epoch_ns)})
        for topic in TOPICS:
            if topic.fixed:
                self._channels[topic.name] = self._register(topic, topic.name)
        self._tail.flush()
        self._ros.warm_up(topic.type for topic in TOPICS)

    def _convert(self, record: Record, time_ns: int) -> list[tuple[_Channel, bytes]]:
        messages = []
        for topic in self._topics[type(record)]:
            channel = self._channel(topic, record)
            stamp = Stamp(time_ns, channel.sequence, self._links)
            message = topic.convert(record, stamp, self._ros)
            if message is not None:
                messages.append((channel, self._ros.encode(message)))
        return messages

    def _channel(self, topic: Topic, record: Record) -> _Channel:
        name = topic.name_for(record)
        if name not in self._channels:
            self._channels[name] = self._register(topic, name)
        return self._channels[name]

    def _register(self, topic: Topic, name: str) -> _Channel:
        if topic.type not in self._schemas:
            text = self._ros.schema(topic.type).encode()
            self._schemas[topic.type] = self._writer.register_schema(topic.type, "ros2msg", text)
        facts = {
            "offered_qos_profiles": offered_qos(topic),
            "topic_type_hash": self._ros.hash(topic.type),
        }
        schema = self._schemas[topic.type]
        return _Channel(self._writer.register_channel(name, "cdr", schema, facts))


@cache
def _library() -> str:
    try:
        return f"armtree {version('armtree')}"
    except PackageNotFoundError:
        return "armtree"


@lru_cache(maxsize=1)
def _links(urdf: str) -> Links:
    """Parsed once, for a server's recordings are all of one robot."""
    return Links(urdf)
