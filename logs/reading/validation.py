"""Damage in an MCAP file that its reader does not see."""

import os
from typing import BinaryIO
from zlib import crc32

from mcap.records import Attachment, Channel, DataEnd, Footer, Header, McapRecord, Message, Schema

_CRC_BYTES = 4
_MAGIC_BYTES = 8
_ATTACHMENT_HEAD_BYTES = 32  # two times of 8, the lengths of name, type (4 each) and data (8)
_BLOCK_BYTES = 65536


class Sense:
    """Tells records that cannot stand where they stand.

    Attributes:
        messages: How many messages made sense.
        data_ended: Whether the end of the data was among them.
    """

    def __init__(self) -> None:
        self.messages = 0
        self.data_ended = False
        self._started = False
        self._schemas = {0}
        self._channels: set[int] = set()

    def fits(self, record: McapRecord, stream: BinaryIO) -> bool:
        """Whether a record makes sense behind those before it; the stream stands at its end."""
        if isinstance(record, Header) is self._started:
            return False
        self._started = True
        match record:
            case Message():
                known = record.channel_id in self._channels
                self.messages += known
                return known
            case Schema():
                self._schemas.add(record.id)
            case Channel():
                self._channels.add(record.id)
                return record.schema_id in self._schemas
            case Attachment():
                return _attached_whole(record, stream)
            case DataEnd():
                self.data_ended = True
        return True


def _attached_whole(attachment: Attachment, stream: BinaryIO) -> bool:
    """Whether an attachment just read is what was written; the reader passes its checksum over."""
    names = len(attachment.name.encode()) + len(attachment.media_type.encode())
    size = _ATTACHMENT_HEAD_BYTES + names + len(attachment.data)
    stream.seek(-size - _CRC_BYTES, os.SEEK_CUR)
    found, wanted = crc32(stream.read(size)), stream.read(_CRC_BYTES)
    return int.from_bytes(wanted, "little") in (0, found)


def summary_is_whole(footer: Footer, stream: BinaryIO) -> bool:
    """Whether the summary is what was written; the reader for streams does not look at it."""
    left = stream.seek(0, os.SEEK_END) - _MAGIC_BYTES - _CRC_BYTES - footer.summary_start
    if left < 0 or not footer.summary_crc:
        return left >= 0
    stream.seek(footer.summary_start)
    found = 0
    while left > 0 and (block := stream.read(min(left, _BLOCK_BYTES))):
        found = crc32(block, found)
        left -= len(block)
    return footer.summary_crc == found
