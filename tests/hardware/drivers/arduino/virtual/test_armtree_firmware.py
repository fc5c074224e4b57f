"""The model of the firmware of armtree: which line it sends when, and which it drops."""

import binascii
import dataclasses
import random

import pytest
from hypothesis import given, strategies as st

from hardware import BoardLink, SimulatedClock
from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.virtual.board import Board
from tests.avr.rig import frame
from tests.support.arms.frame_damage import CORRUPTIONS, Corruptions, pieces, spelled

OURS = FIRMWARES["armtree"]
BOOT = (90, 90, 90, 0)
FRAME = b"b009,s125,e085,g000,"
BYTE = 10 / 115200  # [s]
CYCLE = 0.02  # [s]
BANNER = b"\narmtree 1 AVW? kept b090,s090,e090,g000,\n"
STATUS = 131  # bytes


def board() -> Board:
    """A board whose first line has been read."""
    made = Board("bseg", BOOT, OURS, 115200)
    made.read_output(CYCLE / 2)
    return made


def test_it_sends_its_banner_when_switched_on_and_when_booted() -> None:
    made = Board("bseg", BOOT, OURS, 115200)
    assert made.next_output() == pytest.approx(len(BANNER) * BYTE)
    assert made.read_output(1.0) == BANNER.replace(b"kept", b"boot")
    made.receive(FRAME, 1.0)
    made.reset(2.0)
    said = 3.0 + len(BANNER) * BYTE
    assert made.next_output() == pytest.approx(said)
    assert made.read_output(said - 1e-6) == b""
    assert made.read_output(said + 1e-6) == b"\narmtree 1 AVW? kept b009,s125,e085,g000,\n"
    assert made.next_output() is None
    assert made.state(3.1).servos == (9, 125, 85, 0)


def status(said: bytes) -> dict[bytes, bytes]:
    """The last line, a status, by its words."""
    return dict(word.split(b"=") for word in said.splitlines()[-1].split()[1:])


def test_a_reset_forgets_settings_and_counters_and_keeps_the_angles() -> None:
    made = board()
    made.receive(b"junkbA01;bW01;sV09;" + FRAME + b"?", 0.1)
    assert status(made.read_output(0.4)) == {
        b"frames": b"0001",
        b"refused": b"0004",
        b"lost": b"0000",
        b"sum": b"%04x" % binascii.crc_hqx(bytes((9, 125, 85, 0)), 0),
        b"holds": b"01",
        b"acks": b"1",
        b"watchdog_ms": b"0100",
        b"speeds": b"000,090,000,000",
        b"at": b"b009,s099,e085,g000,",  # the angle that the limit allows in 0.1 s
    }
    made.reset(0.5)
    assert made.read_output(2.0).endswith(b" kept b009,s099,e085,g000,\n")
    made.receive(b"?", 2.0)
    reported = status(made.read_output(3.0))
    assert reported.pop(b"at") == b"b009,s099,e085,g000,"
    assert {value.strip(b"0,") for value in reported.values()} == {b""}


def test_an_acknowledgement_comes_when_its_frame_is_there_and_it_has_been_sent() -> None:
    made = board()
    made.receive(b"bA01;", 0.1)
    assert made.read_output(0.2).endswith(
        b"acks=1 watchdog_ms=0000 speeds=000,000,000,000 " + BOOT_AT
    )
    made.receive(FRAME, 0.2)
    arrival = made.next_output()  # of the first comma, after which it may send a line
    assert arrival == pytest.approx(0.2 + 5 * BYTE)
    made.advance(0.2 + 20.5 * BYTE)
    assert made.next_output() == pytest.approx(0.2 + 37 * BYTE)
    line = b"k0001,00,00,%04x\n" % binascii.crc_hqx(bytes((9, 125, 85, 0)), 0)
    assert made.read_output(0.2 + 38 * BYTE) == line


BOOT_AT = b"at=b090,s090,e090,g000,\n"


def test_the_watchdog_sends_a_status_without_any_input() -> None:
    made = board()
    made.receive(b"bW05;", 0.1 - 5 * BYTE - 0.01)
    made.read_output(0.15)
    deadline = made.next_output()
    assert deadline is not None
    assert deadline == pytest.approx(0.1 - 0.02 + 26 * CYCLE)  # the first cycle after 0.5 s
    assert made.read_output(deadline) == b""
    said = made.next_output()
    assert said is not None
    assert said == pytest.approx(deadline + STATUS * BYTE)
    assert b" holds=01 " in made.read_output(said)
    assert made.next_output() is None


