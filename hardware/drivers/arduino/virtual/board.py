"""The board as a pure model: bytes and time in, servo angles and bytes out.

Here are its line and its boot; the program it runs is in `stock` (the published sketch) or
`armtree` (our firmware). It holds no clock and does no I/O; `arduino` puts it behind
a pseudo-terminal and `link` behind an in-process link.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from hardware.drivers.firmware import Firmware
from hardware.link.link import BITS_PER_BYTE

from .armtree import ArmtreeFirmware
from .stock import StockSketch
from .transmitter import Transmitter


@dataclass(frozen=True, slots=True)
class BoardState:
    """What the board is doing.

    Attributes:
        servos: Angles that the pulses tell the servos now [deg].
        resets: How often it was reset.
        lost: Bytes that found the ring full or nobody at home.
        refused: Bytes that the parser dropped, or that would have overwritten memory.
    """

    servos: tuple[float, ...]
    resets: int
    lost: int
    refused: int


class Program(Protocol):
    """What runs on the board, from a start to the next reset. Times [s] never go backwards."""

    @property
    def held(self) -> tuple[int, ...] | None:
        """Angles that it leaves in memory for the next start [deg]; None if it forgets them."""

    @property
    def lost(self) -> int:
        """Bytes that found its ring full."""

    @property
    def refused(self) -> int:
        """Bytes that its parser dropped, or that would have overwritten memory."""

    def take(self, byte: int, now: float) -> None:
        """Receive a byte."""

    def run(self, until: float) -> None:
        """Do all that is due by then."""

    def angles(self, now: float) -> tuple[float, ...]:
        """What the pulses tell the servos [deg]."""

    def answers(self, byte: int) -> bool:
        """Whether it may say something when this byte comes."""

    def speaks(self) -> float | None:
        """When it will say something if nothing comes; None for never."""


class Board:
    """An Arduino with its program. Times are the caller's [s], never backwards.

    It is switched on at 0, where no boot loader waits; a reset is followed by the boot time.

    Args:
        letters: The fields of a frame, in order.
        boot_angles: Where switching on puts the servos [deg].
        firmware: What it runs.
        baud: Speed of its line [bit/s].
    """

    def __init__(
        self, letters: str, boot_angles: Sequence[int], firmware: Firmware, baud: int
    ) -> None:
        self._letters, self._boot_angles = letters, tuple(boot_angles)
        self._firmware = firmware
        self._byte_time = BITS_PER_BYTE / baud
        self._out = Transmitter(self._byte_time)
        self._resets = self._lost = self._refused = 0
        self._line, self._line_free = deque[tuple[float, int]](), 0.0
        self._rests = tuple(map(float, boot_angles))
        self._start(0.0, None)

    def reset(self, now: float) -> None:
        """Press the reset button: unread bytes are gone, and the servos rest until it has booted.

        Then the servos snap to the boot angles, unless the program keeps those it holds.
        """
        self.cut_off(now)
        self._resets += 1
        self._lost, self._refused = self._counts()
        self._rests = self._angles(now)
        self._out.cut(now)
        self._start(now + self._firmware.boot_time, self._program.held)

    def _start(self, ready: float, held: tuple[int, ...] | None) -> None:
        self._ready = ready
        firmware = self._firmware
        self._program: Program
        if firmware.degree_time:
            angles = held or self._boot_angles
            self._program = StockSketch(self._letters, angles, firmware, ready)
        else:
            self._program = ArmtreeFirmware(
                self._letters, self._boot_angles, held, firmware.banner, self._out, ready
            )

    def receive(self, data: bytes, now: float) -> None:
        """Put bytes on the line; they arrive one by one at its speed."""
        self.advance(now)
        for byte in data:
            self._line_free = max(self._line_free, now) + self._byte_time
            self._line.append((self._line_free, byte))

    def cut_off(self, now: float) -> None:
        """Forget the bytes that have not arrived."""
        self.advance(now)
        self._line, self._line_free = deque(), now

    def state(self, now: float) -> BoardState:
        """What the board is doing now."""
        self.advance(now)
        lost, refused = self._counts()
        return BoardState(self._angles(now), self._resets, lost, refused)

    def says(self, now: float) -> bytes:
        """Take the lines that the board has sent by now."""
        self.advance(now)
        return self._out.sent(now)

    def says_next(self) -> float | None:
        """When there is something to take or to look for again, if nothing more is received.

        None if there is nothing to come.
        """
        heard = (when for when, byte in self._line if self._hears(when, byte))
        times = (self._out.next(), self._program.speaks(), next(heard, None))
        return min((time for time in times if time is not None), default=None)

    def _hears(self, when: float, byte: int) -> bool:
        return when >= self._ready and self._program.answers(byte)

    def advance(self, now: float) -> None:
        """Let the board work through everything that happened until now."""
        while self._line and self._line[0][0] <= now:
            arrival, byte = self._line.popleft()
            if arrival < self._ready:
                self._lost += 1
            else:
                self._program.take(byte, arrival)
        self._program.run(now)

    def _counts(self) -> tuple[int, int]:
        """Bytes lost and refused since it was switched on."""
        return self._lost + self._program.lost, self._refused + self._program.refused

    def _angles(self, now: float) -> tuple[float, ...]:
        return self._program.angles(now) if now >= self._ready else self._rests
