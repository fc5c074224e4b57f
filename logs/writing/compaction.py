"""Compaction: makes a finished recording from a journal. It is chunked, compressed and indexed.

A journal is a recording that is still being written, or whose process was killed.
"""

import os
import shutil
from collections.abc import Iterable
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hardware.loading.dataclass import dataclass
from logs.errors import RecordingError
from logs.reading.tolerant_reader import TolerantReader
from logs.records.file_format import DIGESTS, RECOVERED, UNFINISHED

if TYPE_CHECKING:
    from mcap.writer import Writer

# Size of a chunk. Smaller chunks compress worse and need more indexes.
_CHUNK_BYTES = 262144


@dataclass(frozen=True, slots=True)
class Summary:
    """The outcome of a compaction or recovery.

    Attributes:
        path: File of the finished recording.
        messages: Number of messages in the finished recording.
        bytes: Size of the file [bytes]; 0 if nothing was recorded and the file was removed.
        whole: True if the original file was undamaged and its end was not missing.
        torn: Number of invalid bytes at the end of the original file.
        damaged: Copy of the original file if bytes were lost; else None.
    """

    path: Path
    messages: int
    bytes: int
    whole: bool
    torn: int
    damaged: Path | None = None

    def text(self) -> str:
        """Return a sentence for people that says what was recovered."""
        if not self.bytes:
            return f"{self.path}: was empty and is removed: its run had recorded nothing"
        if self.whole:
            return f"{self.path}: {self.messages} messages, nothing was lost"
        end = "the end of the run is missing"
        if self.damaged:
            end = f"the original file is kept as {self.damaged.name}"
        return (
            f"{self.path}: recovered {self.messages} messages; {self.torn} bytes after them are "
            f"incomplete or damaged; {end}"
        )


def rewrite(journal: Path) -> Summary:
    """Replace a journal with a finished recording of its valid content.

    The caller must hold the lock of the journal. The journal may be closed or cut off anywhere. The
    file may also be a finished recording, which keeps its content. A file without a complete header
    becomes an empty recording. The new file is read and checked before it replaces the journal. If
    bytes are lost, a copy of the journal is kept.

    Raises:
        RecordingError: The file does not exist, is not an MCAP file, or the new file lacks
            messages. The journal is unchanged.
        OSError: The disk failed or is full. The journal is unchanged.
    """
    records = TolerantReader(journal)
    new = part_of(journal)
    try:
        messages = write_finished(records, new)
        torn = records.torn
        _check(new, messages)
        damaged = _keep(journal) if torn else None
        shutil.copystat(journal, new)  # keeps the pin (file mode) and the age of the recording
        os.replace(new, journal)
    finally:
        new.unlink(missing_ok=True)
    _sync_folder(journal.parent)
    size = journal.stat().st_size
    return Summary(journal, messages, size, records.intact, torn, damaged)


def part_of(recording: Path) -> Path:
    """Return the path of the temporary file that later replaces a journal."""
    return recording.with_name(recording.name + ".part")


def _keep(recording: Path) -> Path:
    """Keep a damaged recording under another name, and return the new path."""
    for number in count(1):
        kept = recording.with_name(f"{recording.name}.damaged{'' if number == 1 else number}")
        with suppress(FileExistsError):
            try:
                os.link(recording, kept)
            except FileExistsError:
                raise
            except OSError:  # the file system has no hard links
                _copy(recording, kept)
            break
    return kept


def _copy(recording: Path, kept: Path) -> None:
    with recording.open("rb") as source, kept.open("xb") as target:
        try:
            shutil.copyfileobj(source, target)
            target.flush()
            os.fsync(target.fileno())
        except OSError:
            kept.unlink()
            raise
    shutil.copystat(recording, kept)


def write_finished(records: TolerantReader, new: Path) -> int:
    """Write the valid records of a file to a finished recording. Return the number of messages.

    Args:
        records: Reader of the original file.
        new: File to write.
    """
    from mcap.records import Metadata
    from mcap.writer import Writer

    from logs.reading.digests import Digests

    digests = Digests()
    with new.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK_BYTES, enable_data_crcs=True)
        copy = Copy(writer)
        messages = copy.all(digests.watch(records))
        if not records.intact:
            copy.all(digests.watch([Metadata(RECOVERED, {"torn_bytes": str(records.torn)})]))
        kept = digests.noted if records.intact else {}
        writer.add_metadata(DIGESTS, kept or digests.made())
        writer.finish()  # type: ignore[no-untyped-call]
        stream.flush()
        os.fsync(stream.fileno())
    return messages


def _check(new: Path, messages: int) -> None:
    from mcap.reader import make_reader

    copy = TolerantReader(new)
    for _ in copy:
        pass
    indexed = -1
    if copy.intact:
        with new.open("rb") as stream:
            summary = make_reader(stream, validate_crcs=True).get_summary()
        indexed = summary.statistics.message_count if summary and summary.statistics else -1
    if not messages == copy.messages == indexed:
        raise RecordingError(new, f"has {copy.messages} of {messages} messages; check the disk")


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


class Copy:
    """Copies MCAP records to a writer of the mcap library. Schemas and channels get new numbers."""

    def __init__(self, writer: "Writer") -> None:
        self._writer = writer
        self._started = False
        self._schemas = {0: 0}
        self._channels: dict[int, int] = {}
        self._messages = 0

    def all(self, records: Iterable[Any]) -> int:
        """Copy all records except indexes and digests.

        Returns the number of messages that were copied since the object was created.
        """
        from mcap import records as mcap

        new = self._writer
        for record in records:
            match record:
                case mcap.Message(sequence=sequence, log_time=time, publish_time=published):
                    number = self._channels[record.channel_id]
                    new.add_message(number, time, record.data, published, sequence)
                    self._messages += 1
                case mcap.Header(profile=profile, library=library):
                    self._start(profile, library.removesuffix(UNFINISHED))
                # The summary repeats the schemas and channels.
                case mcap.Schema() if record.id not in self._schemas:
                    number = new.register_schema(record.name, record.encoding, record.data)
                    self._schemas[record.id] = number
                case mcap.Channel(schema_id=id_, metadata=facts) if record.id not in self._channels:
                    encoding, schema = record.message_encoding, self._schemas[id_]
                    number = new.register_channel(record.topic, encoding, schema, facts)
                    self._channels[record.id] = number
                case mcap.Attachment(create_time=created, log_time=time, name=name):
                    new.add_attachment(created, time, name, record.media_type, record.data)
                case mcap.Metadata(name=name) if name != DIGESTS:  # digests are computed again
                    new.add_metadata(name, record.metadata)
        if not self._started:
            self._start("ros2", "armtree")
        return self._messages

    def _start(self, profile: str, library: str) -> None:
        self._writer.start(profile, library)
        self._started = True
