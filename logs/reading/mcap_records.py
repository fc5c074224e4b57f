"""Decodes MCAP records of any program, with memory and time bounded by the size of the file.

The mcap library does not check claimed sizes: it unpacks a chunk to any size, and reads any length.
"""

from collections.abc import Callable, Iterator
from functools import cache
from io import BytesIO
from struct import Struct, error
from typing import TYPE_CHECKING, Any
from zlib import crc32

from logs.records.file_format import INVALID

if TYPE_CHECKING:
    from mcap.records import Attachment, Chunk, Message

HEAD = Struct("<BQ")  # opcode, and number of following bytes
_MESSAGE_HEAD = Struct("<HIQQ")  # channel, sequence, two times
_CRC_BYTES = 4

# Largest unpacked size of one chunk [bytes]. armtree writes 256 kB plus one message. The message of
# the longest motion, 10 minutes, has about 10 MB.
_CHUNK_LIMIT = 32 << 20

# Largest total size of the chunks that were unpacked so far: a constant, plus a number of bytes per
# byte of the file up to that place. A repeated log line of 10 kB compresses to a thousandth.
_UNPACKED_LIMIT, _UNPACKED_PER_BYTE = 16 << 20, 1000

# Largest number of records in the chunks that were unpacked so far: this constant, plus one per
# byte of the file. Even records that differ only in time and number take several bytes each.
_RECORDS_LIMIT = 10_000

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _ATTACHMENT = 0x03, 0x04, 0x05, 0x06, 0x09


class BadRecord(Exception):
    """The bytes are not a valid record."""


@cache
def damage(*more: type[Exception]) -> tuple[type[Exception], ...]:
    """Return the exceptions that damaged bytes may cause."""
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    # lz4 and an unknown compression raise the last three.
    unpacking = (ZstdError, RuntimeError, MemoryError, KeyError)
    return BadRecord, McapError, error, ValueError, ArithmeticError, *unpacking, *more


