"""The models of the board, compared with machine code in simulated time."""

import bisect
import dataclasses
import math
import random

import pytest

from hardware import load_robot
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.frames import Codec
from hardware.drivers.arduino.virtual.board import Board
from hardware.drivers.pacing import PacingModel
from hardware.drivers.wire_format import Frame
from tests.avr import rig
from tests.avr.rig import BAUD, BOOT, MakeBoard, frame
from tests.support.arms.frame_damage import damaged
from tests.support.arms.hardware_rigs import motion

pytest_plugins = ["tests.avr.fixtures"]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(rig.missing()), reason=rig.missing()),
]

BYTE = 10 / BAUD  # [s]
CYCLE = 0.02  # [s]
START = 0.0008  # from switching on to the beginning of the first pulse cycle [s]
SLOW = 0.005  # of a resonator
CLOSE = 0.00005  # what happens so near to the beginning of a cycle may fall before or after it [s]


def anything(dice: random.Random) -> bytes:
    """A few frames, damage, a command good or bad, or a question."""
    kind = dice.randrange(8)
    frames = [frame([dice.randrange(181) for _ in BOOT]) for _ in range(dice.randrange(1, 6))]
    if kind < 3:
        return b"".join(frames)
    if kind < 5:
        return damaged(frames[0], dice).replace(b"?", b"!")
    commands = [b"bA01;", b"bA00;", b"bW%02d;", b"%cV%02d;", b"sW01;", b"bA02;", b"bQ11;", b"bV1;"]
    command = dice.choice(commands)
    if command.startswith(b"%c"):
        return command % (dice.choice(b"bseg"), dice.randrange(100))
    if b"%" in command:
        return command % dice.randrange(5)
    return command if kind < 7 else b"?"


def clear(data: bytes, now: float) -> bool:
    """Whether no relevant byte arrives at the start of a cycle, when microseconds decide."""
    times = (now + (n + 1) * BYTE for n, byte in enumerate(data) if byte in b",;?")
    return all(CLOSE < time % CYCLE < CYCLE - CLOSE for time in times)


def pulse_us(angle: float) -> int:
    return 544 + int(angle * 256) * (2400 - 544) // (180 * 256)


@pytest.mark.parametrize("seed", range(8))
def test_our_firmware_and_its_model_do_and_say_the_same(board: MakeBoard, seed: int) -> None:
    dice, said = random.Random(seed), 0
    code, model = board(), Board("bseg", BOOT, FIRMWARES["armtree"], BAUD)
    now = code.run(0.0).time - START
    model.read_output(now)
    for _ in range(200):
        while not clear(data := anything(dice), now):
            pass
        code.put(data)
        model.receive(data, now)
        end = now + len(data) * BYTE + dice.choice([0.012, 0.1, 0.5])
        end = (math.ceil(end / CYCLE) + 0.8) * CYCLE  # the pulses of the cycle are over
        report = code.run(end - now)
        now = report.time - START
        state = model.state(now)
        assert model.read_output(now) == report.said
        assert (state.lost, state.refused) == (report.lost, report.refused)
        for angle, servo in zip(state.servos, report.servos, strict=True):
            assert abs(pulse_us(angle) - servo.us) < 1.5
        said += len(report.said)
    assert said > 3000


def test_no_schedule_and_no_stop_overruns_the_sketch(board: MakeBoard) -> None:
    """At full rate, spaced by the profile's service time, with a hold at any instant."""
    robot = dataclasses.replace(load_robot(), firmware=FIRMWARES["stock"])
    codec, dice, code = Codec(robot.actuated), random.Random(9), board("stock")
    here, longest = robot.boot_pose, 0
    for _ in range(20):
        goal = tuple(dice.uniform(max(j.lower, -0.8), min(j.upper, 0.8)) for j in robot.actuated)
        farthest = max(abs(b - a) for a, b in zip(here, goal, strict=True))
        schedule = motion(here, goal, farthest / dice.uniform(0.5, 10.0), robot)
        stop = dice.uniform(0.0, schedule.duration)
        times = [setpoint.time for setpoint in schedule.setpoints]
        sent = schedule.setpoints[: bisect.bisect(times, stop)]
        longest = max(longest, len(sent))
        began = code.run(0.0).time
        for setpoint in sent:
            code.run(max(0.0, began + setpoint.time - code.run(0.0).time))
            code.put(setpoint.frame.data)
        code.run(max(0.0, began + stop - code.run(0.0).time))
        code.put(sent[-1].frame.data)
        report = code.run(0.5)
        assert (report.lost, report.refused) == (0, 0)
        assert report.angles == sent[-1].frame.servos
        here = codec.decode(sent[-1].frame)
    assert longest > 10


@pytest.mark.parametrize(
    ("changes", "step", "loses"),
    [
        ({}, 16, False),
        ({}, 1, False),
        ({"unit_time": 0.005}, 16, True),
        ({"turn_time": 0}, 1, True),
    ],
)
def test_the_pace_is_that_of_the_code(
    board: MakeBoard, changes: dict[str, float], step: int, loses: bool
) -> None:
    """A motion without a rest, every frame as early as it may go; a faster pace is too fast.

    The resonator of an Uno may be slow, and all it does with it.
    """
    firmware, held = FIRMWARES["stock"], list(BOOT)
    if changes:
        firmware = dataclasses.replace(firmware, **changes)  # type: ignore[arg-type]
    code, pacing = board("stock"), PacingModel(firmware, BAUD, Frame(BOOT, frame(BOOT)))
    now = 0.0
    for _ in range(100):
        if not 20 < held[0] - step < 160:
            step = -step
        held[0] -= step
        wait = max(0.0, pacing.earliest - now)
        code.run(wait * (1 - SLOW))
        now += wait
        code.put(frame(held))
        pacing.note_sent(Frame(tuple(held), frame(held)), now)
    code.put(frame(held))  # the hold
    assert (code.run(0.5).lost > 0) == loses
