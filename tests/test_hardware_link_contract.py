"""What every line to a board does, whatever is behind it and whatever the board runs."""

import dataclasses
import re
from collections.abc import Callable, Iterator

import pytest

from hardware import (
    FIRMWARES,
    Board,
    BoardLink,
    BoardState,
    Clock,
    Firmware,
    Link,
    PortLost,
    RealClock,
    SerialLink,
    SimulatedClock,
    VirtualArduino,
    VirtualLink,
)

BOOT = (90, 90, 90, 0)
BAUD = 115200
BOOT_TIME = 0.1  # [s]
PATIENCE = 10.0  # longer than anything here takes [s]


class Shell:
    """A link, the clock it lives on, and what is at its other end."""

    link: Link
    clock: Clock

    def state(self) -> BoardState:
        raise NotImplementedError

    def unplug(self) -> None:
        raise NotImplementedError

    def end(self) -> None:
        self.link.close()

    def until(self, so: Callable[[BoardState], bool]) -> BoardState:
        """Looks at the board until something is so."""
        signal, deadline = self.clock.signal(), self.clock.now() + PATIENCE
        while not so(state := self.state()):
            assert self.clock.now() < deadline, state
            with signal:
                signal.wait(self.clock.now() + 0.002)
        return state

    def boot(self) -> None:
        self.link.open()
        self.until(lambda state: state.resets > 0)
        self.wait(BOOT_TIME)

    def wait(self, seconds: float) -> None:
        signal, until = self.clock.signal(), self.clock.now() + seconds
        with signal:
            while self.clock.now() < until:
                signal.wait(until)


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
        self.link = self.virtual = VirtualLink("bseg", BOOT, firmware, BAUD)

    def state(self) -> BoardState:
        assert self.virtual.arduino
        return self.virtual.arduino.state()

    def unplug(self) -> None:
        assert self.virtual.arduino
        self.virtual.arduino.close()


class Port(Shell):
    """A serial port whose board was there before and stays."""

    def __init__(self, firmware: Firmware) -> None:
        self.clock = RealClock()
        self.arduino = VirtualArduino("bseg", BOOT, firmware, BAUD)
        self.link = SerialLink(self.arduino.port, BAUD)

    def state(self) -> BoardState:
        self.arduino.state()
        return self.arduino.state()  # a round later it has seen who came and went

    def unplug(self) -> None:
        self.arduino.close()

    def end(self) -> None:
        self.link.close()
        self.arduino.close()


def quick(name: str) -> Firmware:
    return dataclasses.replace(FIRMWARES[name], boot_time=BOOT_TIME)


@pytest.fixture(params=FIRMWARES)
def firmware(request: pytest.FixtureRequest) -> Firmware:
    return quick(request.param)


@pytest.fixture(params=[InProcess, Process, Port])
def shell(request: pytest.FixtureRequest, firmware: Firmware) -> Iterator[Shell]:
    shell: Shell = request.param(firmware)
    yield shell
    shell.end()


def test_opening_resets_the_board_and_bytes_are_lost_while_it_boots(shell: Shell) -> None:
    shell.link.open()
    shell.link.write(b"b000,s000,e000,g180,")
    assert shell.until(lambda state: state.lost > 0 or state.servos != BOOT).servos == BOOT
    assert shell.until(lambda state: state.lost == 20) == BoardState(BOOT, 1, 20, 0)
    shell.wait(BOOT_TIME)
    shell.link.write(b"b085,s090,e090,g000,")
    assert shell.until(lambda state: state.servos[0] == 85).servos == (85, 90, 90, 0)


def test_frames_move_the_servos_also_in_pieces(shell: Shell) -> None:
    shell.boot()
    shell.link.write(b"b085,s095,e090,g005,")
    shell.until(lambda state: state.servos == (85, 95, 90, 5))
    for part in (b"b", b"08", b"0,s100,e0", b"95,g010", b","):
        shell.link.write(part)
    state = shell.until(lambda state: state.servos == (80, 100, 95, 10))
    assert (state.resets, state.lost, state.refused) == (1, 0, 0)


def test_the_line_has_the_speed_of_its_baud_rate(shell: Shell) -> None:
    shell.boot()
    began = shell.clock.now()
    shell.link.write(b"\n" * 2000 + b"b089,s090,e090,g000,")
    shell.until(lambda state: state.servos[0] == 89)
    assert shell.clock.now() - began >= 2005 * 10 / BAUD


def test_close_and_open_again_resets_again(shell: Shell, firmware: Firmware) -> None:
    shell.boot()
    shell.link.write(b"b080,s100,e095,g010,")
    shell.until(lambda state: state.servos == (80, 100, 95, 10))
    shell.link.close()
    shell.link.close()
    if not isinstance(shell, Process):  # whose board ends with the link
        assert shell.until(lambda state: state.resets == 1).servos == (80, 100, 95, 10)
    shell.link.open()
    snaps = isinstance(shell, Process) or not firmware.banner
    stands = BOOT if snaps else (80, 100, 95, 10)
    resets = 1 if isinstance(shell, Process) else 2
    shell.until(lambda state: state.resets == resets and state.servos == stands)
    shell.wait(BOOT_TIME)
    shell.link.write(b"b085,s090,e090,g000,")
    shell.until(lambda state: state.servos == (85, 90, 90, 0))


def test_only_our_firmware_says_something(shell: Shell, firmware: Firmware) -> None:
    shell.link.open()
    said: list[bytes] = []

    def listen() -> None:
        while data := shell.link.read():
            said.append(data)

    reader = shell.clock.spawn(listen, "reader")
    shell.until(lambda state: state.resets == 1)
    shell.wait(BOOT_TIME + 0.05)
    shell.link.close()
    reader.join(PATIENCE)
    assert not reader.is_alive()
    line = firmware.banner + b"kept b090,s090,e090,g000,\n"
    assert b"".join(said) == (line if firmware.banner else b"")


def test_a_closed_link_reads_nothing_and_takes_nothing(shell: Shell) -> None:
    for _ in range(2):
        assert shell.link.read() == b""
        with pytest.raises(PortLost):
            shell.link.write(b"b090,s090,e090,g000,")
        shell.link.open()
        shell.link.close()


def test_closing_wakes_a_reader(shell: Shell) -> None:
    shell.link.open()
    reader = shell.clock.spawn(lambda: assert_over(shell.link), "reader")
    shell.until(lambda state: state.resets == 1)
    shell.link.close()
    reader.join(PATIENCE)
    assert not reader.is_alive()


def assert_over(link: Link) -> None:
    """Reads until there is no more."""
    while link.read():
        pass


def test_a_board_that_vanishes_is_noticed_on_every_side(shell: Shell) -> None:
    shell.boot()
    errors: list[PortLost] = []

    def listen() -> None:
        try:
            assert_over(shell.link)
        except PortLost as error:
            errors.append(error)

    reader = shell.clock.spawn(listen, "reader")
    shell.unplug()
    reader.join(PATIENCE)
    frame = "b090,s090,e090,g000,"
    why = f"Something went wrong while sending the message {frame} to the port {errors[0].port}:"
    with pytest.raises(PortLost, match=re.escape(why)):
        shell.link.write(frame.encode())
    with pytest.raises(PortLost, match=r"Something went wrong while listening: .* is gone"):
        shell.link.read()
    shell.link.close()
    assert shell.link.read() == b""
