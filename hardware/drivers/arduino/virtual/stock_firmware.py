"""The published sketch, as a program of the virtual board.

The sketch reads one byte at a time. It turns one servo after the other, one degree at a time, and
reads nothing meanwhile.
"""

import re
from collections import deque
from collections.abc import Sequence

from hardware.drivers.arduino.firmware_profile import ArduinoFirmware
from hardware.loading.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class _Turn:
    """A turn of one servo by steps of one degree. `began` is the time of the first step [s]."""

    servo: int
    start: int
    goal: int
    began: float
    degree_time: float

    @property
    def end(self) -> float:
        """End of the turn [s]. The first step, of zero degrees, takes time too."""
        return self.began + self.degree_time * (abs(self.goal - self.start) + 1)

    def angle(self, now: float) -> int:
        steps = min(abs(self.goal - self.start), int((now - self.began) / self.degree_time))
        return _written(self.start + (steps if self.goal > self.start else -steps))


class StockSketch:
    """The published sketch, from its start to the next reset.

    Args:
        letters: Letters of the fields, in order.
        angles: Servo angles at the start [deg].
        firmware: Profile of the sketch.
        began: Time of the start [s].
    """

    held = None

    def __init__(
        self, letters: str, angles: Sequence[int], firmware: ArduinoFirmware, began: float
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
        """Number of bytes that would have overwritten memory."""
        return self._parser.overwritten

    def take(self, byte: int, now: float) -> None:
        """Receive a byte."""
        self.run(now)
        if len(self._ring) < self._firmware.ring:
            self._ring.append((now, byte))
        else:
            self.lost += 1

    def run(self, until: float) -> None:
        """Read from the buffer until a time [s]. A turning servo blocks reading."""
        while self._ring and self._free <= until:
            arrival, byte = self._ring.popleft()
            self._free = max(self._free, arrival)
            if field := self._parser.feed(byte):
                servo, goal = field
                began = self._free + self._firmware.turn_time
                turn = _Turn(servo, self._angles[servo], goal, began, self._firmware.unit_time)
                self._turn, self._free = turn, turn.end
                self._angles[servo] = _written(goal)

    def angles(self, now: float) -> tuple[float, ...]:
        """Return the servo angles that the pulses command [deg]."""
        angles = list(map(float, self._angles))
        if self._turn:
            angles[self._turn.servo] = float(self._turn.angle(now))
        return tuple(angles)

    def may_answer(self, byte: int) -> bool:
        """Return False, because the sketch sends nothing."""
        return False

    def next_output(self) -> float | None:
        """Return None, because the sketch sends nothing."""
        return None


def _written(value: int) -> int:
    """Return the angle that the Arduino Servo library reads back after writing a value.

    Values below 544 are degrees; larger values are microseconds.
    """
    if value >= 544:
        return (min(value, 2400) + 1 - 544) * 180 // (2400 - 544)
    return min(max(value, 0), 180)


class _Parser:
    """The parser of the sketch. Every field moves its servo as soon as its comma arrives.

    A letter selects the servo and the first digit. Any other byte counts as a digit. From the fifth
    digit on, the real sketch overwrites memory; this model only counts such digits.
    """

    def __init__(self, letters: str) -> None:
        self._letters = letters.encode("ascii")
        self._servo = self._digit = 0
        self._value = bytearray(b"000\0")
        self.overwritten = 0

    def feed(self, byte: int) -> tuple[int, int] | None:
        """Return the servo and value of the field that this byte completes, or None."""
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
    """Return the number that C's `atoi` reads: an optional sign, then digits."""
    number = re.match(rb"\s*[+-]?[0-9]+", text)
    return int(number[0]) if number else 0
