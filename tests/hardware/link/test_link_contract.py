"""The contract of all links, for every kind of board and firmware."""

import re

import pytest

from hardware import Link
from hardware.drivers.arduino.firmware_profile import ArduinoFirmware
from hardware.errors import PortLost
from tests.support.command_line.virtual_shells import BAUD, BOOT, PATIENCE, Process, Shell

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.command_line.virtual_shell_fixtures"]


def test_opening_resets_the_board_and_bytes_are_lost_while_it_boots(shell: Shell) -> None:
    near, resets, lost = (85, 90, 90, 0), 0, 0
    for _ in range(10):  # on a busy machine the boot may be over before the bytes are there
        shell.link.open()
        shell.link.write(b"b000,s000,e000,g180,")
        shell.until(lambda state, before=resets: state.resets > before)  # type: ignore[misc]
        shell.booted()
        stood = shell.state().servos
        shell.link.write(b"b085,s090,e090,g000,")
        state = shell.until(lambda state: state.servos == near)
        if state.lost == lost + 20:
            break
        shell.close()
        if not isinstance(shell, Process):  # its board ends with the link
            resets, lost = state.resets, state.lost
    assert (state.resets, state.lost) == (resets + 1, lost + 20)
    assert stood in (BOOT, near)


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
    began = shell.time()
    shell.link.write(b"\n" * 2000 + b"b089,s090,e090,g000,")
    shell.until(lambda state: state.servos[0] == 89)
    assert shell.time() - began >= 2005 * 10 / BAUD * 0.99


def test_close_and_open_again_resets_again(shell: Shell, firmware: ArduinoFirmware) -> None:
    shell.boot()
    shell.link.write(b"b080,s100,e095,g010,")
    shell.until(lambda state: state.servos == (80, 100, 95, 10))
    shell.close()
    shell.link.close()
    if not isinstance(shell, Process):  # its board ends with the link
        assert shell.until(lambda state: state.resets == 1).servos == (80, 100, 95, 10)
    shell.link.open()
    snaps = isinstance(shell, Process) or not firmware.banner
    stands = BOOT if snaps else (80, 100, 95, 10)
    resets = 1 if isinstance(shell, Process) else 2
    shell.until(lambda state: state.resets == resets)
    shell.booted()
    shell.until(lambda state: state.servos == stands)
    shell.link.write(b"b085,s090,e090,g000,")
    shell.until(lambda state: state.servos == (85, 90, 90, 0))


def test_only_armtree_firmware_sends_anything(shell: Shell, firmware: ArduinoFirmware) -> None:
    shell.open()
    shell.listen()
    shell.booted()
    shell.link.write(b"b089,s090,e090,g000," * 2)
    shell.until(lambda state: state.servos[0] == 89)
    banner = firmware.banner.decode() + "kept b090,s090,e090,g000,"
    assert shell.hear(lambda lines: len(lines) == bool(firmware.banner)) == [banner] * bool(
        firmware.banner
    )
    assert shell.heard.count(b"\n") == 2 * bool(firmware.banner)


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
    """Reads until the link is closed."""
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
