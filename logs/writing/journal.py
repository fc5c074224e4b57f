"""The journal: the file of a run while records are added. It consists of pieces, without chunks."""

import os
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from io import BufferedWriter
from pathlib import Path
from typing import IO
from weakref import finalize

from mcap import records as mcap
from mcap.data_stream import RecordBuilder

from hardware.description.forward_kinematics import ForwardKinematics
from hardware.description.urdf import Urdf
from hardware.installed import version
from logs.errors import DISK_FULL
from logs.records.cdr import encode
from logs.records.conversions import Stamp
from logs.records.file_format import END, MAGIC, UNFINISHED, checked
from logs.records.records import Attachment, Description, Item, Note, Record
from logs.records.ros_types import schema, type_hash
from logs.records.topics import ROSBAG2, TOPICS, Topic, offered_qos, topics_of

# Reserved disk space for the end of a run: for its last records, and to compact a journal of 2 MB.
_RESERVE = 1 << 20  # [bytes]

_SEQUENCE_BITS = 0xFFFFFFFF

_SCHEMAS = {name: number for number, name in enumerate({topic.type: 0 for topic in TOPICS}, 1)}
_CHANNELS = {topic.name: number for number, topic in enumerate(TOPICS, 1) if topic.fixed}
_TOPICS = {topic.record: topics_of(topic.record) for topic in TOPICS}


@dataclass
class _Channel:
    number: int
    sequence: int = 0


class Journal:
    """Writes the journal of a run. Not thread-safe.

    Each record is written immediately; `kill -9` loses at most the record that is being written. A
    closed journal is a complete MCAP file without a summary. An open journal is the beginning of
    such a file. `compaction.rewrite` makes a finished recording from an open or closed journal.
    """

    def __init__(self, stream: BufferedWriter, epoch_ns: int) -> None:
        """Write header, metadata, schemas and channels.

        Args:
            stream: The new file. The journal closes it.
            epoch_ns: UTC time at time 0 of the records' clock [ns since 1970].

        Raises:
            OSError: The stream cannot be written.
        """
        self._file = PieceWriter(stream)
        self._epoch_ns = epoch_ns
        self._last_ns = 0
        self._kinematics: ForwardKinematics | None = None
        self._channels = {name: _Channel(number) for name, number in _CHANNELS.items()}
        self._file.write(checked(_head(epoch_ns)))

    def write(self, *items: Item) -> None:
        """Write items as one piece: attachments, notes, and the messages of records.

        Raises:
            OSError: The disk is full or failed.
            Exception: A record cannot be converted. Nothing is written.
        """
        self._file.write(checked(b"".join(map(self._encoded, items))))

    def finish(self) -> None:
        """Write the end of the file, sync the file to the disk and close it.

        Raises:
            OSError: The disk is full or failed.
        """
        self._file.write(END)
        self._file.close()

    @property
    def closed(self) -> bool:
        """True after `finish` or a failed write. A closed journal accepts no more items."""
        return self._file.closed

    @property
    def full(self) -> bool:
        """True if the disk was full, so that the end of the run uses the reserved space."""
        return self._file.full

    def write_time(self) -> float:
        """Return the total duration of writes since the last call of this method [s].

        An unfinished write counts up to now.
        """
        return self._file.write_time()

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
            message = topic.convert(record, stamp)
            if message is not None:
                messages.append((channel, encode(topic.type, message)))
        return messages

    def _channel(self, topic: Topic, record: Record) -> _Channel:
        name = topic.name_for(record)
        if name not in self._channels:
            number = len(TOPICS) + len(self._channels)
            self._file.write(checked(_bytes(_described(topic, name, number))))
            self._channels[name] = _Channel(number)
        return self._channels[name]


