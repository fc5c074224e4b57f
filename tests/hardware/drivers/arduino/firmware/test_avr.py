"""AVR code on simavr: the published sketch compared with its model, and the port."""

import dataclasses
import os
import random
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from hardware import SerialLink
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.virtual.board import Board
from tests.avr import rig
from tests.avr.rig import BAUD, BOOT, TASKS, AvrArduino, AvrBoard, Built, MakeBoard, at, frame
from tests.support.paths import ROBOT_FILE

pytest_plugins = ["tests.avr.fixtures"]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(rig.missing()), reason=rig.missing()),
]

BYTE = 10 / BAUD  # [s]
# Measured times of the published sketch, and their tolerance.
DEGREE_TIME, DEGREE_SPREAD = 0.0050583, 0.0000025  # [s]
TURN_TIME, TURN_SPREAD = 0.00015, 0.000025  # [s]
COMMANDS = [b"bA01;", b"bA00;", b"bW05;", b"bV09;", b"sV09;", b"eV09;", b"gV09;"]


# Both firmwares: pins, pulses, boot ----------------------------------------------------------


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_the_final_frames_of_the_tasks(board: MakeBoard, firmware: str) -> None:
    some = board(firmware)
    for angles in TASKS.values():
        report = some.feed(frame(angles), wait=1.5)
        assert at(report, angles)
        assert (report.lost, report.refused) == (0, 0)


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_bytes_during_the_boot_are_lost_and_the_pins_are_idle(
    board: MakeBoard, firmware: str
) -> None:
    some = board(firmware)
    before = some.run(0.0).servos[0].pulses
    some.tell("reset")
    report = some.feed(frame((0, 0, 0, 180)), wait=0.9)
    assert (report.lost, report.servos[0].pulses) == (20, before)
    some.run(0.2)
    report = some.feed(frame((91, 91, 91, 1)), wait=0.3)
    assert (report.angles, report.lost, report.resets) == ((91, 91, 91, 1), 20, 1)


# The published sketch: the model of the board ------------------------------------------------


def modelled(
    sent: list[tuple[float, bytes]],
    end: float,
    unit_time: float = DEGREE_TIME,
    turn_time: float = TURN_TIME,
) -> tuple[object, ...]:
    profile = dataclasses.replace(
        FIRMWARES["stock"], boot_time=0.0, unit_time=unit_time, turn_time=turn_time
    )
    model = Board("bseg", BOOT, profile, BAUD)
    for when, data in sent:
        model.receive(data, when)
    state = model.state(end)
    return state.lost, state.refused, state.servos


def simulated(stock: AvrBoard, sent: list[tuple[float, bytes]], end: float) -> tuple[object, ...]:
    began = now = stock.run(0.0).time
    for when, data in sent:
        now = stock.run(when - (now - began)).time if when > now - began else now
        stock.put(data)
    report = stock.run(end - (now - began))
    return report.lost, report.refused, report.board.servos


@pytest.mark.parametrize("waiting", [1, 2, 3, 4, 6])
def test_the_sketch_loses_the_same_bytes_as_the_model(board: MakeBoard, waiting: int) -> None:
    sent = [(0.0, frame((0, 90, 90, 0)) + frame(BOOT) * waiting)]
    assert simulated(board("stock"), sent, 3.0) == modelled(sent, 3.0)


DAMAGE = [
    b"b24,s125,e85,g0,", b"b02,s125,e085,g000,", b"b024s125,e085,g010,", b"b024,125,e085,g010,",
    b",", b"b00-1,s090,e090,g000,", b"b00-24,s090,e090,g000,", b"b090,s204,e090,g000,",
    b"0000000000,", b"b030,\r\n",
]  # fmt: skip


@pytest.mark.parametrize("data", DAMAGE)
def test_the_sketch_handles_damage_like_the_model(board: MakeBoard, data: bytes) -> None:
    sent, end = [(0.0, data)], 5.0 if b"b24," in data else 2.0
    assert simulated(board("stock"), sent, end) == modelled(sent, end)


def test_the_sketch_handles_bursts_like_the_model(board: MakeBoard) -> None:
    dice, losses = random.Random(5), 0
    for _ in range(10):
        burst = [
            frame([angle + dice.randint(-8 * (angle > 0), 8) for angle in BOOT])
            for _ in range(dice.randint(2, 8))
        ]
        sent = [(0.0, b"".join(burst))]
        result = modelled(sent, 1.2)
        assert simulated(board("stock"), sent, 1.2) == result
        losses += result[0] != 0
    assert losses > 3


