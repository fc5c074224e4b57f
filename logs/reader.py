"""Reading recordings, lazily: memory does not grow with the file."""

import json
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import RecordingError, RecordingTruncated
from .salvage import Salvage

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

    from .ros_types import RosTypes


@dataclass(frozen=True, slots=True)
class Message:
    """One message of a recording.

    Attributes:
        topic: Where it was recorded, such as `/serial/tx`.
        time_ns: When, UTC since 1970 [ns].
        data: The ROS 2 message, its fields as attributes.
    """

    topic: str
    time_ns: int
    data: Any

    def fields(self) -> dict[str, Any]:
        """The fields of a JSON message, such as those on `/tree` and `/plan/arm`.

        Raises:
            TypeError: The topic does not carry JSON.
        """
        text = getattr(self.data, "data", None)
        if not isinstance(text, str):
            raise TypeError(f"{self.topic} carries {self.data.__msgtype__}, not JSON: use .data")
        fields: dict[str, Any] = json.loads(text)
        return fields


def read(path: Path, topics: Collection[str] | None = None) -> Iterator[Message]:
    """Gives the messages of a recording in the order in which they were written.

    A journal that was cut off, or is still being written, can be read too: everything valid is
    given first, then `RecordingTruncated` is raised.

    Args:
        path: The file.
        topics: Only these topics are decoded and given, None for all.

    Raises:
        RecordingError: There is no such file or it is no MCAP file (raised at once), or a message
            of it cannot be decoded.
        RecordingTruncated: After the last valid message, where the file is not complete.
    """
    return _messages(Salvage(path), topics)


def _messages(records: Salvage, topics: Collection[str] | None) -> Iterator[Message]:
    decoder = _Decoder(records.path)
    count = 0
    for record in records:
        kind = type(record).__name__
        if kind == "Message":
            count += 1
            topic = decoder.topic(record)
            if topics is None or topic in topics:
                yield decoder.message(topic, record)
        elif kind in ("Schema", "Channel"):
            decoder.learn(kind, record)
    if not records.intact:
        raise RecordingTruncated(records.path, count)


class _Decoder:
    """Knows the channels met so far, and the types of their messages."""

    def __init__(self, path: Path) -> None:
        from .ros_types import ros_types

        self._path = path
        self._ros: RosTypes = ros_types()
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}

    def learn(self, kind: str, record: Any) -> None:
        (self._schemas if kind == "Schema" else self._channels)[record.id] = record

    def topic(self, message: Any) -> str:
        return self._channels[message.channel_id].topic

    def message(self, topic: str, message: Any) -> Message:
        schema = self._schemas[self._channels[message.channel_id].schema_id]
        try:
            data = self._ros.decode(schema.name, message.data)
        except Exception as cause:
            raise RecordingError(
                self._path, f"a {schema.name} on {topic} cannot be decoded ({cause})"
            ) from cause
        return Message(topic, message.log_time, data)