def test_a_line_without_room_waits_and_has_the_newest_state() -> None:
    made = board()
    made.receive(b"bA01;" + FRAME + b"??", 0.1)
    # After the first status there is room for the acknowledgement and one more status. Further
    # requests leave one status waiting, and acknowledgements that fit are sent before it.
    made.receive(b"????" + FRAME * 2, 0.1 + 27 * BYTE)
    said = made.read_output(1.0).splitlines()
    first = [b"statu", b"k0001", b"statu", b"k0002", b"k0003", b"statu"]
    assert [line[:5] for line in said] == first
    assert b"frames=0003" in said[-1]


def test_a_reset_cuts_the_line_that_is_on_its_way() -> None:
    made = board()
    made.receive(b"?", 0.1)
    made.reset(0.1 + 11.5 * BYTE)
    assert made.read_output(2.0) == b"status fra" + BANNER


def test_an_idle_day_costs_nothing_and_changes_nothing() -> None:
    made = board()
    made.receive(b"sV09;" + FRAME, 0.1)
    assert made.state(86400.0).servos == (9, 125, 85, 0)
    made.receive(FRAME.replace(b"s125", b"s090"), 86400.0)
    assert made.state(86400.1 + 4 * CYCLE).servos[1] > 90


def test_a_reader_in_simulated_time_is_woken_for_every_line_at_its_time() -> None:
    clock = SimulatedClock()
    firmware = dataclasses.replace(OURS, boot_time=0.1)
    link = BoardLink(Board("bseg", BOOT, firmware, 115200), clock)
    heard: list[tuple[float, bytes]] = []
    signal = clock.signal()

    def listen() -> None:
        while data := link.read():
            heard.append((clock.now(), data))

    def wait(until: float) -> None:
        with signal:
            signal.wait(until)

    with clock.working():
        link.open()
        reader = clock.spawn(listen, "reader")
        wait(0.2)
        link.write(b"bA01;bW02;")
        wait(0.3)
        link.write(FRAME)
        wait(1.0)
        link.close()
    reader.join(10)
    times = [when for when, _ in heard]
    assert [data[:6] for _, data in heard] == [
        b"\narmtr",
        b"status",
        b"status",
        b"k0001,",
        b"status",
    ]
    assert times[0] == pytest.approx(0.1 + len(BANNER) * BYTE)
    assert times[1] == pytest.approx(0.2 + (5 + STATUS) * BYTE)
    assert times[2] == pytest.approx(0.2 + (5 + 2 * STATUS) * BYTE)
    assert times[3] == pytest.approx(0.3 + 37 * BYTE)
    assert times[4] == pytest.approx(0.52 + STATUS * BYTE)  # the first cycle after 0.2 s of silence


# Damage --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_damaged_and_split_frames_cause_no_angle_that_was_not_sent() -> None:
    damage, dice, made, now = Corruptions(CORRUPTIONS, seed=5), random.Random(6), board(), 0.1
    made.receive(b"bA01;", now)
    for piece, pause in pieces(damage.stream, dice):
        made.receive(piece, now)
        now += len(piece) * BYTE + pause
        angles = damage.came(len(piece), now)
        state = made.state(now)
        assert all(angle in some for angle, some in zip(state.servos, angles, strict=True))
        damage.heard(made.read_output(now))
    state = made.state(now + 0.1)
    damage.heard(made.read_output(now + 0.1))
    assert CORRUPTIONS < damage.acknowledged == len(damage.sent) - 1 < 1.4 * CORRUPTIONS
    assert state.servos == damage.sent[-1]
    assert state.lost == 0


FRAMES = st.tuples(*[st.integers(0, 180)] * 4).map(frame)
CUTS = st.integers(0, 19)
DAMAGED = st.one_of(
    st.binary(max_size=8),
    st.tuples(*[st.integers(0, 999)] * 4).map(frame),
    st.builds(lambda data, a, b: data[:a] + data[b:], FRAMES, CUTS, CUTS),
    st.builds(lambda data, a, noise: data[:a] + noise + data[a:], FRAMES, CUTS, st.binary()),
    st.builds(
        lambda data, a, byte: data[:a] + bytes([byte]) + data[a + 1 :],
        FRAMES,
        CUTS,
        st.sampled_from(b"0123456789bseg,;?-\n\xff"),
    ),
)
PIECES = st.lists(st.tuples(FRAMES | DAMAGED, st.sampled_from([0.0, 0.003, 0.5])), max_size=12)


@given(PIECES)
def test_the_servos_have_the_angles_of_a_whole_frame(parts: list[tuple[bytes, float]]) -> None:
    made, stream, now = board(), b"", 0.1
    for part, pause in parts:
        data = part.replace(b";", b":")  # a command could limit the speed
        stream += data
        made.receive(data, now)
        now += len(data) * BYTE + pause
        assert made.state(now).servos in (BOOT, *spelled(stream))
    assert made.state(now + 1.0).servos == [BOOT, *spelled(stream)][-1]
