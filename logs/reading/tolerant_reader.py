"""Reads the records of an MCAP file up to the first damage.

It finds damage that the mcap library does not report: records that refer to unknown channels, wrong
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
from logs.records.file_format import MAGIC, MAX_RECORD, is_journal, valid_size

from .mcap_records import HEAD, Decoder, damage

if TYPE_CHECKING:
    from mcap.records import Footer

_CRC_BYTES = 4
_BLOCK_BYTES = 65536


class TolerantReader:
    """Iterates over the valid records of a finished, unfinished, cut or damaged file.

    It checks every checksum in the file. It reads one chunk at a time, so it needs little memory.

    Attributes:
        path: The file.
        intact: True if the file was complete and undamaged. Valid after iterating.
        messages: Number of messages yielded so far.
        valid: Size of the valid part of the file, as far as the file was read [bytes].
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
            if not S_ISREG(path.stat().st_mode):  # opening a pipe could block
                raise RecordingError(path, "is not a file; give a recording, such as *.mcap")
            with path.open("rb") as stream:
                head = stream.read(len(MAGIC))
        except OSError as cause:
            reason = cause.strerror or str(cause)
            raise RecordingError(path, f"cannot be read ({reason}); check the path") from cause
        if not MAGIC.startswith(head):
            raise RecordingError(path, "is not an MCAP file; give a recording, such as *.mcap")

    def __iter__(self) -> Iterator[Any]:
        """Yield MCAP records in file order up to the first damage.

        Raises:
            OSError: The disk failed.
        """
        with self.path.open("rb") as stream:
            end = valid_size(stream) if is_journal(stream) else sys.maxsize
            try:
                yield from self._valid_records(stream, end)
            except damage():
                return
            finally:
                if stream.tell() >= end:
                    self.valid = end  # `end` includes the checksum of the last valid piece

    @property
    def torn(self) -> int:
        """Number of invalid bytes at the end of the file. Valid after iterating."""
        return 0 if self.intact else self.path.stat().st_size - self.valid

    def _valid_records(self, stream: BinaryIO, end: int) -> Iterator[Any]:
        """Yield records up to the first invalid record, or up to the offset `end` [bytes]."""
        from mcap.records import Channel, DataEnd, Footer, Header, Message, Schema

        size = self.path.stat().st_size
        decoder = Decoder()
        schemas, channels = {0}, set[int]()
        crc = crc32(stream.read(len(MAGIC)))
        started = ended = False
        record: Any = None
        while not isinstance(record, Footer):
            head = stream.read(HEAD.size)
            opcode, length = HEAD.unpack(head)
            if length > min(MAX_RECORD, size - stream.tell()):
                return
            body, before = stream.read(length), crc
            place, crc = stream.tell(), crc32(body, crc32(head, crc))
            for record in decoder.records(opcode, body, place):
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
                    case DataEnd():
                        valid &= record.data_section_crc in (0, before)
                        ended = True
                if not valid:
                    return
                self.valid = place
                yield record
        ended &= stream.read(len(MAGIC)) == MAGIC
        self.intact = ended and summary_is_valid(record, stream)


def summary_is_valid(footer: "Footer", stream: BinaryIO) -> bool:
    """Return True if the checksum of the summary is right. The mcap library does not check it."""
    left = stream.seek(0, os.SEEK_END) - len(MAGIC) - _CRC_BYTES - footer.summary_start
    if left < 0 or not footer.summary_crc:
        return left >= 0
    stream.seek(footer.summary_start)
    actual = 0
    while left > 0 and (block := stream.read(min(left, _BLOCK_BYTES))):
        actual = crc32(block, actual)
        left -= len(block)
    return footer.summary_crc == actual
