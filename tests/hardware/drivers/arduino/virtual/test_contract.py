"""The contract of all boards: the models, and machine code on a simulated chip."""

import random

import pytest

from hardware import Firmware
from hardware.drivers.arduino.virtual.board import Board
from tests.avr.rig import checksum, frame
from tests.support.command_line.virtual_shells import BAUD, BOOT, BOOT_TIME, Process, Shell

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.command_line.virtual_shell_fixtures"]

NEAR = (91, 89, 91, 1)
COMMANDS = [b"bA01;", b"bA00;", b"bW05;", b"bV09;", b"sV09;", b"eV09;", b"gV09;"]


def words(status: str) -> dict[str, str]:
    return dict(word.split("=") for word in status.split()[1:])


# Both firmwares ------------------------------------------------------------------------------


def test_garbage_is_refused_byte_by_byte_and_a_frame_behind_it_is_taken(
    shell: Shell, firmware: Firmware
) -> None:
    """The number of refused bytes equals that of the model."""
    dice = random.Random(7)
    kinds = [byte for byte in range(256) if byte not in b",;?"]
    garbage = bytes(dice.choices(kinds, k=300)) + b"b"
    model = Board("bseg", BOOT, firmware, BAUD)
    model.receive(garbage + frame(NEAR), 0.0)
    refused = model.state(10.0).refused
    assert refused > 200
    shell.boot()
    shell.link.write(garbage + frame(NEAR))
    state = shell.until(lambda state: state.servos == NEAR)
    assert (state.lost, state.refused) == (0, refused)


def test_our_commands_move_nothing_and_spoil_no_frame(shell: Shell) -> None:
    shell.boot()
    shell.link.write(b"".join(COMMANDS) + b"bV00;sV00;eV00;gV00;bW00;" + frame(NEAR))
    state = shell.until(lambda state: state.servos == NEAR)
    assert (state.lost, state.refused) == (0, 0)


# The published sketch ------------------------------------------------------------------------


def test_the_sketch_takes_damage_in_its_own_way(stock: Shell) -> None:
    damage = {
        b"b09,s095,e090,g010,": (90, 95, 90, 10),  # lost digit: the rest of the value before stays
        b"b094s085,e090,g003,": (90, 85, 90, 3),  # lost comma: that servo stays
        b"b095,080,e090,g003,": (0, 85, 90, 3),  # lost letter: the last servo moves again
        b"b005,s085,e090,g182,": (5, 85, 90, 180),  # too far: as far as it goes
    }
    for data, angles in damage.items():
        stock.link.write(data)
        stock.until(lambda state, angles=angles: state.servos == angles)  # type: ignore[misc]
    state = stock.state()
    assert (state.lost, state.refused) == (0, 2)  # the two would have overwritten memory


def test_the_sketch_loses_what_its_ring_cannot_hold(stock: Shell) -> None:
    stock.link.write(frame((60, 90, 90, 0)) + frame(BOOT) + frame((90, 90, 90, 2)))
    assert stock.until(lambda state: state.servos[3] == 2).lost == 0
    stock.link.write(frame((60, 90, 90, 0)) + frame(BOOT) * 4)
    stock.until(lambda state: state.servos == BOOT and state.lost == 32)


# The firmware of armtree ---------------------------------------------------------------------


def test_a_damaged_frame_is_dropped_whole_and_counted(ours: Shell) -> None:
    damage = {
        b"b24,s125,e85,g0,": 16,
        b"b024,125,e085,g010,": 19,
        b"s010,b020,e030,g040,": 20,
        b"b090,s204,e090,g000,": 20,
        b"b024,s125,": 10,
        b"\xff\x00\r\n": 4,
        b"b02:,s125,e085,g010,": 20,
        b"bA02;sW01;bQ00;": 15,
    }
    refused = 0
    for number, (data, count) in enumerate(damage.items()):
        angles = (91 + number, 89, 91, 1 + number)
        refused += count
        reported = words(ours.ask(data + frame(angles) + b"?", "status"))
        assert (int(reported["frames"], 16), int(reported["refused"], 16)) == (number + 1, refused)
        state = ours.until(lambda state, angles=angles: state.servos == angles)  # type: ignore[misc]
        assert (state.lost, state.refused) == (0, refused)


def test_every_frame_is_acknowledged_after_the_command_and_none_before(ours: Shell) -> None:
    ours.ask(frame(NEAR) + b"bA01;", "status")
    dice = random.Random(8)
    sent = [NEAR, *(tuple(dice.randrange(181) for _ in BOOT) for _ in range(100))]
    last = f"k{len(sent):04x},00,00,{checksum(sent):04x}"
    ours.link.write(b"".join(map(frame, sent[1:])))
    lines = ours.hear(lambda lines: lines[-1] == last)
    acks = [f"k{n:04x},00,00,{checksum(sent[:n]):04x}" for n in range(2, len(sent) + 1)]
    assert lines[2:] == acks
    assert ours.until(lambda state: state.servos == sent[-1]).lost == 0
    ours.ask(b"bA00;", "status")
    ours.ask(frame(BOOT) + b"?", "status")
    assert ours.heard.count(b"k0066") == 0


