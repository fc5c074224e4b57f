"""Every way to a board, for the contract that all of them keep: a link, and what is behind it."""

import dataclasses
from collections.abc import Callable
from threading import Thread

from hardware import BoardLink, Clock, Firmware, Link, RealClock, SerialLink, SimulatedClock
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.virtual.board import Board, BoardState
from hardware.drivers.virtual.board_process import BoardProcess, VirtualLink
from tests.avr.rig import AvrArduino, Built

BOOT = (90, 90, 90, 0)
BAUD = 115200
BOOT_TIME = 0.1  # [s]
PATIENCE = 60.0  # longer than anything here takes [s]


class Shell:
    """A link, the clock it lives on, and what is at its other end."""

    link: Link
    clock: Clock
    reader: Thread | None = None
    heard = b""

    def state(self) -> BoardState:
        raise NotImplementedError

    def unplug(self) -> None:
        raise NotImplementedError

    def time(self) -> float:
        """The board's own time [s]."""
        return self.clock.now()

    def end(self) -> None:
        self.link.close()
        if self.reader:
            self.reader.join(PATIENCE)

    def until(self, so: Callable[[BoardState], bool]) -> BoardState:
        """Looks at the board until something is so."""
        signal, deadline = self.clock.signal(), self.clock.now() + PATIENCE
        while not so(state := self.state()):
            assert self.clock.now() < deadline, (state, self.heard)
            with signal:
                signal.wait(self.clock.now() + 0.002)
        return state

    def open(self) -> None:
        """Opens the link and waits until the board has seen it."""
        self.link.open()
        self.until(lambda state: state.resets > 0)

    def booted(self) -> None:
        """Waits for the end of the boot time; the board has been reset."""
        self.wait(BOOT_TIME)

    def boot(self) -> None:
        self.open()
        self.booted()

    def close(self) -> None:
        """Closes the link and waits until the board has seen it."""
        self.link.close()

    def wait(self, seconds: float) -> None:
        signal, until = self.clock.signal(), self.clock.now() + seconds
        with signal:
            while self.clock.now() < until:
                signal.wait(until)

    def listen(self) -> None:
        """Hears from now on what the board says."""

        def run() -> None:
            while data := self.link.read():
                self.heard += data

        self.reader = self.clock.spawn(run, "reader")

    def hear(self, so: Callable[[list[str]], bool]) -> list[str]:
        """Waits until something is so with the lines that were heard, whole and not empty."""

        def lines() -> list[str]:
            return [line for line in self.heard.decode("ascii").split("\n")[:-1] if line]

        self.until(lambda _: so(lines()))
        return lines()

    def ask(self, data: bytes, begins: str) -> str:
        """Sends something; the next line that begins so is the answer."""
        before = len(self.hear(lambda _: True))
        self.link.write(data)

        def answers(lines: list[str]) -> list[str]:
            return [line for line in lines[before:] if line.startswith(begins)]

        return answers(self.hear(lambda lines: bool(answers(lines))))[0]


class InProcess(Shell):
    def __init__(self, firmware: Firmware) -> None:
        self.clock = SimulatedClock()
        self.board = Board("bseg", BOOT, firmware, BAUD)
        self.link = self.board_link = BoardLink(self.board, self.clock)

    def state(self) -> BoardState:
        return self.board.state(self.clock.now())

    def unplug(self) -> None:
        self.board_link.unplug()


class Process(Shell):
    """A link that starts its board's process whenever it opens."""

    def __init__(self, firmware: Firmware) -> None:
        self.clock = RealClock()
        self.link = self.virtual = VirtualLink(Board("bseg", BOOT, firmware, BAUD), BAUD)

    def state(self) -> BoardState:
        assert self.virtual.board
        state: BoardState = self.virtual.board.state()
        return state

    def unplug(self) -> None:
        assert self.virtual.board
        self.virtual.board.close()


class Port(Shell):
    """A serial port whose board was there before and stays."""

    def __init__(self, firmware: Firmware) -> None:
        self.clock = RealClock()
        self.arduino = BoardProcess(Board("bseg", BOOT, firmware, BAUD))
        self.link = SerialLink(self.arduino.port, BAUD)

    def state(self) -> BoardState:
        self.arduino.state()
        state: BoardState = self.arduino.state()  # a round later it has seen who came and went
        return state

    def close(self) -> None:
        super().close()
        self.state()

    def unplug(self) -> None:
        self.arduino.close()

    def end(self) -> None:
        super().end()
        self.arduino.close()


class Avr(Shell):
    """A serial port to a simulated chip, which runs machine code."""

    def __init__(self, firmware: Firmware, built: Built) -> None:
        self.clock = RealClock()
        self.arduino = AvrArduino(built, firmware.name, firmware.boot_time)
        self.arduino.until(lambda report: report.servos[3].pulses > 0)
        self.link = SerialLink(self.arduino.port, BAUD)

    def state(self) -> BoardState:
        return self.arduino.state()

    def time(self) -> float:
        return self.arduino.report().time

    def booted(self) -> None:
        """Its pins are idle while it boots; a busy machine may keep it behind the clock."""
        pulses = self.arduino.report().servos[3].pulses
        self.arduino.until(lambda report: report.servos[3].pulses > pulses)

    def close(self) -> None:
        super().close()
        self.arduino.until(lambda report: not report.opened)

    def unplug(self) -> None:
        self.arduino.vanish()

    def end(self) -> None:
        super().end()
        self.arduino.close()


def quick(name: str) -> Firmware:
    return dataclasses.replace(FIRMWARES[name], boot_time=BOOT_TIME)
