"""The firmware of armtree, as AVR code on simavr: pins, held angles, answers, damage."""

import random
from itertools import pairwise

import pytest

from tests.avr import rig
from tests.avr.rig import (
    BOOT,
    TASKS,
    Built,
    MakeBoard,
    Report,
    at,
    checksum,
    frame,
    pulse_us,
    status,
)
from tests.support.arms.frame_damage import CORRUPTIONS, Corruptions, pieces
from tests.support.paths import FIRMWARE

pytest_plugins = ["tests.avr.fixtures"]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(rig.missing()), reason=rig.missing()),
]


def test_the_committed_hex_is_built_from_the_source(built: Built) -> None:
    if rig.avr_gcc_version() != rig.AVR_GCC:
        pytest.skip(f"avr-gcc {rig.avr_gcc_version()}, and the .hex is from {rig.AVR_GCC}")
    rebuilt = built.programs["armtree"].image.read_bytes()
    assert (FIRMWARE / "armtree.hex").read_bytes() == rebuilt


def test_every_angle_has_its_pulse_width_on_every_pin(board: MakeBoard) -> None:
    ours = board()
    for angle in range(181):
        angles = (angle, 180 - angle, (angle + 60) % 181, (angle + 120) % 181)
        report = ours.feed(frame(angles))
        assert at(report, angles, 1.0)
        assert all(abs(servo.period_us - 20000) < 1 for servo in report.servos)


# Held angles ---------------------------------------------------------------------------------


def test_a_reset_leaves_the_servos_where_they_were(board: MakeBoard) -> None:
    ours, stock = board(), board("stock")
    assert ours.feed(frame(TASKS[1])).angles == TASKS[1]
    assert stock.feed(frame(TASKS[1]), wait=1.5).angles == TASKS[1]
    for some in (ours, stock):
        some.tell("reset")
    report = ours.run(1.2)
    assert report.said == b"\narmtree 1 AVW? kept b009,s125,e085,g000,\n"
    assert [servo.seen for servo in report.servos] == [{angle} for angle in TASKS[1]]
    assert stock.run(1.2).angles == BOOT


def test_switching_off_forgets(board: MakeBoard) -> None:
    ours = board()
    ours.feed(frame(TASKS[1]))
    ours.tell("power")
    report = ours.run(0.1)
    assert report.said == b"\narmtree 1 AVW? boot b090,s090,e090,g000,\n"
    assert report.angles == BOOT


def test_a_reset_at_any_moment_keeps_the_angles_of_the_last_pulses(board: MakeBoard) -> None:
    ours, dice = board(boot_time=0.0), random.Random(1)
    angles: tuple[int, ...] = BOOT
    for _ in range(500):
        angles = tuple(dice.randrange(181) for _ in angles)
        ours.put(frame(angles))
        before = ours.run(dice.uniform(0.0, 0.045))
        ours.tell("reset")
        after = ours.run(0.05)
        banner = after.said.split(b"armtree")[-1]
        assert b" kept " in banner
        # A reset just before a cycle may keep what that cycle would have begun with.
        assert banner.endswith(tuple(frame(a) + b"\n" for a in (_angles(before), angles)))
        assert frame(_angles(after)) in banner


def _angles(report: Report) -> tuple[int, ...]:
    assert None not in report.angles
    return tuple(angle for angle in report.angles if angle is not None)


# Answers -------------------------------------------------------------------------------------


def test_it_sends_only_what_was_requested(board: MakeBoard) -> None:
    assert board().feed(frame(TASKS[0]) * 100, wait=1.0).said == b""


def test_the_wire_rate_is_sustained_and_every_frame_acknowledged(board: MakeBoard) -> None:
    ours, dice = board(), random.Random(2)
    ours.feed(b"bA01;")
    frames = [tuple(dice.randrange(181) for _ in BOOT) for _ in range(2880)]
    report = ours.feed(b"".join(map(frame, frames)))
    acks = report.said.decode().splitlines()
    assert acks[0] == f"k0001,00,00,{checksum(frames[:1]):04x}"
    assert [int(ack[1:5], 16) for ack in acks] == list(range(1, len(frames) + 1))
    assert acks[-1] == f"k{len(frames):04x},00,00,{checksum(frames):04x}"
    assert max(map(len, acks)) + 1 < 20
    assert (report.lost, report.refused) == (0, 0)
    assert report.angles == frames[-1]
    for servo, sent in zip(report.servos, zip(*frames, strict=True), strict=True):
        assert servo.seen <= {*sent, *BOOT}
        assert abs(servo.off_us) <= 1.0  # also while the line is full both ways


def test_answers_that_find_no_room_are_dropped_and_frames_are_not(board: MakeBoard) -> None:
    ours = board()
    ours.feed(b"bA01;")
    frames = [TASKS[number % 3] for number in range(500)]
    report = ours.feed(b"".join(frame(angles) + b"???" for angles in frames), wait=0.1)
    acks = [line for line in report.said.decode().splitlines() if line.startswith("k")]
    assert acks[-1] == f"k01f4,00,00,{checksum(frames):04x}"
    assert 0 < report.said.count(b"status") < 500
    assert status(report)["frames"] == "01f4"
    assert (report.lost, report.refused) == (0, 0)


