"""Checks between the pieces of a journal: a message of MCAP has no checksum of its own.

Each piece that is written at once is followed by a record of an opcode that MCAP leaves to
applications, which readers pass over, with the CRC-32 of the piece. So of a journal that a crash
left nothing counts that is not as it was written.
"""

import struct
from typing import BinaryIO
from zlib import crc32

MAGIC = b"\x89MCAP0\r\n"

# Ends the name of the library in the head of a file that is still to be compacted.
UNFINISHED = ", checked journal"
_HALVES = UNFINISHED[:7].encode(), UNFINISHED[7:].encode()  # of which one may be damaged
_HEAD = 128  # of which the name is a part [bytes]

_RECORD, _CRC = struct.Struct("<BQ"), struct.Struct("<I")
_CHECK, _DATA_END, _FOOTER = 0x80, 0x0F, 0x02
_BLOCK = 1 << 20  # read at once [bytes]

# What a journal that ended well ends with: no checksum of the data, no summary.
END = _RECORD.pack(_DATA_END, 4) + bytes(4) + _RECORD.pack(_FOOTER, 20) + bytes(20) + MAGIC


def checked(piece: bytes) -> bytes:
    """A piece, and its check."""
    return piece + _RECORD.pack(_CHECK, _CRC.size) + _CRC.pack(crc32(piece))


def is_journal(stream: BinaryIO) -> bool:
    """Whether a file, which is at its beginning and is left there, is still to be compacted."""
    head = stream.read(_HEAD)
    stream.seek(0)
    return any(half in head for half in _HALVES)


def sound(stream: BinaryIO) -> int:
    """How much of a journal, which is at its beginning and is left there, is as it was written.

    Returns:
        Where the last piece ends of which, and of all before it, the check is right [bytes].
    """
    good = _sound(stream)
    stream.seek(0)
    return good


def _sound(stream: BinaryIO) -> int:
    good, crc = 0, crc32(stream.read(len(MAGIC)))
    while len(head := stream.read(_RECORD.size)) == _RECORD.size:
        opcode, left = _RECORD.unpack(head)
        if opcode == _CHECK:
            if left != _CRC.size or stream.read(left) != _CRC.pack(crc):
                break
            good, crc = stream.tell(), 0
            continue
        crc = crc32(head, crc)
        while left and (block := stream.read(min(left, _BLOCK))):
            crc, left = crc32(block, crc), left - len(block)
    stream.seek(good)
    return good + len(END) if stream.read(len(END) + 1) == END else good
