"""The file format: marks of a file, and checksums between the pieces of a journal.

A journal is a recording that is still being written: an MCAP file without chunks. After every piece
follows a record with the CRC-32 of the piece. The record has an opcode that MCAP reserves for
applications, so every MCAP reader skips it.

MCAP's own checksums are not enough. A crash loses the checksum of the data section, because it is
at the end of the file. The checksum of a chunk does not cover the chunk's header, and notes have no
checksum. A test flipped 4000 single bits in a journal of 76 kB. With a chunk for every piece and
all of MCAP's checks, 59 flips were not noticed, and 13 changed the result of reading. With this
record, all flips were noticed.
"""

import struct
from typing import BinaryIO
from zlib import crc32

MAGIC = b"\x89MCAP0\r\n"

# Note in a finished recording: digests of its other content.
DIGESTS = "digests"

# Note in a recording that was made from an incomplete or damaged file.
RECOVERED = "recovered"

# Last part of the library's name in the header of a journal.
UNFINISHED = ", checked journal"
_HALVES = UNFINISHED[:7].encode(), UNFINISHED[7:].encode()  # one half may be damaged
_HEAD = 128  # number of first bytes, which contain the library's name

# Largest record [bytes]. The largest of armtree is an attachment of up to 64 MiB, a mesh. A sparse
# file may claim any length.
MAX_RECORD = 1 << 27

INVALID = 0x00  # no record has this opcode; a hole of a sparse file has only zeros

_RECORD, _CRC = struct.Struct("<BQ"), struct.Struct("<I")
_CHECK, _DATA_END, _FOOTER = 0x80, 0x0F, 0x02
_BLOCK = 1 << 20  # size of one read [bytes]

# End of a journal that was closed: no checksum of the data section, no summary.
END = _RECORD.pack(_DATA_END, 4) + bytes(4) + _RECORD.pack(_FOOTER, 20) + bytes(20) + MAGIC


def checked(piece: bytes) -> bytes:
    """Return a piece of a journal, followed by its checksum."""
    return piece + _RECORD.pack(_CHECK, _CRC.size) + _CRC.pack(crc32(piece))


def is_journal(stream: BinaryIO) -> bool:
    """Return True if a file is a journal.

    Args:
        stream: The file, positioned at its beginning; also afterwards.
    """
    head = stream.read(_HEAD)
    stream.seek(0)
    return any(half in head for half in _HALVES)


def valid_size(stream: BinaryIO) -> int:
    """Return the size of the valid part of a journal [bytes].

    The valid part ends before the first piece with a wrong checksum.

    Args:
        stream: The journal, positioned at its beginning; also afterwards.
    """
    good, crc = 0, crc32(stream.read(len(MAGIC)))
    while len(head := stream.read(_RECORD.size)) == _RECORD.size:
        opcode, left = _RECORD.unpack(head)
        if opcode == _CHECK:
            if left != _CRC.size or stream.read(left) != _CRC.pack(crc):
                break
            good, crc = stream.tell(), 0
            continue
        if opcode == INVALID or left > MAX_RECORD:
            break
        crc = crc32(head, crc)
        while left and (block := stream.read(min(left, _BLOCK))):
            crc, left = crc32(block, crc), left - len(block)
    stream.seek(good)
    size = good + len(END) if stream.read(len(END) + 1) == END else good
    stream.seek(0)
    return size
