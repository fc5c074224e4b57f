"""Builds what runs AVR code, and drives it: ours, and the published sketch's behaviour."""

import binascii
import functools
import json
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hardware import RealClock
from hardware.drivers.arduino.virtual.board import BoardState
from tests.support.paths import FIRMWARE

HERE = Path(__file__).parent
SIMAVR = Path("/usr/include/simavr")
AVR_GCC = "5.4.0"  # which the committed .hex is from
PATIENCE = 60.0  # longer than anything here takes [s]
BAUD = 115200
BOOT = (90, 90, 90, 0)
TASKS = {0: (90, 90, 90, 80), 1: (9, 125, 85, 0), 2: (0, 90, 38, 0)}  # their final frames

_FLAGS = [
    "-mmcu=atmega328p",
    "-DF_CPU=16000000UL",
    "-std=gnu11",
    "-Os",
    "-Wall",
    "-Wextra",
    "-Werror",
]


def missing() -> str:
    """What is not installed; empty when all is there."""
    tools = [tool for tool in ("gcc", "avr-gcc", "avr-objcopy", "avr-nm") if not shutil.which(tool)]
    absent = [*tools, *([] if SIMAVR.is_dir() else [str(SIMAVR)])]
    packages = "gcc libc6-dev gcc-avr avr-libc libsimavr-dev"
    return f"no {', '.join(absent)}: apt-get install {packages}" if absent else ""


def avr_gcc_version() -> str:
    return _run("avr-gcc", "-dumpversion").strip()


@dataclass(frozen=True, slots=True)
class Program:
    """A firmware for the simulator.

    Attributes:
        image: The .hex.
        counters: Where in its memory it counts bytes lost and bytes refused.
    """

    image: Path
    counters: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Built:
    """All that was built, by the names of the profiles."""

    host: Path
    programs: dict[str, Program]


def build(folder: Path) -> Built:
    """Builds the simulator's host and both firmwares."""
    host, stock = folder / "host", folder / "stock.elf"
    simavr = ["-I", str(SIMAVR), "-lsimavr", "-lutil", "-lm"]
    parts = [HERE / "host.c", HERE / "pins.c"]
    _run("gcc", "-O2", "-Wall", "-Wextra", "-Werror", *parts, "-o", host, *simavr)
    sources = [HERE / "stock.c", FIRMWARE / "servo.c"]
    _run("avr-gcc", *_FLAGS, "-I", FIRMWARE, *sources, "-o", stock)
    _run("avr-objcopy", "-O", "ihex", "-R", ".eeprom", stock, folder / "stock.hex")
    _run(FIRMWARE / "build", folder)
    counters = _symbol(stock, "counters")
    ours = folder / "armtree.elf"
    return Built(
        host,
        {
            "stock": Program(folder / "stock.hex", (counters, counters + 2)),
            "armtree": Program(
                folder / "armtree.hex", (_symbol(ours, "serial_lost"), _symbol(ours, "refused"))
            ),
        },
    )


def _run(*command: str | Path) -> str:
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def _symbol(program: Path, name: str) -> int:
    """The address of a variable in the data memory."""
    rows = [line.split() for line in _run("avr-nm", program).splitlines()]
    return next(int(row[0], 16) - 0x800000 for row in rows if row[-1] == name)