class PieceWriter:
    """Appends pieces to a file. A piece is written as a whole, or not at all.

    It reserves disk space. When the disk is full, it frees this space for the last pieces.

    Attributes:
        full: True if the disk was full and the reserved space was freed.
    """

    def __init__(self, stream: BufferedWriter) -> None:
        """Take ownership of a new, empty file, and reserve disk space.

        Args:
            stream: The file. Only its file descriptor is used.
        """
        self.full = False
        self._stream = stream
        self._written = 0
        self._began: float | None = None  # start time of the unfinished write [s]
        self._spent = 0.0  # duration of writes since the last `write_time` [s]
        self._reserve = _reserve(Path(str(stream.name)).parent)
        if self._reserve:
            finalize(self, self._reserve.close)

    def write(self, data: bytes) -> None:
        """Write a piece with the operating system's `write`, without a sync to the disk.

        Raises:
            OSError: The disk failed, or is full although the reserved space was freed. The file is
                closed, and ends with the previous piece.
        """
        try:
            self._write(data)
        except OSError as error:
            if error.errno not in DISK_FULL or self._reserve is None:
                self._abandon()
                raise
            self._release()
            self.full = True
            try:
                self._write(data)
            except OSError:
                self._abandon()
                raise

    def close(self) -> None:
        """Sync the file to the disk and close it.

        Raises:
            OSError: The disk failed.
        """
        try:
            os.fsync(self._stream.fileno())
        finally:
            self._release()
            self._stream.close()

    @property
    def closed(self) -> bool:
        """True after `close` or a failed write."""
        return self._stream.closed

    def write_time(self) -> float:
        """Return the total duration of writes since the last call of this method [s].

        An unfinished write counts up to now.
        """
        began = self._began
        so_far = time.monotonic() - began if began is not None else 0.0
        # At its end, an unfinished write adds its whole duration. Subtract the part counted now.
        spent, self._spent = self._spent + so_far, -so_far
        return spent

    def _write(self, data: bytes) -> None:
        handle, done = self._stream.fileno(), 0
        self._began = began = time.monotonic()
        try:
            while done < len(data):
                done += os.write(handle, memoryview(data)[done:])
        except OSError:
            with suppress(OSError):  # only the first failure is reported
                os.ftruncate(handle, self._written)
                os.lseek(handle, self._written, os.SEEK_SET)
            raise
        finally:
            self._spent += time.monotonic() - began
            self._began = None
        self._written += done

    def _abandon(self) -> None:
        with suppress(OSError):
            self._stream.close()
        self._release()

    def _release(self) -> None:
        reserve, self._reserve = self._reserve, None
        if reserve:
            reserve.close()


def _reserve(folder: Path) -> IO[bytes] | None:
    """Reserve disk space with a temporary file that has no name, so that no crash leaves it behind.

    Returns:
        The file, or None if the disk has too little space. Closing the file frees the space.
    """
    try:
        reserve = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115, closed by `PieceWriter`
    except OSError:
        return None
    try:
        os.posix_fallocate(reserve.fileno(), 0, _RESERVE)
    except OSError:
        reserve.close()
        return None
    return reserve


def _described(topic: Topic, name: str, number: int) -> mcap.Channel:
    facts = {"offered_qos_profiles": offered_qos(topic), "topic_type_hash": type_hash(topic.type)}
    return mcap.Channel(number, name, "cdr", facts, _SCHEMAS[topic.type])


@lru_cache(maxsize=1)
def _head(epoch_ns: int) -> bytes:
    """Return the first bytes of a journal: magic, header, metadata, schemas and channels.

    Args:
        epoch_ns: UTC time at time 0 of the records' clock [ns since 1970].
    """
    schemas = (
        mcap.Schema(number, schema(name).encode(), "ros2msg", name)
        for name, number in _SCHEMAS.items()
    )
    named = {topic.name: topic for topic in TOPICS}
    return MAGIC + _bytes(
        mcap.Header("ros2", f"armtree {version('armtree')}".rstrip() + UNFINISHED),
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


@lru_cache(maxsize=1)
def _kinematics(urdf: str) -> ForwardKinematics:
    """Return the kinematics of a URDF. Cached: all recordings of a server have the same robot."""
    return ForwardKinematics(Urdf(urdf).checked())
