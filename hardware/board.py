"""The board as a pure model: bytes and time in, servo angles and bytes out.

It boots, paces the line, parses and moves servos the way the firmware of its profile does. It
holds no clock and does no I/O; `virtual_arduino` puts it behind a pseudo-terminal and `board_link`
behind an in-process link.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from .profiles import Firmware

BITS_PER_BYTE = 10  # 8N1: start bit, eight data bits, stop bit
# 0.12 s for 60 degrees, as data sheets of hobby servos give it at 4.8 V.
SERVO_SPEED = 500.0  # [deg/s]


@dataclass(frozen=True, slots=True)
class BoardState:
    """What the board is doing.

    Attributes:
        servos: Servo angles now [deg].
        resets: How often it was reset.
        lost: Bytes that found the ring full or nobody at home.
        refused: Bytes that the parser dropped, or that would have overwritten memory.
    """

    servos: tuple[float, ...]
    resets: int
    lost: int
    refused: int


@dataclass(frozen=True, slots=True)
class _Turn:
    """A servo on its way at constant speed."""

    start: float
    goal: float
    began: float
    speed: float

    def angle(self, now: float) -> float:
        travel = min(abs(self.goal - self.start), max(0.0, now - self.began) * self.speed)
        return self.start + (travel if self.goal > self.start else -travel)


class Board:
    """An Arduino with its firmware and its servos. Times are the caller's [s], never backwards.

    Args:
        letters: The fields of a frame, in order.
        boot_angles: Where a reset puts the servos [deg].
        firmware: What it runs.
        baud: Speed of its line [bit/s].
    """

    def __init__(
        self, letters: str, boot_angles: Sequence[int], firmware: Firmware, baud: int
    ) -> None:
        self._boot_angles = tuple(boot_angles)
        self._firmware = firmware
        self._byte_time = BITS_PER_BYTE / baud
        self._resets = self._lost = self._refused = 0
        self._letters = letters
        self._boot(0.0)

    def reset(self, now: float) -> None:
        """Press the reset button: unread bytes are gone.

        The servos snap to the boot angles, unless the firmware keeps what it holds.
        """
        self.advance(now)
        self._resets += 1
        self._refused += self._parser.refused
        self._boot(now)

    def _boot(self, now: float) -> None:
        self._ready = now + self._firmware.boot_time
        keeps = bool(self._resets and self._firmware.banner)
        if not keeps:
            self._turns = [_Turn(a, a, now, SERVO_SPEED) for a in map(float, self._boot_angles)]
        self._wire: deque[tuple[float, int]] = deque()
        self._ring: deque[tuple[float, int]] = deque()
        self._line_free = self._free = now
        self._says: deque[tuple[float, bytes]] = deque()
        if self._firmware.banner:
            self._says.append((self._ready, self._banner(b"kept " if keeps else b"boot ")))
        blocking = self._firmware.degree_time > 0
        self._parser = _Stock(self._letters) if blocking else _Strict(self._letters)

    def _banner(self, which: bytes) -> bytes:
        turns = zip(self._letters, self._turns, strict=True)
        held = "".join(f"{letter}{turn.goal:03.0f}," for letter, turn in turns)
        return self._firmware.banner + which + held.encode("ascii") + b"\n"

    def receive(self, data: bytes, now: float) -> None:
        """Put bytes on the line; they arrive one by one at its speed."""
        self.advance(now)
        for byte in data:
            self._line_free = max(self._line_free, now) + self._byte_time
            self._wire.append((self._line_free, byte))

    def state(self, now: float) -> BoardState:
        """What the board is doing now."""
        self.advance(now)
        angles = tuple(turn.angle(now) for turn in self._turns)
        refused = self._refused + self._parser.refused
        return BoardState(angles, self._resets, self._lost, refused)

    def says(self, now: float) -> bytes:
        """Take what the board has sent by now."""
        self.advance(now)
        data = b""
        while self._says and self._says[0][0] <= now:
            data += self._says.popleft()[1]
        return data

    def says_next(self) -> float | None:
        """When it will send something; None if it has nothing to say."""
        return self._says[0][0] if self._says else None

    def advance(self, now: float) -> None:
        """Let the board work through everything that happened until now."""
        while self._wire and self._wire[0][0] <= now:
            arrival, byte = self._wire.popleft()
            self._work(arrival)
            if arrival < self._ready or len(self._ring) >= self._firmware.ring:
                self._lost += 1
            else:
                self._ring.append((arrival, byte))
        self._work(now)

    def _work(self, until: float) -> None:
        """Read the ring for as long as no servo keeps the board from it."""
        while self._ring and self._free <= until:
            arrival, byte = self._ring.popleft()
            self._free = max(self._free, arrival)
            for servo, value in self._parser.feed(byte):
                self._turn(servo, value)

    def _turn(self, servo: int, value: int) -> None:
        start, blocked = self._turns[servo].angle(self._free), self._firmware.degree_time
        if not blocked:
            self._turns[servo] = _Turn(start, float(value), self._free, SERVO_SPEED)
            return
        self._turns[servo] = _Turn(start, _servo_write(value), self._free, 1 / blocked)
        self._free += blocked * (abs(value - round(start)) + 1)


def _servo_write(value: int) -> float:
    """What the Arduino Servo library makes of a value: degrees, or from 544 on microseconds."""
    if value >= 544:
        return float((min(value, 2400) - 544) * 180 // (2400 - 544))
    return float(min(max(value, 0), 180))


class _Stock:
    """The published sketch's parser: every field moves its servo as soon as its comma comes.

    A letter selects the servo and the first digit; any other byte is taken for a digit, and from
    the fourth on the real sketch overwrites memory, which is only counted here.
    """

    def __init__(self, letters: str) -> None:
        self._letters = letters.encode("ascii")
        self._servo = self._digit = 0
        self._value = bytearray(b"000\0")
        self.refused = 0

    def feed(self, byte: int) -> list[tuple[int, int]]:
        """The servo and value that this byte sets in motion, if any."""
        if byte in self._letters:
            self._servo, self._digit = self._letters.index(byte), 0
        elif byte == ord(","):
            value, self._value = _atoi(self._value), bytearray(b"000\0")
            return [(self._servo, value)]
        elif self._digit < len(self._value):
            self._value[self._digit] = byte
            self._digit += 1
        else:
            self.refused += 1
        return []


def _atoi(text: bytes | bytearray) -> int:
    """C's atoi: an optional sign, then digits up to the first other byte."""
    body = text.lstrip(b" \t\n\v\f\r")
    sign = -1 if body[:1] == b"-" else 1
    digits = body[1:] if body[:1] in (b"-", b"+") else body
    value = 0
    for byte in digits:
        if not ord("0") <= byte <= ord("9"):
            break
        value = value * 10 + byte - ord("0")
    return sign * value


class _Strict:
    """Our parser: a frame counts whole or not at all, and the next one starts at its letter."""

    def __init__(self, letters: str) -> None:
        self._shape = "".join(f"{letter}ddd," for letter in letters).encode("ascii")
        self._frame = bytearray()
        self.refused = 0

    def feed(self, byte: int) -> list[tuple[int, int]]:
        """The servos and values of a frame that this byte completes."""
        expected = self._shape[len(self._frame)]
        digit = ord("0") <= byte <= ord("9")
        if digit if expected == ord("d") else byte == expected:
            self._frame.append(byte)
        else:
            self.refused += len(self._frame) + (byte != self._shape[0])
            self._frame = bytearray([byte] if byte == self._shape[0] else [])
        if len(self._frame) < len(self._shape):
            return []
        values = [int(self._frame[i + 1 : i + 4]) for i in range(0, len(self._frame), 5)]
        self._frame.clear()
        if max(values) > 180:
            self.refused += len(self._shape)
            return []
        return list(enumerate(values))
