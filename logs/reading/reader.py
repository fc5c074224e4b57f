"""Reads the messages of a recording lazily: memory does not grow with the file."""

import json
from collections.abc import Collection, Iterator
from json.scanner import py_make_scanner  # type: ignore[attr-defined]
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hardware.loading.dataclass import dataclass
from logs.errors import RecordingError, RecordingTruncated

from .tolerant_reader import TolerantReader

if TYPE_CHECKING:
    from mcap.records import Attachment, Channel, Metadata

_JSON = "std_msgs/msg/String"
_TEXT_HEAD = 8  # number of bytes before a text in CDR
_LITTLE_ENDIAN = b"\0\1\0\0"  # first four bytes of little-endian CDR

# Largest size of a message [bytes]. Messages on the topics in `_LARGE` (motions, URDF) may be
# larger, up to the size of a chunk.
MAX_BYTES = 1 << 20
_LARGE = "/plan/", "/schedule", "/robot_description"

# Largest count of some characters in a JSON message. A motion of 10 minutes at 100 Hz with 16
# joints has 120,000 rows and 1,200,000 values. A world of 1000 bodies has 9000 keys.
_MOST = {"[": 250_000, "{": 10_000, ",": 1_500_000, ":": 20_000}

# A function in C keeps the interpreter's lock until it returns, and the server must be able to move
# and stop the arm during that time. So a longer JSON text is decoded in Python, and characters are
# counted in parts of this length [characters].
_AT_ONCE = 1 << 16


@dataclass(frozen=True, slots=True)
class Message:
    """One message of a recording.

    Attributes:
        topic: Topic of the message, such as `/serial/tx`.
        time_ns: Time of recording, UTC since 1970 [ns].
        type: ROS 2 type of the message, such as `sensor_msgs/msg/JointState`.
        cdr: The message in CDR encoding.
        path: File of the recording.
    """

    topic: str
    time_ns: int
    type: str
    cdr: bytes
    path: Path

    @property
    def data(self) -> Any:
        """The ROS 2 message, with fields as attributes. Each access decodes it again.

        Raises:
            RecordingError: The bytes do not fit the type, or the message is too large.
        """
        from logs.records.cdr import decode

        self._check_size()
        try:
            return decode(self.type, self.cdr)
        except Exception as cause:
            what = f"a {self.type} on {self.topic} cannot be decoded ({cause})"
            raise RecordingError(self.path, what) from cause

    def fields(self) -> dict[str, Any]:
        """Return the fields of a JSON message, such as those on `/tree` and `/plan/arm`.

        Raises:
            TypeError: The topic does not carry JSON.
            RecordingError: The message is not a JSON object, or is too large.
        """
        if self.type != _JSON:
            raise TypeError(f"{self.topic} carries {self.type}, not JSON: use .data")
        self._check_size()
        try:
            text = _plain_text(self.cdr)
            fields = _json(self.data.data if text is None else text)
        except (ValueError, RecursionError) as cause:
            what = f"a message on {self.topic} cannot be read as JSON: {cause}"
            raise RecordingError(self.path, what) from cause
        if not isinstance(fields, dict):
            raise RecordingError(self.path, f"a message on {self.topic} is not a JSON object")
        return fields

    def _check_size(self) -> None:
        size = len(self.cdr)
        if size > MAX_BYTES and not self.topic.startswith(_LARGE):
            what = f"a message on {self.topic} has {size} bytes; the limit is {MAX_BYTES}"
            raise RecordingError(self.path, what)


class _PythonDecoder(json.JSONDecoder):
    """JSON decoder in Python. Only strings are decoded in C: one of 14 MB took 11 ms."""

    def __init__(self) -> None:
        super().__init__()
        self.scan_once = py_make_scanner(self)


def _json(text: str) -> Any:
    """Return the value of a JSON text.

    Raises:
        ValueError: The text is not JSON, or has too many values.
        RecursionError: The value is nested too deeply.
    """
    if len(text) <= _AT_ONCE:
        return json.loads(text)
    begins = range(0, len(text), _AT_ONCE)
    for each, most in _MOST.items():
        count = sum(text.count(each, begin, begin + _AT_ONCE) for begin in begins)
        if count > most:
            raise ValueError(f"it contains {each} {count} times; the limit is {most} times")
    return _PythonDecoder().decode(text)


def _plain_text(cdr: bytes) -> str | None:
    """Return the text of a `std_msgs/msg/String` that armtree encoded; None for any other bytes.

    This function is many times faster than decoding field by field.
    """
    head = _LITTLE_ENDIAN + (len(cdr) - _TEXT_HEAD).to_bytes(4, "little", signed=True)
    plain = cdr[:_TEXT_HEAD] == head and not cdr[-1]
    return str(memoryview(cdr)[_TEXT_HEAD:-1], "utf-8") if plain else None


def read(path: Path | str, topics: Collection[str] | None = None) -> Iterator[Message]:
    """Yield the messages of a recording in file order.

    It also reads a file that was cut off or is being written: it yields all valid messages, and
    then raises `RecordingTruncated`.

    Args:
        path: The file.
        topics: Topics to read; None for all.

    Raises:
        RecordingError: The file does not exist, or is not an MCAP file. Raised at the call.
        RecordingTruncated: The file is not complete. Raised after the last valid message.
    """
    return _messages(TolerantReader(Path(path)), topics)


def _messages(records: TolerantReader, topics: Collection[str] | None) -> Iterator[Message]:
    for item in content(records):
        if isinstance(item, Message) and (topics is None or item.topic in topics):
            yield item
    if not records.intact:
        raise RecordingTruncated(records.path, records.messages)


def content(records: TolerantReader) -> Iterator["Message | Attachment | Metadata | Channel"]:
    """Yield messages, attachments, metadata and channels, in file order."""
    from mcap import records as mcap

    types = {0: ""}  # channels without a schema
    channels: dict[int, tuple[str, str]] = {}
    for record in records:
        match record:
            case mcap.Message():
                topic, name = channels[record.channel_id]
                yield Message(topic, record.log_time, name, record.data, records.path)
            case mcap.Schema():
                types[record.id] = record.name
            case mcap.Channel():
                channels[record.id] = record.topic, types[record.schema_id]
                yield record
            case mcap.Attachment() | mcap.Metadata():
                yield record
