"""Random access to a finished recording through its index, so that long recordings open quickly."""

import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from struct import Struct
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, TypeVar

from hardware.loading.dataclass import dataclass
from logs.errors import RecordingError, RecordingInUse
from logs.records.file_format import INVALID, MAGIC, MAX_RECORD

from .file_state import being_written
from .mcap_records import HEAD, BadRecord, Decoder, damage
from .reader import Message
from .recording import Recording, topic_filter
from .tolerant_reader import summary_is_valid

if TYPE_CHECKING:
    from mcap.summary import Summary

_CHUNK, _MESSAGE_INDEX, _ATTACHMENT, _METADATA = 0x06, 0x07, 0x09, 0x0C
_FOOTER = Struct("<BQQQI")  # opcode, length, offsets of the summary, checksum
_INDEX_HEAD = Struct("<HI")  # channel, and number of following bytes
_INDEX_ENTRY = Struct("<QQ")  # time, and offset in the chunk
_FOREIGN = "another program wrote the file; give the recording that armtree wrote"

T = TypeVar("T")
Entry = tuple[int, int]  # time of a message [ns], and offset in the data of its chunk


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk of a recording.

    Attributes:
        number: Number of the chunk in the file, from 0.
        begin_ns: Time of its first message, UTC since 1970 [ns].
        offset: Offset of the chunk in the file [bytes].
        indexes: Offset of the index of each topic in the file [bytes], by topic.
    """

    number: int
    begin_ns: int
    offset: int
    indexes: Mapping[str, int]


class IndexedRecording(Recording):
    """A finished recording. Its messages are read chunk by chunk, in any order.

    The index has the places of `files` and `notes`. A part is checked for damage when it is read.

    Args:
        path: The file.

    Attributes:
        chunks: All chunks of the file, in file order. This is also the order of time.
        begin_ns, end_ns: Times of the first and of the last message, UTC since 1970 [ns].
        types: Type of each topic with messages.
    """

    def __init__(self, path: Path | str) -> None:
        """Read the index.

        Raises:
            RecordingInUse: The recording is being written.
            RecordingError: The file does not exist, is not a recording of armtree, or has no index.
        """
        if being_written(Path(path)):  # the file may have no message yet
            raise RecordingInUse(Path(path))
        super().__init__(path)
        self._summary = summary = self._read_summary()
        topics = {
            number: (channel.topic, summary.schemas[channel.schema_id].name)
            for number, channel in summary.channels.items()
            if channel.schema_id in summary.schemas
        }
        self.types = dict(topics.values())
        found = sorted(summary.chunk_indexes, key=lambda each: each.chunk_start_offset)
        self.chunks = tuple(
            Chunk(
                number,
                each.message_start_time,
                each.chunk_start_offset,
                {topics[c][0]: at for c, at in each.message_index_offsets.items() if c in topics},
            )
            for number, each in enumerate(found)
        )
        self.begin_ns = min((each.message_start_time for each in found), default=self.epoch_ns)
        self.end_ns = max((each.message_end_time for each in found), default=self.epoch_ns)

    @cached_property
    def files(self) -> dict[str, bytes]:
        """Attachments by name."""
        wanted = [each.offset for each in self._summary.attachment_indexes]
        return dict(self._unpacked(each) for each in self._decoded(wanted, _ATTACHMENT))

    @cached_property
    def notes(self) -> dict[str, dict[str, str]]:
        """Notes by name; each holds values by key."""
        wanted = [each.offset for each in self._summary.metadata_indexes]
        return {each.name: dict(each.metadata) for each in self._decoded(wanted, _METADATA)}

    def open(self, chunk: Chunk, decoder: Decoder | None = None) -> "OpenChunk":
        """Unpack a chunk.

        Args:
            chunk: The chunk.
            decoder: Decoder, which limits the total unpacked size of the chunks that it decodes.
                Default: a new decoder for this chunk.

        Raises:
            RecordingError: The chunk is damaged.
        """
        decoder = decoder or Decoder()
        with self.decoding(), self.path.open("rb") as stream:
            body = _record(stream, chunk.offset, _CHUNK)
            tables = {topic: _table(stream, at) for topic, at in chunk.indexes.items()}
            place = chunk.offset + HEAD.size + len(body)
            return OpenChunk(self, tables, decoder, decoder.unpacked_chunk(body, place), place)

    def topics_of(self, *kinds: type) -> list[str]:
        """Return the topics with records of these types."""
        return list(filter(topic_filter(kinds), self.types))

    def record_at(self, index: Literal[0, -1], kind: type[T]) -> T | None:
        """Return the first or the last record of a type, or None if there is none.

        Args:
            index: 0 for the first record, -1 for the last record.
            kind: Type of the record, such as `Goal`. Only types that are written as one message.

        Raises:
            RecordingError: A chunk is damaged, or the record cannot be decoded.
        """
        chunks = self.with_topic(topics := self.topics_of(kind))
        messages = self.open(chunks[index]).messages(topics) if chunks else []
        found = self.record([messages[index]]) if messages else None
        return found if isinstance(found, kind) else None

    def count(self, topic: str) -> int:
        """Return the number of messages on a topic, from the statistics at the end of the file.

        Raises:
            RecordingError: The file has no statistics.
        """
        if (statistics := self._summary.statistics) is None:
            raise RecordingError(self.path, f"has no statistics: {_FOREIGN}")
        counts, channels = statistics.channel_message_counts, self._summary.channels
        return sum(counts.get(number, 0) for number, c in channels.items() if c.topic == topic)

    def with_topic(self, topics: Collection[str]) -> tuple[Chunk, ...]:
        """Return the chunks that contain a message on at least one of these topics."""
        return tuple(each for each in self.chunks if not each.indexes.keys().isdisjoint(topics))

    @contextmanager
    def decoding(self) -> Iterator[None]:
        """Context that converts exceptions caused by damaged bytes to RecordingError.

        Raises:
            RecordingError: The bytes are damaged, or the file cannot be read.
        """
        try:
            yield
        except damage(OSError) as cause:
            what = f"is damaged ({cause}); type armtree log recover FILE"
            raise RecordingError(self.path, what) from cause

    def _decoded(self, offsets: Collection[int], opcode: int) -> Iterator[Any]:
        decoder = Decoder()
        with self.decoding(), self.path.open("rb") as stream:
            for at in offsets:
                body = _record(stream, at, opcode)
                yield from decoder.records(opcode, body, at)

    def _read_summary(self) -> "Summary":
        from mcap.reader import make_reader

        try:
            with self.path.open("rb") as stream:
                _check_summary(stream)
                summary = make_reader(stream).get_summary()
        except damage(OSError):
            summary = None
        if summary is None or not summary.chunk_indexes:
            raise RecordingError(self.path, "has no index; type armtree log recover FILE")
        offsets = [each.chunk_start_offset for each in summary.chunk_indexes]
        if len(set(offsets)) < len(offsets):
            raise RecordingError(self.path, f"lists a chunk twice in its index: {_FOREIGN}")
        return summary


class OpenChunk:
    """An unpacked chunk.

    Args:
        recording: The recording that contains the chunk.
        tables: Bytes of the index of each topic, by topic.
        decoder: Decoder for the messages of the chunk.
        data: Unpacked bytes of the chunk: its records.
        place: Offset of the end of the chunk in the file [bytes].
    """

    def __init__(
        self,
        recording: IndexedRecording,
        tables: Mapping[str, bytes],
        decoder: Decoder,
        data: bytes,
        place: int,
    ) -> None:
        self._recording, self._tables, self._decoder = recording, tables, decoder
        self._data, self._place = data, place

    @property
    def size(self) -> int:
        """Size of the unpacked chunk [bytes]."""
        return len(self._data)

    def entries(self, topic: str) -> list[Entry]:
        """Return the index entries of the messages on a topic, in file order."""
        table = self._tables.get(topic, b"")
        return list(_INDEX_ENTRY.iter_unpack(table))

    def count(self, topic: str) -> int:
        """Return the number of messages on a topic."""
        return len(self._tables.get(topic, b"")) // _INDEX_ENTRY.size

    def newest(self, topic: str) -> Entry | None:
        """Return the index entry of the last message on a topic; None if there is no message."""
        table = self._tables.get(topic)
        return _INDEX_ENTRY.unpack(table[-_INDEX_ENTRY.size :]) if table else None

    def message(self, topic: str, entry: Entry) -> Message:
        """Return the message on a topic that an index entry locates.

        Raises:
            RecordingError: The chunk is damaged.
        """
        with self._recording.decoding():
            return self._message(topic, entry)

    def messages(self, topics: Collection[str]) -> list[Message]:
        """Return the messages on the given topics, in file order.

        Raises:
            RecordingError: The chunk is damaged.
        """
        entries = ((entry, topic) for topic in topics for entry in self.entries(topic))
        found, left = [], len(self._data)
        with self._recording.decoding():
            for entry, topic in sorted(entries, key=lambda each: each[0][1]):
                found.append(self._message(topic, entry))
                left -= len(found[-1].cdr)
                if left < 0:
                    raise BadRecord("an index in which messages overlap")
        return found

    def _message(self, topic: str, entry: Entry) -> Message:
        recording = self._recording
        found = self._decoder.message_at(self._data, entry[1], self._place)
        return Message(topic, found.log_time, recording.types[topic], found.data, recording.path)


def _table(stream: BinaryIO, at: int) -> bytes:
    """Return the entries of a message index as bytes. The index is at offset `at` in the file."""
    body = _record(stream, at, _MESSAGE_INDEX)
    _, size = _INDEX_HEAD.unpack_from(body)
    table = body[_INDEX_HEAD.size :]
    if len(table) != size or size % _INDEX_ENTRY.size:
        raise BadRecord(f"an index of {size} bytes")
    return table


def _check_summary(stream: BinaryIO) -> None:
    """Check the lengths and the checksum of a summary, the last part of an MCAP file.

    The mcap library accepts any length, does not stop at zero bytes, and ignores the checksum.

    Args:
        stream: The file. The function returns with the stream at the beginning of the file.

    Raises:
        BadRecord: A length, an opcode or the checksum is invalid. The function may also raise the
            exceptions of `damage`.
    """
    from mcap.records import Footer

    end = stream.seek(-_FOOTER.size - len(MAGIC), os.SEEK_END)
    footer = Footer(*_FOOTER.unpack(stream.read(_FOOTER.size))[2:])
    at = footer.summary_start
    while 0 < at < end:
        stream.seek(at)
        opcode, length = HEAD.unpack(stream.read(HEAD.size))
        if opcode == INVALID or length > MAX_RECORD:
            raise BadRecord(f"opcode {opcode} of {length} bytes in the summary")
        at += HEAD.size + length
    if not summary_is_valid(footer, stream):
        raise BadRecord("a summary with a wrong checksum")
    stream.seek(0)


def _record(stream: BinaryIO, at: int, expected: int) -> bytes:
    """Return the body of the record at offset `at` in a file. Its opcode must be `expected`."""
    stream.seek(at)
    opcode, length = HEAD.unpack(stream.read(HEAD.size))
    if opcode != expected or length > min(MAX_RECORD, os.fstat(stream.fileno()).st_size):
        raise BadRecord(f"an invalid record at byte {at}: type {opcode}, {length} bytes")
    return stream.read(length)
