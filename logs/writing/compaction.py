"""From a journal, well ended or not, to the final recording: chunked, compressed, indexed."""

import fcntl
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from logs.errors import RecordingError, RecordingInUse
from logs.reading.tolerant_reader import Salvage

from .checksums import UNFINISHED
from .summary import Summary

if TYPE_CHECKING:
    from mcap.writer import Writer

# The note that tells of all else in a finished recording what it was.
DIGESTS = "digests"

# The note in a recording that was made of less than a whole file.
RECOVERED = "recovered"

_CHUNK_BYTES = 262144  # smaller ones compress worse, and every one has indexes


def compact(journal: Path) -> Summary:
    """Replaces a journal by the recording of everything valid in it.

    One path for all: a journal that was closed, one that was cut off anywhere (of a file without
    a whole header an empty recording is made), and a finished recording, which stays as it is.
    The journal is replaced only after the new file was read back from the disk, and where bytes had
    to be dropped, it is kept beside it.

    Raises:
        RecordingInUse: It is still being written.
        RecordingError: There is no such file, it is no MCAP file, or the new file does not hold
            what it should; nothing was changed.
        OSError: The disk failed or is full; the journal is unchanged.
    """
    with locked(journal):
        return rewrite(journal)


@contextmanager
def locked(recording: Path) -> Iterator[None]:
    """Holds the lock that whoever writes a recording has.

    Raises:
        RecordingInUse: Somebody else holds it.
        RecordingError: There is no such file.
    """
    try:
        handle = os.open(recording, os.O_RDONLY | os.O_NONBLOCK)  # it might be a pipe
    except OSError as cause:
        reason = cause.strerror or str(cause)
        raise RecordingError(recording, f"cannot be read ({reason}); check the path") from cause
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as cause:
        raise RecordingInUse(recording) from cause
    finally:
        os.close(handle)


def rewrite(journal: Path) -> Summary:
    """See `compact`; for whoever holds the lock."""
    records = Salvage(journal)
    new = part_of(journal)
    try:
        messages = _write(records, new)
        torn = records.torn
        _check(new, messages)
        damaged = _keep(journal) if torn else None
        shutil.copystat(journal, new)  # a pin is a mode, and an age a time
        os.replace(new, journal)
    finally:
        new.unlink(missing_ok=True)
    _sync_folder(journal.parent)
    size = journal.stat().st_size
    return Summary(journal, messages, size, records.intact, torn, damaged)


def part_of(recording: Path) -> Path:
    """Where the recording is made that is to replace a journal."""
    return recording.with_name(recording.name + ".part")


def _keep(recording: Path) -> Path:
    """Gives a damaged recording one more name, under which it stays when it is replaced."""
    for number in count(1):
        kept = recording.with_name(f"{recording.name}.damaged{'' if number == 1 else number}")
        with suppress(FileExistsError):
            try:
                os.link(recording, kept)
            except FileExistsError:
                raise
            except OSError:  # a file system where a file has one name only
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


def _write(records: Salvage, new: Path) -> int:
    from mcap.writer import Writer

    from .digests import Digests

    digests = Digests()
    with new.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK_BYTES, enable_data_crcs=True)
        copy = _Copy(writer)
        messages = copy.all(digests.watch(records))
        if not records.intact:
            copy.all(digests.watch([_recovered(records.torn)]))
        kept = digests.noted if records.intact else {}
        writer.add_metadata(DIGESTS, kept or digests.made())
        writer.finish()  # type: ignore[no-untyped-call]
        stream.flush()
        os.fsync(stream.fileno())
    return messages


def _recovered(torn: int) -> Any:
    from mcap.records import Metadata

    return Metadata(RECOVERED, {"torn_bytes": str(torn)})


def _check(new: Path, messages: int) -> None:
    from mcap.reader import make_reader

    copy = Salvage(new)
    for _ in copy:
        pass
    indexed = -1
    if copy.intact:
        with new.open("rb") as stream:
            summary = make_reader(stream, validate_crcs=True).get_summary()
        indexed = summary.statistics.message_count if summary and summary.statistics else -1
    if not messages == copy.messages == indexed:
        raise RecordingError(new, f"holds {copy.messages} of {messages} messages; check the disk")


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


class _Copy:
    """Writes records again, schemas and channels under numbers of their own."""

    def __init__(self, writer: "Writer") -> None:
        from mcap import records as mcap

        self._writer = writer
        self._started = False
        self._schemas = {0: 0}
        self._channels: dict[int, int] = {}
        self._messages = 0
        self._copy: dict[type, Callable[[Any], None]] = {
            mcap.Header: self._header,
            mcap.Schema: self._schema,
            mcap.Channel: self._channel,
            mcap.Message: self._message,
            mcap.Attachment: self._attachment,
            mcap.Metadata: self._metadata,
        }

    def all(self, records: Iterable[Any]) -> int:
        """Copies everything valid; gives the number of messages."""
        for record in records:
            if copy := self._copy.get(type(record)):
                copy(record)
        if not self._started:
            self._writer.start("ros2", "armtree")
            self._started = True
        return self._messages

    def _header(self, header: Any) -> None:
        self._writer.start(header.profile, header.library.removesuffix(UNFINISHED))
        self._started = True

    def _schema(self, schema: Any) -> None:
        # The summary repeats schemas and channels.
        if schema.id not in self._schemas:
            number = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            self._schemas[schema.id] = number

    def _channel(self, channel: Any) -> None:
        if channel.id not in self._channels:
            self._channels[channel.id] = self._writer.register_channel(
                channel.topic,
                channel.message_encoding,
                self._schemas[channel.schema_id],
                channel.metadata,
            )

    def _message(self, message: Any) -> None:
        self._writer.add_message(
            self._channels[message.channel_id],
            message.log_time,
            message.data,
            message.publish_time,
            message.sequence,
        )
        self._messages += 1

    def _attachment(self, attachment: Any) -> None:
        self._writer.add_attachment(
            attachment.create_time,
            attachment.log_time,
            attachment.name,
            attachment.media_type,
            attachment.data,
        )

    def _metadata(self, metadata: Any) -> None:
        if metadata.name != DIGESTS:  # which are made anew
            self._writer.add_metadata(metadata.name, metadata.metadata)