def test_an_acknowledgement_counts_refused_bytes(ours: Shell) -> None:
    ours.ask(b"bA01;", "status")
    assert ours.ask(b"junk" + frame(BOOT), "k") == f"k0001,04,00,{checksum([BOOT]):04x}"


def test_questions_without_end_are_answered_as_room_allows_and_stop_no_frame(ours: Shell) -> None:
    ours.ask(b"bA01;", "status")
    ours.link.write(b"?" * 400 + frame(NEAR) + b"?" * 20)
    last = f"k0001,00,00,{checksum([NEAR]):04x}"
    lines = ours.hear(lambda lines: last in lines and any("frames=0001" in line for line in lines))
    assert 3 <= sum(line.startswith("status") for line in lines) <= 10  # of 421 requested
    state = ours.until(lambda state: state.servos == NEAR)
    assert (state.lost, state.refused) == (0, 0)


def test_the_status_has_everything_and_a_reset_clears_all_but_the_angles(ours: Shell) -> None:
    nothing = {
        "frames": "0000",
        "refused": "0000",
        "lost": "0000",
        "sum": "0000",
        "holds": "00",
        "acks": "0",
        "watchdog_ms": "0000",
        "speeds": "000,000,000,000",
        "at": "b090,s090,e090,g000,",
    }
    assert words(ours.ask(b"?", "status")) == nothing
    ours.link.write(b"bA01;bW99;sV09;gV50;junk" + frame(NEAR))
    ours.until(lambda state: state.servos == NEAR)
    ours.link.write(b"?")
    assert words(ours.hear(lambda lines: lines[-1].endswith("g001,"))[-1]) == {
        "frames": "0001",
        "refused": "0004",
        "lost": "0000",
        "sum": f"{checksum([NEAR]):04x}",
        "holds": "00",
        "acks": "1",
        "watchdog_ms": "9900",
        "speeds": "000,090,000,500",
        "at": "b091,s089,e091,g001,",
    }
    resets = ours.state().resets
    ours.close()
    if isinstance(ours, Process):  # its board ends with the link
        return
    ours.link.open()
    ours.until(lambda state: state.resets == resets + 1)
    ours.heard = b""
    ours.listen()
    ours.booted()
    assert ours.hear(lambda lines: len(lines) > 0) == ["armtree 1 AVW? kept b091,s089,e091,g001,"]
    assert words(ours.ask(b"?", "status")) == {**nothing, "at": "b091,s089,e091,g001,"}


def test_the_watchdog_holds_the_arm_and_sends_a_status(ours: Shell) -> None:
    ours.link.write(b"bW02;gV01;" + frame((90, 90, 90, 180)))
    lines = ours.hear(lambda lines: "holds=01" in lines[-1])
    gripper = int(words(lines[-1])["at"][-4:-1])
    assert 1 <= gripper <= 3  # 0.2 s at 10 deg/s
    ours.wait(3 * 0.02 + BOOT_TIME)
    assert round(ours.state().servos[3]) == gripper
    reported = words(ours.ask(b"gV00;" + frame(NEAR), "status"))
    assert (reported["holds"], reported["watchdog_ms"]) == ("01", "0200")
    ours.until(lambda state: state.servos == NEAR)


def test_a_question_often_enough_keeps_the_watchdog_from_holding(ours: Shell) -> None:
    """One piece of bytes, which no machine is too busy to keep together: 61 ms between questions.

    What lies between them is noise, which does not count.
    """
    ours.link.write(b"bW01;" + (b"\n" * 700 + b"?") * 5)
    lines = ours.hear(lambda lines: "holds=01" in lines[-1])
    reported = [words(line)["holds"] for line in lines if line.startswith("status")]
    assert reported == ["00"] * 6 + ["01"]


def test_a_speed_limit_is_kept_by_its_servo_alone(ours: Shell) -> None:
    ours.ask(b"sV09;", "status")
    pause = b"\n" * 300  # 26 ms on the line
    places = words(ours.ask(frame((95, 108, 95, 5)) + pause + b"?", "status"))["at"]
    base, shoulder, elbow, gripper = (int(field[1:]) for field in places.split(",")[:-1])
    assert (base, elbow, gripper) == (95, 95, 5)
    assert 91 <= shoulder <= 94
    ours.until(lambda state: state.servos == (95, 108, 95, 5))
    ours.ask(b"sV00;", "status")
    pause = b"\n" * 300
    at = words(ours.ask(frame((95, 0, 95, 5)) + pause + b"?", "status"))["at"]
    assert at == "b095,s000,e095,g005,"
