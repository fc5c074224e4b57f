"""The file format of recordings: magic bytes, names of notes, and checksums in a journal.

A journal is a recording that is still being written: an MCAP file without chunks. It consists of
pieces, each written in one step. After every piece follows a record with the CRC-32 of the piece.
This record has an opcode that MCAP reserves for applications, so every MCAP reader skips it.

MCAP's own checksums are not enough. A crash loses the checksum of the data section, because it is
at the end of the file. The checksum of a chunk does not cover the chunk's header, and notes have no
checksum. A test flipped 4000 single bits in a journal of 76 kB. With a chunk for every piece and
all of MCAP's checks, 59 flips were not found, and 13 of these changed the data that was read. With
the CRC-32 records, all flips were found.
"""

import struct
from typing import BinaryIO
from zlib import crc32

MAGIC = b"\x89MCAP0\r\n"

# Name of the note in a finished recording that has the digests of all other content.
DIGESTS = "digests"

# Name of the note in a recording that was made from an incomplete or damaged file.
RECOVERED = "recovered"

# Last part of the library's name in the header of a journal.
UNFINISHED = ", checked journal"
_HALVES = UNFINISHED[:7].encode(), UNFINISHED[7:].encode()  # one half is enough, if a bit flipped
_HEAD = 128  # number of first bytes, which contain the library's name

# Largest valid length of a record [bytes]. The largest record of armtree is an attachment of up to
# 64 MiB, a mesh. A damaged or sparse file may contain any length.
MAX_RECORD = 1 << 27

INVALID = 0x00  # opcode that no record has; a hole in a sparse file reads as zeros

_RECORD, _CRC = struct.Struct("<BQ"), struct.Struct("<I")
_CHECK, _DATA_END, _FOOTER = 0x80, 0x0F, 0x02
_BLOCK = 1 << 20  # size of one read [bytes]

# Last bytes of a closed journal: no checksum of the data section, no summary.
END = _RECORD.pack(_DATA_END, 4) + bytes(4) + _RECORD.pack(_FOOTER, 20) + bytes(20) + MAGIC


def checked(piece: bytes) -> bytes:
    """Return a piece of a journal, followed by its checksum."""
    return piece + _RECORD.pack(_CHECK, _CRC.size) + _CRC.pack(crc32(piece))


def is_journal(stream: BinaryIO) -> bool:
    """Return True if a file is a journal.

    Args:
        stream: The file at its beginning. The function returns with the stream there again.
    """
    head = stream.read(_HEAD)
    stream.seek(0)
    return any(half in head for half in _HALVES)


def valid_size(stream: BinaryIO) -> int:
    """Return the size of the valid part of a journal [bytes].

    The valid part ends before the first piece with a wrong checksum.

    Args:
        stream: The journal at its beginning. The function returns with the stream there again.
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
