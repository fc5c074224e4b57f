"""Reads the records of an MCAP file up to the first damage.

It finds damage that the mcap library overlooks: records that refer to unknown channels, wrong
checksums of attachments and of the summary, and damage in a journal.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from stat import S_ISREG
from typing import TYPE_CHECKING, Any, BinaryIO
from zlib import crc32

from logs.errors import RecordingError
from logs.records.file_format import MAGIC, is_journal, valid_size

if TYPE_CHECKING:
    from mcap.records import Attachment, Footer

_CRC_BYTES = 4
_ATTACHMENT_HEAD_BYTES = 32  # two times of 8, the lengths of name, type (4 each) and data (8)
_BLOCK_BYTES = 65536


class TolerantReader:
    """Iterates over the valid records of a finished, unfinished, cut or damaged file.

    It checks every checksum in the file. It reads lazily, one chunk at a time.

    Attributes:
        path: The file.
        intact: After iterating: True if the file was complete and undamaged.
        messages: Number of messages yielded so far.
        valid: Size of the part of the file that was read and is valid [bytes].
    """

    def __init__(self, path: Path) -> None:
        """Read the first bytes only.

        Raises:
            RecordingError: The file does not exist, or is not an MCAP file.
        """
        self.path = path
        self.intact = False
        self.messages = self.valid = 0
        try:
            if not S_ISREG(path.stat().st_mode):  # to open a pipe could block
                raise RecordingError(path, "is no file; give a recording, such as *.mcap")
            with path.open("rb") as stream:
                head = stream.read(len(MAGIC))
        except OSError as cause:
            reason = cause.strerror or str(cause)
            raise RecordingError(path, f"cannot be read ({reason}); check the path") from cause
        if not MAGIC.startswith(head):
            raise RecordingError(path, "is not an MCAP file; give a recording, such as *.mcap")

    def __iter__(self) -> Iterator[Any]:
        """Yield MCAP records in file order; end at the first damage.

        Raises:
            OSError: The disk failed.
        """
        with self.path.open("rb") as stream:
            end = valid_size(stream) if is_journal(stream) else sys.maxsize
            try:
                yield from self._valid_records(stream, end)
            except OSError:
                raise
            except Exception:
                # Damaged bytes make the decoder raise anything:
                # McapError, struct.error, ValueError, ZstdError, MemoryError and more.
                return
            finally:
                if stream.tell() >= end:
                    self.valid = end  # includes the checksum of the last piece

    @property
    def torn(self) -> int:
        """After iterating: number of bytes at the end of the file that are not valid."""
        return 0 if self.intact else self.path.stat().st_size - self.valid

    def _valid_records(self, stream: BinaryIO, end: int) -> Iterator[Any]:
        """Yield records up to the first invalid one, or up to an offset in the file [bytes]."""
        from mcap.records import Attachment, Channel, DataEnd, Footer, Header, Message, Schema
        from mcap.stream_reader import StreamReader

        # Without a limit, a damaged length makes the reader allocate gigabytes.
        limit = self.path.stat().st_size
        reader = StreamReader(stream, validate_crcs=True, record_size_limit=limit)
        schemas, channels = {0}, set[int]()
        started = ended = False
        for record in reader.records:
            place = stream.tell()
            valid = isinstance(record, Header) is not started and place <= end
            started = True
            match record:
                case Message():
                    valid &= record.channel_id in channels
                    self.messages += valid
                case Schema():
                    schemas.add(record.id)
                case Channel():
                    channels.add(record.id)
                    valid &= record.schema_id in schemas
                case Attachment():
                    valid &= _attachment_is_valid(record, stream)
                case DataEnd():
                    ended = True
            if not valid:
                return
            self.valid = place
            yield record
        if ended and isinstance(record, Footer):
            self.intact = _summary_is_valid(record, stream)


def _attachment_is_valid(attachment: "Attachment", stream: BinaryIO) -> bool:
    """Return whether the checksum of the attachment just read is right; mcap does not check it."""
    names = len(attachment.name.encode()) + len(attachment.media_type.encode())
    size = _ATTACHMENT_HEAD_BYTES + names + len(attachment.data)
    stream.seek(-size - _CRC_BYTES, os.SEEK_CUR)
    actual, expected = crc32(stream.read(size)), stream.read(_CRC_BYTES)
    return int.from_bytes(expected, "little") in (0, actual)


def _summary_is_valid(footer: "Footer", stream: BinaryIO) -> bool:
    """Return whether the checksum of the summary is right; mcap's stream reader skips it."""
    left = stream.seek(0, os.SEEK_END) - len(MAGIC) - _CRC_BYTES - footer.summary_start
    if left < 0 or not footer.summary_crc:
        return left >= 0
    stream.seek(footer.summary_start)
    actual = 0
    while left > 0 and (block := stream.read(min(left, _BLOCK_BYTES))):
        actual = crc32(block, actual)
        left -= len(block)
    return footer.summary_crc == actual