def test_the_status_has_everything(board: MakeBoard) -> None:
    ours = board()
    first = ours.feed(b"?").said
    assert first == (
        b"status frames=0000 refused=0000 lost=0000 sum=0000 holds=00 acks=0 watchdog_ms=0000 "
        b"speeds=000,000,000,000 at=b090,s090,e090,g000,\n"
    )
    reported = status(ours.feed(b"bA01;bW12;sV09;gV50;junk" + frame(TASKS[0]) + b"?", wait=1.0))
    assert reported == {
        "frames": "0001",
        "refused": "0004",
        "lost": "0000",
        "sum": f"{checksum([TASKS[0]]):04x}",
        "holds": "00",
        "acks": "1",
        "watchdog_ms": "1200",
        "speeds": "000,090,000,500",
        "at": "b090,s090,e090,g000,",
    }
    assert status(ours.feed(b"?"))["at"] == "b090,s090,e090,g080,"


def test_the_lines_have_the_lengths_in_the_code(board: MakeBoard) -> None:
    ours = board()
    ours.tell("reset")
    banner = ours.run(1.1).said
    ours.feed(b"bA01;")
    lines = {"BANNER": banner, "ACK": ours.feed(frame(BOOT)).said, "STATUS": ours.feed(b"?").said}
    code = (FIRMWARE / "armtree.c").read_text()
    for name, line in lines.items():
        assert f"#define {name}_LENGTH {len(line)}" in code


def test_a_framing_error_loses_its_frame_and_no_other(board: MakeBoard) -> None:
    ours = board()
    ours.put(b"b010,s010,e0")
    ours.tell("break")
    report = ours.feed(b"10,g010," + frame(TASKS[1]))
    assert report.angles == TASKS[1]
    assert (report.lost, report.refused) == (1, 21)


# Watchdog and speed limits -------------------------------------------------------------------


def test_the_watchdog_holds_when_nothing_comes(board: MakeBoard) -> None:
    ours = board()
    ours.feed(b"bW03;bV10;")
    assert ours.feed(frame((0, 90, 90, 0)), wait=0.29).said == b""
    report = ours.run(0.06)  # the deadline and one cycle are over
    assert status(report)["holds"] == "01"
    held = report.servos[0].us
    assert pulse_us(58) < held < pulse_us(64)  # 0.3 s at 100 deg/s from 90
    assert abs(ours.run(1.0).servos[0].us - held) < 1
    assert ours.feed(frame((0, 90, 90, 0)) + b"?" * 3, wait=0.2).servos[0].us < held - 100
    report = ours.feed(b"bW00;", wait=1.0)
    assert (status(report)["holds"], report.angles) == ("01", (0, 90, 90, 0))


def test_the_watchdog_is_content_with_frames_questions_and_commands(board: MakeBoard) -> None:
    ours = board()
    ours.feed(b"bW02;")
    for word in (frame(BOOT), b"?", b"bV00;") * 5:
        ours.feed(word, wait=0.18)
    assert status(ours.feed(b"?"))["holds"] == "00"
    for _ in range(5):
        ours.feed(b"noise", wait=0.18)
    assert status(ours.feed(b"?"))["holds"] == "01"


@pytest.mark.parametrize("limit", [1, 9, 50, 99])
def test_a_speed_limit_is_kept(board: MakeBoard, limit: int) -> None:
    ours = board()
    ours.feed(f"gV{limit:02d};".encode())
    ours.put(frame((0, 90, 90, 60)))
    widths = [ours.run(0.02).servos[3].us for _ in range(400)]
    steps = [(b - a) * 180 / 1856 for a, b in pairwise(widths)]
    assert max(steps) <= limit * 10 * 0.02 + 0.2
    moving = sum(step > 0.01 for step in steps)
    assert moving * 0.02 == pytest.approx(60 / (limit * 10), rel=0.05, abs=0.03)
    assert ours.run(0.0).angles == (0, 90, 90, 60)


# Damage --------------------------------------------------------------------------------------


def test_damaged_and_split_frames_cause_no_angle_that_was_not_sent(board: MakeBoard) -> None:
    damage, dice = Corruptions(CORRUPTIONS, seed=3), random.Random(4)
    ours = board()
    ours.feed(b"bA01;")
    for piece, pause in pieces(damage.stream, dice):
        report = ours.feed(piece, pause)
        angles = damage.came(len(piece), report.time)
        assert all(servo.seen <= some for servo, some in zip(report.servos, angles, strict=True))
        damage.heard(report.said)
    report = ours.run(0.1)
    damage.heard(report.said)
    assert CORRUPTIONS < damage.acknowledged == len(damage.sent) - 1 < 1.4 * CORRUPTIONS
    assert report.angles == damage.sent[-1]
    assert report.lost == 0


@pytest.mark.parametrize("pause", [0.0, 0.003, 0.5])
def test_frames_may_come_in_pieces(board: MakeBoard, pause: float) -> None:
    ours = board()
    data = frame(TASKS[1])
    for cut in range(1, len(data)):
        ours.feed(data[:cut], wait=pause)
        ours.feed(data[cut:])
    assert status(ours.feed(b"?"))["frames"] == "0013"


def test_no_single_damaged_byte_makes_a_command_of_a_frame(board: MakeBoard) -> None:
    ours, data = board(), frame(TASKS[1])
    for where in range(len(data)):
        stream = b"".join(
            data[:where] + bytes([byte]) + data[where + 1 :] for byte in range(256) if byte != 63
        )
        assert ours.feed(stream).said == b""  # a command would be answered