class Decoder:
    """Decodes the records of one file, in file order."""

    def __init__(self) -> None:
        from mcap import data_stream, records as mcap

        self._stream = data_stream.ReadDataStream
        self._kinds: dict[int, Callable[[Any], Any]] = {
            0x01: mcap.Header.read,
            0x02: mcap.Footer.read,
            _SCHEMA: mcap.Schema.read,
            _CHANNEL: mcap.Channel.read,
            _CHUNK: mcap.Chunk.read,
            _ATTACHMENT: mcap.Attachment.read,
            0x0C: mcap.Metadata.read,
            0x0F: mcap.DataEnd.read,
        }
        self._message = mcap.Message
        self._unpacked = self._records = 0

    def records(self, opcode: int, body: bytes, place: int) -> Iterator[Any]:
        """Yield the decoded record. For a chunk, yield the records in the chunk.

        Yields nothing for indexes, and for opcodes that MCAP reserves for applications.

        Args:
            opcode: Opcode of the record.
            body: Bytes of the record after its opcode and length.
            place: Offset of the end of the record in the file [bytes].

        Raises:
            BadRecord: The record is invalid, or its unpacked size is too large. The method may also
                raise the exceptions of `damage`.
        """
        if opcode == _CHUNK:
            yield from self._in_chunk(self.unpacked_chunk(body, place), place)
        elif opcode == _ATTACHMENT:
            yield _checked(self._decoded(opcode, body), body)
        elif opcode == _MESSAGE or opcode in self._kinds:
            yield self._decoded(opcode, body)
        elif opcode == INVALID:
            raise BadRecord("opcode 0")

    def unpacked_chunk(self, body: bytes, place: int) -> bytes:
        """Return the unpacked records of a chunk. Arguments and errors are those of `records`."""
        chunk: Chunk = self._decoded(_CHUNK, body)
        self._unpacked += chunk.uncompressed_size
        if self._unpacked > _UNPACKED_LIMIT + _UNPACKED_PER_BYTE * place:
            raise BadRecord(
                f"{self._unpacked} unpacked bytes are too many for {place} bytes of the file"
            )
        return _unpacked(chunk)

    def message_at(self, data: bytes, at: int, place: int) -> "Message":
        """Return the message at an offset in an unpacked chunk.

        Args:
            data: The unpacked chunk.
            at: Offset of the message in `data` [bytes].
            place: Offset of the end of the chunk in the file [bytes].

        Raises:
            BadRecord: There is no message at the offset, or the chunks have too many records.
        """
        opcode, body = self._record_in(data, at, place)
        if opcode != _MESSAGE:
            raise BadRecord(f"opcode {opcode} where the index has a message")
        message: Message = self._decoded(opcode, body)
        return message

    def _decoded(self, opcode: int, body: bytes | memoryview) -> Any:
        if opcode == _MESSAGE:
            channel, sequence, time, published = _MESSAGE_HEAD.unpack_from(body)
            data = bytes(memoryview(body)[_MESSAGE_HEAD.size :])
            return self._message(channel, time, data, published, sequence)
        return self._kinds[opcode](self._stream(_Body(body)))

    def _in_chunk(self, data: bytes, place: int) -> Iterator[Any]:
        at = 0
        while at < len(data):
            opcode, body = self._record_in(data, at, place)
            if opcode not in (_MESSAGE, _CHANNEL, _SCHEMA):
                raise BadRecord(f"opcode {opcode} in a chunk")
            yield self._decoded(opcode, body)
            at += HEAD.size + len(body)

    def _record_in(self, data: bytes, at: int, place: int) -> tuple[int, memoryview]:
        """Return the opcode and the body of the record at offset `at` in an unpacked chunk.

        The body is a view: to copy megabytes holds up all other threads.
        """
        self._records += 1
        if self._records > _RECORDS_LIMIT + place:
            raise BadRecord(f"{self._records} records are too many for {place} bytes of the file")
        opcode, length = HEAD.unpack_from(data, at)
        at += HEAD.size
        body = memoryview(data)[at : at + length]
        if len(body) < length:
            raise BadRecord(f"a record of {length} bytes exceeds the end of its chunk")
        return opcode, body


class _Body(BytesIO):
    """Stream over the bytes of one record. A read beyond the end raises BadRecord."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Return exactly `size` bytes."""
        data = super().read(size)
        if len(data) != size:
            raise BadRecord(f"a record that ends after {len(data)} of {size} bytes")
        return data


def _checked(attachment: "Attachment", body: bytes) -> "Attachment":
    """Return an attachment after checking its checksum, because mcap does not check it."""
    expected = int.from_bytes(body[-_CRC_BYTES:], "little")
    if expected not in (0, crc32(body[:-_CRC_BYTES])):
        raise BadRecord("wrong checksum of an attachment")
    return attachment


def _unpacked(chunk: "Chunk") -> bytes:
    size = chunk.uncompressed_size
    if size > _CHUNK_LIMIT:
        raise BadRecord(f"a chunk of {size} bytes")
    data = _UNPACK[chunk.compression](chunk.data, size)
    if len(data) != size or chunk.uncompressed_crc not in (0, crc32(data)):
        raise BadRecord("wrong checksum of a chunk")
    return data


def _unpack_zstd(data: bytes, size: int) -> bytes:
    import zstandard

    # The library would allocate the claimed size of the frame, even above the limit.
    claimed = zstandard.get_frame_parameters(data).content_size
    if claimed not in (size, zstandard.CONTENTSIZE_UNKNOWN):
        raise BadRecord(f"a frame of {claimed} bytes in a chunk of {size}")
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)


def _unpack_lz4(data: bytes, size: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    return bytes(LZ4FrameDecompressor().decompress(data, max_length=size))


_UNPACK: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda data, size: data,
    "zstd": _unpack_zstd,
    "lz4": _unpack_lz4,
}
