"""The virtual board: a pure model from bytes and time to servo angles and bytes.

This file models the serial line and the boot. The program of the board is in `stock_firmware.py`
(the published sketch) or `armtree_firmware.py`. The model has no clock and does no I/O:
`drivers/virtual` puts it behind a pseudo-terminal, or behind a link in this process.
"""

from collections import deque
from collections.abc import Sequence
from typing import Protocol

from hardware.drivers.arduino.firmware_profile import ArduinoFirmware
from hardware.drivers.firmware_profile import Firmware
from hardware.link.link import BITS_PER_BYTE
from hardware.loading.dataclass import dataclass

from .armtree_firmware import ArmtreeFirmware
from .stock_firmware import StockSketch
from .transmitter import Transmitter


@dataclass(frozen=True, slots=True)
class BoardState:
    """The state of a board.

    Attributes:
        servos: Servo angles that the pulses command [deg].
        resets: Number of resets.
        lost: Number of bytes lost because the buffer was full or the board was booting.
        refused: Number of bytes that the parser dropped, or that would have overwritten memory.
    """

    servos: tuple[float, ...]
    resets: int
    lost: int
    refused: int


class Program(Protocol):
    """The program of the board, from its start to the next reset. Times [s] never decrease."""

    @property
    def held(self) -> tuple[int, ...] | None:
        """Servo angles that the program stores for the next start [deg], or None."""

    @property
    def lost(self) -> int:
        """Number of bytes lost because the buffer was full."""

    @property
    def refused(self) -> int:
        """Number of bytes that the parser dropped, or that would have overwritten memory."""

    def take(self, byte: int, now: float) -> None:
        """Receive a byte."""

    def run(self, until: float) -> None:
        """Run the board until a time [s]."""

    def angles(self, now: float) -> tuple[float, ...]:
        """Return the servo angles that the pulses command [deg]."""

    def may_answer(self, byte: int) -> bool:
        """Return True if the program may send something when this byte arrives."""

    def next_output(self) -> float | None:
        """Return the time of the next output if no byte arrives [s]; None for no output."""


class Board:
    """An Arduino with its program. The caller passes the time [s], which never decreases.

    The board is switched on at time 0, and its program starts at once. After a reset, the board
    boots before its program starts.

    Args:
        letters: Letters of the fields of a frame, in order.
        boot_angles: Servo angles after switching on [deg].
        firmware: Firmware of the board.
        baud: Speed of the line [bit/s].
    """

    def __init__(
        self, letters: str, boot_angles: Sequence[int], firmware: Firmware, baud: int
    ) -> None:
        assert isinstance(firmware, ArduinoFirmware)
        self._letters, self._boot_angles = letters, tuple(boot_angles)
        self._firmware = firmware
        self._byte_time = BITS_PER_BYTE / baud
        self._out = Transmitter(self._byte_time)
        self._resets = self._lost = self._refused = 0
        self._line, self._line_free = deque[tuple[float, int]](), 0.0
        self._angles_at_reset = tuple(map(float, boot_angles))
        self._start(0.0, None)

    def open(self, now: float) -> None:
        """Reset the board, because a program has opened the port. Earlier bytes are lost."""
        self.reset(now)
        self.read_output(now)

    def reset(self, now: float) -> None:
        """Reset the board. Unread bytes are lost, and the servos do not move until it has booted.

        After the boot, the servos jump to the boot angles, unless the program has stored others.
        """
        self.cut_off(now)
        self._resets += 1
        self._lost, self._refused = self._counts()
        self._angles_at_reset = self._angles(now)
        self._out.cut(now)
        self._start(now + self._firmware.boot_time, self._program.held)

    def _start(self, ready: float, held: tuple[int, ...] | None) -> None:
        self._ready = ready
        firmware = self._firmware
        self._program: Program
        if firmware.unit_time:
            angles = held or self._boot_angles
            self._program = StockSketch(self._letters, angles, firmware, ready)
        else:
            self._program = ArmtreeFirmware(
                self._letters, self._boot_angles, held, firmware.banner, self._out, ready
            )

    def receive(self, data: bytes, now: float) -> None:
        """Put bytes on the line. They arrive one by one, at the speed of the line."""
        self.advance(now)
        for byte in data:
            self._line_free = max(self._line_free, now) + self._byte_time
            self._line.append((self._line_free, byte))

    def cut_off(self, now: float) -> None:
        """Drop the bytes that have not arrived."""
        self.advance(now)
        self._line, self._line_free = deque(), now

    def state(self, now: float) -> BoardState:
        """Return the state of the board."""
        self.advance(now)
        lost, refused = self._counts()
        return BoardState(self._angles(now), self._resets, lost, refused)

    def read_output(self, now: float) -> bytes:
        """Return the lines that the board has sent by now, and remove them."""
        self.advance(now)
        return self._out.sent(now)

    def next_output(self) -> float | None:
        """Return the time of the next output if no byte is received [s]; None for no output."""
        questions = (
            arrival
            for arrival, byte in self._line
            if arrival >= self._ready and self._program.may_answer(byte)
        )
        times = (self._out.next(), self._program.next_output(), next(questions, None))
        return min((time for time in times if time is not None), default=None)

    def advance(self, now: float) -> None:
        """Run the board until a time [s]."""
        while self._line and self._line[0][0] <= now:
            arrival, byte = self._line.popleft()
            if arrival < self._ready:
                self._lost += 1
            else:
                self._program.take(byte, arrival)
        self._program.run(now)

    def _counts(self) -> tuple[int, int]:
        """Return the bytes lost and refused since the board was switched on."""
        return self._lost + self._program.lost, self._refused + self._program.refused

    def _angles(self, now: float) -> tuple[float, ...]:
        return self._program.angles(now) if now >= self._ready else self._angles_at_reset
