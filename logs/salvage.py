"""The records of an MCAP file, up to where it is damaged."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO
from zlib import crc32

from .errors import RecordingError

_MAGIC = b"\x89MCAP0\r\n"
_CRC_BYTES = 4
_ATTACHMENT_HEAD_BYTES = 32  # two times of 8, the lengths of name, type (4 each) and data (8)
_BLOCK_BYTES = 65536


class Salvage:
    """Iterates over what is valid in a file, finished, live, cut off or damaged.

    Every checksum that the file has is checked. Reading is lazy, a chunk at a time.

    Attributes:
        path: The file.
        intact: After iterating, whether the file was complete and undamaged.
        valid: How much of the file the records given so far take, its head included [bytes].
    """

    def __init__(self, path: Path) -> None:
        """Looks at the first bytes only.

        Raises:
            RecordingError: There is no such file, or it never was an MCAP file.
        """
        self.path = path
        self.intact = False
        self.valid = 0
        try:
            with path.open("rb") as stream:
                head = stream.read(len(_MAGIC))
        except OSError as cause:
            reason = cause.strerror or str(cause)
            raise RecordingError(path, f"cannot be read ({reason}); check the path") from cause
        if not _MAGIC.startswith(head):
            raise RecordingError(path, "is not an MCAP file; give a recording, such as *.mcap")

    def __iter__(self) -> Iterator[Any]:
        """Gives the records in file order; ends at the first damage.

        Raises:
            OSError: The disk fails.
        """
        with self.path.open("rb") as stream:
            try:
                sense = _Sense()
                for record in self._records(stream):
                    if not sense.fits(record) or not _attached_whole(record, stream):
                        return
                    self.valid = stream.tell()
                    yield record
                self.intact = sense.data_ended and _summary_is_whole(record, stream)
            except OSError:
                raise
            except Exception:
                # Torn or damaged bytes surface as whatever the decoder stumbles over:
                # McapError, struct.error, ValueError, ZstdError, MemoryError and more.
                return

    @property
    def torn(self) -> int:
        """After iterating, how much at the end holds nothing valid [bytes]."""
        return 0 if self.intact else self.path.stat().st_size - self.valid

    def _records(self, stream: BinaryIO) -> Iterator[Any]:
        from mcap.stream_reader import StreamReader

        # A damaged length must not make the reader ask for gigabytes.
        limit = self.path.stat().st_size
        yield from StreamReader(stream, validate_crcs=True, record_size_limit=limit).records


def _attached_whole(record: Any, stream: BinaryIO) -> bool:
    """Whether an attachment just read is what was written; the reader passes its checksum over."""
    if type(record).__name__ != "Attachment":
        return True
    names = len(record.name.encode()) + len(record.media_type.encode())
    size = _ATTACHMENT_HEAD_BYTES + names + len(record.data)
    stream.seek(-size - _CRC_BYTES, os.SEEK_CUR)
    found, wanted = crc32(stream.read(size)), stream.read(_CRC_BYTES)
    return int.from_bytes(wanted, "little") in (0, found)


def _summary_is_whole(footer: Any, stream: BinaryIO) -> bool:
    """Whether the summary is what was written; the reader for streams does not look at it."""
    wanted: int = footer.summary_crc
    if footer.summary_start > stream.seek(0, os.SEEK_END):
        return False
    left = stream.seek(0, os.SEEK_END) - len(_MAGIC) - _CRC_BYTES - footer.summary_start
    stream.seek(footer.summary_start)
    found = 0
    while left > 0 and (block := stream.read(min(left, _BLOCK_BYTES))):
        found = crc32(block, found)
        left -= len(block)
    return wanted in (0, found)


class _Sense:
    """Tells records that cannot stand where they stand: damage that no checksum showed."""

    def __init__(self) -> None:
        self.data_ended = False
        self._started = False
        self._schemas = {0}
        self._channels: set[int] = set()

    def fits(self, record: Any) -> bool:
        kind = type(record).__name__
        if (kind == "Header") is self._started:
            return False
        self._started = True
        self.data_ended = self.data_ended or kind == "DataEnd"
        if kind == "Schema":
            self._schemas.add(record.id)
        elif kind == "Channel":
            self._channels.add(record.id)
            return record.schema_id in self._schemas
        elif kind == "Message":
            return record.channel_id in self._channels
        return True
