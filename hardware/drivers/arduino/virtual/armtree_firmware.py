"""The firmware of armtree, as a program of the virtual board. It models `armtree.c`.

`firmware/README.md` describes the protocol with every line and counter.
"""

import binascii
from collections.abc import Sequence

from .transmitter import Transmitter

ANGLE_MAX = 180  # [deg]
CYCLE_MS = 20  # period of the servo pulses [ms]
_CYCLE = CYCLE_MS / 1000  # [s]
_DEGREE = 256  # positions are in 1/256 deg, as in the firmware


class ArmtreeFirmware:
    """The firmware of armtree, from its start to the next reset.

    Args:
        letters: Letters of the fields of a frame, in order.
        boot_angles: Servo angles if the memory holds none [deg].
        held: Servo angles that the memory holds at the start [deg], or None.
        banner: First bytes of the first line that the firmware sends.
        out: Transmit buffer.
        began: Time of the start [s].
    """

    lost = 0  # it reads faster than bytes arrive, so none is lost

    def __init__(
        self,
        letters: str,
        boot_angles: Sequence[int],
        held: tuple[int, ...] | None,
        banner: bytes,
        out: Transmitter,
        began: float,
    ) -> None:
        self._letters, self._out, self._began = letters, out, began
        self._parser = _Parser(letters)
        self._positions = [angle * _DEGREE for angle in held or boot_angles]
        self._goals = list(self._positions)
        self._speeds = [0] * len(letters)  # [deg/s], 0 for no limit
        self._frames = self._sum = self._holds = self._cycles = 0
        self._acks = self._ack_due = self._status_due = False
        self._watchdog_ms = self._silence_ms = 0
        source = b"kept " if held else b"boot "
        out.put(b"\n" + banner + source + self._angles_text().encode("ascii"), began)

    @property
    def held(self) -> tuple[int, ...]:
        """Servo angles, rounded [deg]."""
        return tuple((position + _DEGREE // 2) // _DEGREE for position in self._positions)

    @property
    def refused(self) -> int:
        """Number of bytes that belong to no frame and no command."""
        return self._parser.refused

    def angles(self, now: float) -> tuple[float, ...]:
        """Return the servo angles that the pulses command [deg]."""
        self.run(now)
        return tuple(position / _DEGREE for position in self._positions)

    # Time ------------------------------------------------------------------------------------

    def run(self, until: float) -> None:
        """Run all pulse cycles until a time [s], and send lines when there is room."""
        self._skip(until)
        while (due := min(self._cycle(1), self._room())) <= until:
            if due == self._cycle(1):
                self._cycles += 1
                self._watch()
                self._step()
                self._skip(until)
            self._speak(due)

    def _skip(self, until: float) -> None:
        """Skip the cycles in which nothing changes."""
        if self._positions == self._goals and not self._watching:
            self._cycles = max(self._cycles, int((until - self._began) / _CYCLE) - 1)

    def _cycle(self, number: int) -> float:
        """Return the start time of a future cycle, counted from 1 [s]."""
        return self._began + (self._cycles + number) * _CYCLE

    @property
    def _watching(self) -> bool:
        return self._watchdog_ms > 0 and self._silence_ms <= self._watchdog_ms

    def _watch(self) -> None:
        if self._watching:
            self._silence_ms += CYCLE_MS
            if not self._watching:
                self._goals = list(self._positions)
                self._holds += 1
                self._status_due = True

    def _step(self) -> None:
        for servo, goal in enumerate(self._goals):
            step = goal - self._positions[servo]
            if speed := self._speeds[servo]:
                most = speed * _DEGREE * CYCLE_MS // 1000
                step = min(max(step, -most), most)
            self._positions[servo] += step

    # Received bytes --------------------------------------------------------------------------

    def take(self, byte: int, now: float) -> None:
        """Receive a byte."""
        self.run(now)
        text = self._parser.feed(byte)
        if text.endswith(b","):
            self._take_frame(text)
        elif text.endswith(b";"):
            self._take_command(text)
        elif text == b"?":
            self._silence_ms, self._status_due = 0, True
        self._speak(now)

    def _take_frame(self, text: bytes) -> None:
        angles = [int(field[1:]) for field in text.split(b",")[:-1]]
        self._goals = [angle * _DEGREE for angle in angles]
        self._sum = binascii.crc_hqx(bytes(angles), self._sum)
        self._frames += 1
        self._silence_ms, self._ack_due = 0, self._acks

    def _take_command(self, text: bytes) -> None:
        servo, name, value = self._letters.index(chr(text[0])), text[1:2], int(text[2:4])
        if name == b"V":
            self._speeds[servo] = value * 10
        elif name == b"W" and servo == 0:
            self._watchdog_ms = value * 100
        elif name == b"A" and servo == 0 and value <= 1:
            self._acks = bool(value)
        else:
            self._parser.refused += len(text)
            return
        self._silence_ms, self._status_due = 0, True

    # Sent lines ------------------------------------------------------------------------------

    def may_answer(self, byte: int) -> bool:
        """Return True if the program may send something when this byte arrives."""
        return byte in b";?" or (self._acks and byte == ord(","))

    def next_output(self) -> float | None:
        """Return the time of the next output if no byte arrives [s]; None for no output."""
        times = [self._room()] if self._ack_due or self._status_due else []
        if self._watching:
            times.append(self._cycle((self._watchdog_ms - self._silence_ms) // CYCLE_MS + 1))
        return min(times, default=None)

    def _room(self) -> float:
        """Return the time at which there is room for the next line [s]; inf if no line waits."""
        if self._ack_due:
            return self._out.room_at(len(self._ack()))
        return self._out.room_at(len(self._status())) if self._status_due else float("inf")

    def _speak(self, now: float) -> None:
        if self._ack_due:
            self._ack_due = not self._out.put(self._ack(), now)
        if self._status_due:
            self._status_due = not self._out.put(self._status(), now)

    def _ack(self) -> bytes:
        counts = f"{self._frames & 0xFFFF:04x},{self.refused & 0xFF:02x},{self.lost:02x}"
        return f"k{counts},{self._sum:04x}\n".encode("ascii")

    def _status(self) -> bytes:
        words = (
            f"status frames={self._frames & 0xFFFF:04x}",
            f"refused={self.refused & 0xFFFF:04x}",
            f"lost={self.lost:04x}",
            f"sum={self._sum:04x}",
            f"holds={self._holds & 0xFF:02x}",
            f"acks={self._acks:d}",
            f"watchdog_ms={self._watchdog_ms:04d}",
            "speeds=" + ",".join(f"{speed:03d}" for speed in self._speeds),
            f"at={self._angles_text()}",
        )
        return " ".join(words).encode("ascii")

    def _angles_text(self) -> str:
        fields = zip(self._letters, self.held, strict=True)
        return "".join(f"{letter}{angle:03d}," for letter, angle in fields) + "\n"


class _Parser:
    """The parser of the firmware. It accepts only whole frames and commands.

    A byte that does not fit drops the bytes before it, and may begin a new frame or command.
    """

    def __init__(self, letters: str) -> None:
        self._letters = letters.encode("ascii")
        self._text = b""
        self.refused = 0

    def feed(self, byte: int) -> bytes:
        """Return the frame, command or question mark that this byte completes, or nothing."""
        if not self._fits(byte):
            self.refused += len(self._text)
            self._text = b""
            if byte == ord("?"):
                return b"?"
            if not self._fits(byte):
                self.refused += 1
                return b""
        text, self._text = self._text + bytes([byte]), b""
        if byte == ord(";") or len(text) == 5 * len(self._letters):
            return text
        self._text = text
        return b""

    def _fits(self, byte: int) -> bool:
        """Return True if the byte can follow the previous bytes."""
        fields, place = divmod(len(self._text), 5)
        field = self._text[5 * fields :]
        if place == 0:
            return byte in self._letters if fields == 0 else byte == self._letters[fields]
        if place == 1 and fields == 0 and ord("A") <= byte <= ord("Z"):
            return True
        if place < 4:
            return ord("0") <= byte <= ord("9")
        if field[1:2].isupper():
            return byte == ord(";")
        fit = field[0] == self._letters[fields] and int(field[1:]) <= ANGLE_MAX
        return byte == ord(",") and fit