@dataclass(frozen=True, slots=True)
class Servo:
    """What a pin reported since the start, or since the last call.

    Attributes:
        angle: The whole degree its last pulse stands for, or None [deg].
        us: Width of its last pulse [us].
        period_us: From one pulse to the next [us].
        pulses: How many there were.
        off_us: Farthest from a whole degree since the last look [us].
        seen: Whole degrees since the last look; 181 for what was none.
    """

    angle: int | None
    us: float
    period_us: float
    pulses: int
    off_us: float
    seen: frozenset[int]

    @property
    def read(self) -> int:
        """The angle that the Arduino Servo library would read [deg]."""
        return int((round(self.us) + 1 - 544) * 180 // (2400 - 544))


@dataclass(frozen=True, slots=True)
class Report:
    """What the simulated board is doing.

    Attributes:
        time: Since it was switched on [s].
        opened: True while its port is open.
        resets: How often it was reset.
        lost: Bytes that came while it booted, or found its ring full.
        refused: Bytes that its parser dropped.
        servos: Its pins, in the order of a frame.
        said: What it said since the last look; only where time is simulated.
    """

    time: float
    opened: bool
    resets: int
    lost: int
    refused: int
    servos: tuple[Servo, ...]
    said: bytes

    @property
    def angles(self) -> tuple[int | None, ...]:
        return tuple(servo.angle for servo in self.servos)

    @property
    def board(self) -> BoardState:
        """In the words of the board model."""
        angles = tuple(float(servo.read) for servo in self.servos)
        return BoardState(angles, self.resets, self.lost, self.refused)


def _report(line: str) -> Report:
    answer: dict[str, Any] = json.loads(line)
    servos = [Servo(**{**servo, "seen": frozenset(servo["seen"])}) for servo in answer["servos"]]
    said = bytes.fromhex(answer.get("said", ""))
    return Report(**{**answer, "servos": tuple(servos), "said": said})


class _Host:
    """The simulator's process."""

    def __init__(self, built: Built, firmware: str, boot_time: float, *options: str) -> None:
        program = built.programs[firmware]
        lost, refused = map(str, program.counters)
        counters = ["--lost", lost, "--refused", refused]
        self._process = subprocess.Popen(
            [str(built.host), "--boot", str(boot_time), *counters, *options, str(program.image)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def tell(self, *words: str) -> None:
        assert self._process.stdin
        self._process.stdin.write(" ".join(words) + "\n")
        self._process.stdin.flush()

    def line(self) -> str:
        assert self._process.stdout
        line: str = self._process.stdout.readline()
        return line

    def ask(self, *words: str) -> Report:
        self.tell(*words)
        return _report(self.line())

    def close(self) -> None:
        self._process.communicate(timeout=PATIENCE)


class AvrBoard(_Host):
    """A board in simulated time, which only the test advances: exact and repeatable."""

    def __init__(self, built: Built, firmware: str, boot_time: float = 1.0) -> None:
        super().__init__(built, firmware, boot_time, "--fast")
        self.run(0.05)  # until it listens

    def put(self, data: bytes) -> None:
        """Puts bytes on the line."""
        self.tell("line", data.hex())

    def run(self, seconds: float) -> Report:
        return self.ask("run", f"{seconds:.9f}")

    def feed(self, data: bytes, wait: float = 0.05) -> Report:
        """Lets bytes arrive, and the pulses that follow from them."""
        self.put(data)
        return self.run(len(data) * 10 / BAUD + wait)


MakeBoard = Callable[..., AvrBoard]


class AvrArduino(_Host):
    """A board in real time behind a pseudo-terminal, as `BoardProcess`.

    Attributes:
        port: The pseudo-terminal to open.
    """

    def __init__(self, built: Built, firmware: str, boot_time: float = 1.0) -> None:
        super().__init__(built, firmware, boot_time)
        self.port: str = json.loads(self.line())["port"]

    def report(self) -> Report:
        return self.ask("state")

    def state(self) -> BoardState:
        return self.report().board

    def vanish(self) -> None:
        """Pulls the cable."""
        self.tell("vanish")

    def until(self, so: Callable[[Report], bool]) -> Report:
        """Looks until something is so."""
        clock = RealClock()
        signal, deadline = clock.signal(), clock.now() + PATIENCE
        while not so(report := self.report()):
            assert clock.now() < deadline, report
            with signal:
                signal.wait(clock.now() + 0.002)
        return report


def frame(angles: Sequence[int]) -> bytes:
    fields = zip("bseg", angles, strict=True)
    return "".join(f"{letter}{angle:03d}," for letter, angle in fields).encode()


@functools.cache
def pulse_us(angle: int) -> int:
    """What the Arduino Servo library makes of an angle [us]."""
    return 544 + angle * (2400 - 544) // 180


def at(report: Report, angles: Sequence[int], tolerance: float = 2.0) -> bool:
    """Whether the pulses have the widths of these angles."""
    widths = zip(report.servos, angles, strict=True)
    return all(abs(servo.us - pulse_us(angle)) <= tolerance for servo, angle in widths)


def checksum(frames: Sequence[Sequence[int]]) -> int:
    """The sum that our firmware tells after these frames."""
    value = 0
    for angles in frames:
        value = binascii.crc_hqx(bytes(angles), value)
    return value


def status(report: Report) -> dict[str, str]:
    """The last status line of our firmware."""
    line = [line for line in report.said.decode().splitlines() if line.startswith("status ")][-1]
    return dict(word.split("=") for word in line.split()[1:])
