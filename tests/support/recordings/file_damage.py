"""Recordings of which the end was cut off, or a bit flipped, and how that is met."""

import contextlib
import struct
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode

import logs
from logs.reading.tolerant_reader import TolerantReader

Content = tuple[str, int, bytes]  # of a message: topic, time, data

MAGIC = 8  # bytes at the beginning of a file; without them it is not a recording
FOOTER_BYTES = 37  # and the magic behind it
_CHECK = 0x80  # opcode of the check behind every piece of a journal


class Damage(NamedTuple):
    """A file of which the end was cut off, or one bit flipped."""

    name: str
    cut: int
    bit: int = -1

    def of(self, data: bytes) -> bytes:
        """The damaged file."""
        damaged = bytearray(data[: self.cut])
        if self.bit >= 0:
            damaged[self.bit // 8] ^= 1 << self.bit % 8
        return bytes(damaged)

    @property
    def begins(self) -> int:
        """How much of the file is as it was [bytes]."""
        return self.cut if self.bit < 0 else self.bit // 8


# Of each file, its bytes, and its messages with where each of them ends [bytes].
_FILES: dict[str, tuple[bytes, list[tuple[int, Content]]]] = {}


def take(files: dict[str, bytes]) -> None:
    """Have files, by name, of which damages are then met."""
    for name, data in files.items():
        with _file_of(data) as path:
            reader = TolerantReader(path)
            ends = [reader.valid for record in reader if type(record).__name__ == "Message"]
            wholes = piece_ends(data) or ends  # of the pieces they are in
            _FILES[name] = data, list(zip(wholes, _read(path)[0], strict=True))


def piece_ends(journal: bytes) -> list[int]:
    """Of each message of a journal, where the check of its piece ends; nothing of other files."""
    place, waiting, ends = MAGIC, 0, list[int]()
    while place < len(journal) - MAGIC:
        opcode, length = struct.unpack_from("<BQ", journal, place)
        place += 9 + length
        waiting += opcode == Opcode.MESSAGE
        if opcode == _CHECK:
            ends += [place] * waiting
            waiting = 0
    return ends


def failure(damage: Damage) -> str:
    """What is wrong with how damage is met: by an exception, late, unseen, altered, at a loss."""
    data, messages = _FILES[damage.name]
    wanted = [content for end, content in messages if end <= damage.begins]
    begun = time.monotonic()
    try:
        with _file_of(damage.of(data)) as path:
            found, seen = _read(path)
            logs.recover(path)
            kept, unseen = _read(path)
    except Exception as error:
        unread = isinstance(error, logs.RecordingError) and damage.begins < MAGIC
        return "" if unread else f"{damage}: {error!r}"
    if time.monotonic() - begun > 5.0:
        return f"{damage}: slow"
    if found != [content for _, content in messages[: len(found)]]:
        return f"{damage}: read {len(found)} messages, of which some are altered"
    if len(found) < len(wanted):
        return f"{damage}: read {len(found)} messages of {len(wanted)}"
    if kept != found or unseen:
        return f"{damage}: recovered {len(kept)} of {len(found)} messages"
    return "" if seen else f"{damage}: unseen"


@contextlib.contextmanager
def _file_of(data: bytes) -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        path = Path(folder) / "x.mcap"
        path.write_bytes(data)
        yield path


def _read(path: Path) -> tuple[list[Content], bool]:
    """All messages, and whether the file is damaged."""
    found = []
    try:
        for message in logs.read(path):
            found.append((message.topic, message.time_ns, message.cdr))
    except logs.RecordingTruncated:
        return found, True
    return found, False
