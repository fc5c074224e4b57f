"""The published sketch, as a program of the modelled board.

It reads one byte at a time, turns one servo after the other by a degree at a time, and reads
nothing meanwhile.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from hardware.drivers.firmware import Firmware


@dataclass(frozen=True, slots=True)
class _Turn:
    """A servo on its way, a degree at a time, from when its first step is written [s]."""

    servo: int
    start: int
    goal: int
    began: float
    degree_time: float

    @property
    def end(self) -> float:
        """The first step, of zero degrees, takes its time, too."""
        return self.began + self.degree_time * (abs(self.goal - self.start) + 1)

    def angle(self, now: float) -> int:
        steps = min(abs(self.goal - self.start), int((now - self.began) / self.degree_time))
        return _written(self.start + (steps if self.goal > self.start else -steps))


class StockSketch:
    """The published sketch from a start to the next reset.

    Args:
        letters: The fields of a frame, in order.
        angles: Where it puts the servos when it starts [deg].
        firmware: Its times, and how many unread bytes it can hold.
        began: When it starts [s].
    """

    held = None

    def __init__(
        self, letters: str, angles: Sequence[int], firmware: Firmware, began: float
    ) -> None:
        self.lost = 0
        self._firmware = firmware
        self._parser = _Parser(letters)
        self._ring = deque[tuple[float, int]]()
        self._angles = list(angles)
        self._turn: _Turn | None = None
        self._free = began

    @property
    def refused(self) -> int:
        """Bytes that would have overwritten memory."""
        return self._parser.overwritten

    def take(self, byte: int, now: float) -> None:
        """Receive a byte."""
        self.run(now)
        if len(self._ring) < self._firmware.ring:
            self._ring.append((now, byte))
        else:
            self.lost += 1

    def run(self, until: float) -> None:
        """Read the ring for as long as no servo keeps the board from it."""
        while self._ring and self._free <= until:
            arrival, byte = self._ring.popleft()
            self._free = max(self._free, arrival)
            if field := self._parser.feed(byte):
                servo, goal = field
                began, pace = self._free + self._firmware.turn_time, self._firmware.degree_time
                turn = _Turn(servo, self._angles[servo], goal, began, pace)
                self._turn, self._free = turn, turn.end
                self._angles[servo] = _written(goal)

    def angles(self, now: float) -> tuple[float, ...]:
        """What the pulses tell the servos [deg]."""
        angles = list(map(float, self._angles))
        if self._turn:
            angles[self._turn.servo] = float(self._turn.angle(now))
        return tuple(angles)

    def answers(self, byte: int) -> bool:
        """It never says a word."""
        return False

    def speaks(self) -> float | None:
        """It never says a word."""
        return None


def _written(value: int) -> int:
    """What the Arduino Servo library reads after a value was written.

    Values are degrees, or from 544 on microseconds.
    """
    if value >= 544:
        return (min(value, 2400) + 1 - 544) * 180 // (2400 - 544)
    return min(max(value, 0), 180)


class _Parser:
    """Every field moves its servo as soon as its comma comes.

    A letter selects the servo and the first digit; any other byte is taken for a digit, and from
    the fifth on the real sketch overwrites memory, which is only counted here.
    """

    def __init__(self, letters: str) -> None:
        self._letters = letters.encode("ascii")
        self._servo = self._digit = 0
        self._value = bytearray(b"000\0")
        self.overwritten = 0

    def feed(self, byte: int) -> tuple[int, int] | None:
        """The servo and value that this byte sets in motion, if any."""
        if byte in self._letters:
            self._servo, self._digit = self._letters.index(byte), 0
        elif byte == ord(","):
            value, self._value = _atoi(self._value), bytearray(b"000\0")
            return self._servo, value
        elif self._digit < len(self._value):
            self._value[self._digit] = byte
            self._digit += 1
        else:
            self.overwritten += 1
        return None


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