def clear(sent: list[tuple[float, bytes]], end: float) -> bool:
    """Whether no loss is a matter of microseconds."""
    results = {
        modelled(sent, end, DEGREE_TIME + degree, TURN_TIME + turn)
        for degree in (-DEGREE_SPREAD, 0.0, DEGREE_SPREAD)
        for turn in (-TURN_SPREAD, 0.0, TURN_SPREAD)
    }
    return len(results) == 1


def overload(dice: random.Random) -> list[tuple[float, bytes]]:
    """A wandering arm that gets more frames than it can follow."""
    now, held, sent = 0.0, list(BOOT), []
    for _ in range(20):
        held = [min(180, max(0, angle + dice.randint(-4, 4))) for angle in held]
        sent.append((now, frame(held)))
        now += dice.uniform(0.02, 0.08)
    return sent


def test_the_overloaded_sketch_behaves_like_the_model(board: MakeBoard) -> None:
    dice, compared, lost = random.Random(11), 0, []
    while compared < 8:
        sent = overload(dice)
        end = sent[-1][0] + 0.6
        if clear(sent, end):
            result = modelled(sent, end)
            assert simulated(board("stock"), sent, end) == result
            compared += 1
            lost.append(result[0])
    assert sum(count != 0 for count in lost) > 4


@pytest.mark.parametrize(("rate", "loses"), [(48, False), (55, True)])
def test_the_sketch_sustains_the_rate_of_the_model(
    board: MakeBoard, rate: int, loses: bool
) -> None:
    sent = [(number / rate, frame(BOOT)) for number in range(2 * rate)]
    lost = modelled(sent, 2.5)[0], simulated(board("stock"), sent, 2.5)[0]
    assert [number != 0 for number in lost] == [loses, loses]


def test_our_commands_do_no_harm_to_the_sketch(board: MakeBoard) -> None:
    stock = board("stock")
    for command in COMMANDS:
        for _ in range(2):
            report = stock.feed(command)
            assert (report.angles, report.refused) == (BOOT, 0)
        report = stock.feed(command + frame((91, 89, 91, 1)), wait=0.2)
        assert report.angles == (91, 89, 91, 1)
        assert stock.feed(frame(BOOT), wait=0.2).angles == BOOT
    assert report.refused == 0


# In real time, through a real port -----------------------------------------------------------


def test_the_port_has_the_speed_of_the_line(built: Built) -> None:
    with closing(AvrArduino(built, "armtree", boot_time=0.0)) as arduino:
        arduino.until(lambda report: report.servos[0].pulses > 0)
        link = SerialLink(arduino.port, BAUD)
        link.open()
        assert b" kept b090,s090,e090,g000,\n" in _line(link)
        link.write(b"bA01;")
        assert b"acks=1" in _line(link)
        began, sent, said = arduino.report().time, 0, b""
        while (done := said.count(b"\n")) < 576:
            if sent - done < 40:
                link.write(frame(BOOT) * 12)
                sent += 12
            else:
                said += link.read()
        # In the time of the chip, which a busy machine makes late, and which then catches up.
        assert arduino.report().time - began >= 0.95 * 576 * 20 * BYTE
        assert said.splitlines()[575].startswith(b"k0240,00,00,")
        link.close()


def _line(link: SerialLink) -> bytes:
    """The next line that is not empty."""
    said = b""
    while not said.strip() or not said.endswith(b"\n"):
        said += link.read()
    return said


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_task_on_avr_code(built: Built, firmware: str, tmp_path: Path) -> None:
    """The executive, its planner and its streamer, down to the pulses."""
    source = ROBOT_FILE.parent
    text = (source / "arduinobot.toml").read_text()
    text = text.replace('firmware = "stock"', f'firmware = "{firmware}"')
    (tmp_path / "arduinobot.urdf").write_bytes((source / "arduinobot.urdf").read_bytes())
    (tmp_path / "robot.toml").write_text(text)
    with closing(AvrArduino(built, firmware)) as arduino:
        command = ["run", "0", "--robot", str(tmp_path / "robot.toml"), "--port", arduino.port]
        done = subprocess.run(
            [sys.executable, "-P", "-m", "armtree", *command],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
            env={**os.environ, "ARMTREE_RECORDINGS": str(tmp_path)},
        )
        assert done.returncode == 0, done.stdout + done.stderr
        report = arduino.until(lambda report: at(report, TASKS[0]))
        assert (report.lost, report.refused, report.resets) == (0, 0, 1)
