"""Streams of frames of which many are damaged, and what is in them."""

import binascii
import bisect
import itertools
import os
import random
import re
from collections import deque
from collections.abc import Iterator

from tests.avr.rig import BOOT, frame

# As many as a test of the suite has time for; `make damage` takes more.
CORRUPTIONS = int(os.environ.get("ARMTREE_CORRUPTIONS", "10000"))
# From the last comma of a frame until no pulse stands for the frame before [s]. A pulse cycle takes
# 0.02 s, and its widths are fixed 1 ms before it begins.
SHOWN = 0.05

_ANGLE = rb"(0\d\d|1[0-7]\d|180)"
_FRAME = re.compile(b"".join(letter + _ANGLE + b"," for letter in (b"b", b"s", b"e", b"g")))


def damaged(data: bytes, dice: random.Random) -> bytes:
    """A frame with something wrong."""
    where, length = dice.randrange(len(data)), dice.randrange(1, len(data))
    noise = dice.randbytes(dice.randrange(1, 30))
    return dice.choice(
        [
            data[:where],
            data[where:],
            data[:where] + data[where + length :],
            data[:where] + noise + data[where:],
            data[:where] + noise + data[where + len(noise) :],
            data[:where] + bytes([data[where] ^ 1 << dice.randrange(8)]) + data[where + 1 :],
            data[:where] + data[where : where + length] * 2 + data[where + length :],
            noise,
        ]
    )


def pieces(stream: bytes, dice: random.Random) -> Iterator[tuple[bytes, float]]:
    """The stream cut anywhere, each piece with the pause after it [s]."""
    start = 0
    while start < len(stream):
        length = dice.choice([1, 7, 30, 100, 1000])
        piece = stream[start : start + dice.randrange(1, length + 1)]
        start += len(piece)
        yield piece, dice.choice([0.0, 0.0, 0.0003, 0.003, 0.03])


def spelled(stream: bytes) -> list[tuple[int, ...]]:
    """The frames that are in a stream, by other means than a parser."""
    return [tuple(map(int, match.groups())) for match in _FRAME.finditer(stream)]


class Corruptions:
    """A stream in which every other frame is damaged, and what a board may do as it comes.

    Args:
        count: How many are damaged.
        seed: Of the damage.

    Attributes:
        stream: All of it.
        sent: The frames in it, found by other means than a parser; first, where the servos are.
        acknowledged: How many of them the board says it has.
    """

    def __init__(self, count: int, seed: int) -> None:
        dice = random.Random(seed)
        frames = (frame([dice.randrange(181) for _ in BOOT]) for _ in range(2 * count))
        self.stream = b"".join(
            damaged(data, dice) if number % 2 else data for number, data in enumerate(frames)
        )
        self.sent = [BOOT, *spelled(self.stream)]
        self._ends = [0, *(match.end() for match in _FRAME.finditer(self.stream))]
        angles = map(bytes, self.sent[1:])
        self._sums = list(
            itertools.accumulate(angles, lambda sum_, data: binascii.crc_hqx(data, sum_), initial=0)
        )
        self._bytes = 0
        self._counts = deque([(0.0, 0)])  # when how many frames had come
        self._unfinished, self.acknowledged = b"", 0

    def came(self, length: int, now: float) -> list[set[int]]:
        """Note that the next bytes have come by now [s].

        Returns:
            The angles that pulses may have stood for since the call before, for each servo [deg].
        """
        self._bytes += length
        counts = self._counts
        while len(counts) > 1 and counts[1][0] <= counts[-1][0] - SHOWN:
            counts.popleft()
        last = bisect.bisect_right(self._ends, self._bytes) - 1
        shown = self.sent[counts[0][1] : last + 1]
        counts.append((now, last))
        return [set(column) for column in zip(*shown, strict=True)]

    def heard(self, said: bytes) -> None:
        """Hold every acknowledgement against the frames it counts."""
        *lines, self._unfinished = (self._unfinished + said).split(b"\n")
        for line in lines:
            if line.startswith(b"k"):
                near = self._counts[-1][1]
                self.acknowledged = near - (near - int(line[1:5], 16)) % 0x10000
                assert int(line[-4:], 16) == self._sums[self.acknowledged], line
