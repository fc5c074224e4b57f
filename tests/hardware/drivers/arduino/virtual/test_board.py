"""The virtual board, compared with facts about the published sketch and armtree's firmware."""

import dataclasses

import pytest
from hypothesis import given, strategies as st

from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.virtual.board import Board

STOCK, OURS = FIRMWARES["stock"], FIRMWARES["armtree"]
BOOT = (90, 90, 90, 0)
FRAME = b"b090,s090,e090,g000,"
BYTE = 10 / 115200  # [s]
LONG = 100.0  # after everything is over [s]


def booted(firmware: str = "stock") -> Board:
    return Board("bseg", BOOT, dataclasses.replace(FIRMWARES[firmware], boot_time=0.0), 115200)


def after(*sent: bytes, firmware: str = "stock", refused: int = 0) -> tuple[float, ...]:
    """The final servo angles after these bytes, each part sent when the last one is done."""
    board = booted(firmware)
    for number, data in enumerate(sent):
        board.receive(data, number * LONG)
    state = board.state(len(sent) * LONG)
    assert (state.refused, state.lost) == (refused, 0)
    return state.servos


def test_a_reset_puts_the_servos_at_the_boot_pose() -> None:
    board = booted()
    board.receive(b"b000,s000,e000,g180,", 0.0)
    assert board.state(LONG).servos == (0, 0, 0, 180)
    board.reset(LONG)
    assert board.state(LONG).servos == BOOT
    assert board.state(LONG).resets == 1


def test_bytes_during_the_boot_are_lost() -> None:
    board = Board("bseg", BOOT, STOCK, 115200)
    board.reset(5.0)
    board.receive(b"b000,s000,e000,g180,", 5.5)
    board.receive(b"b010,s020,e030,g040,", 6.0)
    state = board.state(LONG)
    assert state.servos == (10, 20, 30, 40)
    assert state.lost == 20


def test_what_was_counted_outlives_a_reset() -> None:
    board = booted("armtree")
    board.receive(b"junk", 0.0)
    before = board.state(1.0).refused
    board.reset(1.0)
    assert before == 4
    assert board.state(2.0).refused == 4


# How the parser of the published sketch handles damaged input
DAMAGE = {
    "a good frame": ([b"b024,s125,e085,g010,"], (24, 125, 85, 10), 0),
    "unpadded": ([b"b24,s125,e85,g0,"], (180, 125, 29, 0), 0),
    "lost first digit": ([b"b24,s125,e085,g000,"], (180, 125, 85, 0), 0),
    "lost last digit": ([b"b02,s125,e085,g000,"], (20, 125, 85, 0), 0),
    "lost comma": ([b"b024s125,e085,g010,"], (90, 125, 85, 10), 0),
    "lost letter": ([b"b024,125,e085,g010,"], (1, 90, 85, 10), 2),
    "lost letter of a second frame": ([FRAME, b"024,s125,e085,g010,"], (90, 125, 85, 10), 2),
    "a lone comma at boot": ([b","], (0, 90, 90, 0), 0),
    "a lone comma after a frame": ([b"b024,s125,e085,g010,", b","], (24, 125, 85, 0), 0),
    "minus one": ([b"b00-1,s090,e090,g000,"], (0, 90, 90, 0), 0),
    "minus twenty-four": ([b"b00-24,s090,e090,g000,"], (0, 90, 90, 0), 1),
    "too far": ([b"b090,s204,e090,g000,"], (90, 180, 90, 0), 0),
    "line feed": ([b"b024,s125,e085,g010,\n", FRAME], BOOT, 0),
    "carriage return, line feed": ([b"b024,s125,e085,g010,\r\n", FRAME], BOOT, 1),
    "many bytes that are not letters": ([b"0000000000,"], (0, 90, 90, 0), 6),
}


@pytest.mark.parametrize(("sent", "servos", "overwritten"), DAMAGE.values(), ids=DAMAGE)
def test_damaged_input_of_the_published_sketch(
    sent: list[bytes], servos: tuple[float, ...], overwritten: int
) -> None:
    assert after(*sent, refused=overwritten) == servos


def test_an_unpadded_frame_keeps_the_board_busy_for_seconds() -> None:
    board = booted()
    board.receive(b"b24,s125,e85,g0,", 0.0)
    board.receive(FRAME, 4.6)  # found too early, and waits
    assert board.state(4.7).servos[0] == 180
    assert board.state(LONG).servos == BOOT


@pytest.mark.parametrize(
    ("frame", "servos", "steps"),
    [
        (b"b090,s090,e090,g000,", (90, 90, 90, 0), 4),
        (b"b000,s000,e000,g000,", (0, 0, 0, 0), 274),
        (b"b100,s090,e090,g004,", (100, 90, 90, 4), 18),
    ],
)
def test_the_service_time(frame: bytes, servos: tuple[int, ...], steps: int) -> None:
    """A byte after a frame is read when the frame is done, and not before."""
    seconds = STOCK.service_time(BOOT, servos)
    assert seconds == pytest.approx(steps * STOCK.unit_time + 4 * STOCK.turn_time)
    done = 5 * BYTE + seconds  # the first servo turns when its comma is there
    board = booted()
    board.receive(frame + b"g180,", 0.0)
    assert board.state(done - 0.001).servos[3] == servos[3]
    assert board.state(done + 0.011).servos[3] > servos[3]


def test_the_worst_service_time() -> None:
    longest = 724 * STOCK.unit_time + 4 * STOCK.turn_time
    assert STOCK.service_time((0,) * 4, (180,) * 4) == pytest.approx(longest)
    assert OURS.service_time((0,) * 4, (180,) * 4) == 0


@pytest.mark.parametrize(("waiting", "lost"), [(1, 0), (2, 0), (3, 12), (4, 32)])
def test_two_frames_may_wait_behind_the_one_that_moves(waiting: int, lost: int) -> None:
    board = booted()
    board.receive(b"b000,s090,e090,g000," + FRAME * waiting, 0.0)
    assert board.state(0.4).lost == lost


def test_the_ring_holds_63_bytes() -> None:
    board = booted()
    board.receive(b"b180," + b"x" * 63, 0.0)
    assert board.state(0.4).lost == 0
    board.receive(b"x", 0.41)
    assert board.state(0.43).lost == 1


def lost_at(rate: float, seconds: float = 20.0) -> int:
    """Number of bytes lost when the same frame is repeated."""
    board = booted()
    for number in range(int(rate * seconds)):
        board.receive(FRAME, number / rate)
    return board.state(seconds + LONG).lost


@pytest.mark.parametrize("rate", [10, 20, 47])
def test_identical_frames_up_to_47_hz_are_digested(rate: float) -> None:
    assert lost_at(rate) == 0


@pytest.mark.parametrize("rate", [48, 60, 100])
def test_beyond_47_hz_bytes_are_lost(rate: float) -> None:
    assert lost_at(rate) > 0


# At f frames per second the board follows motions of up to 195 - 4.1 f degrees per second in total.
@pytest.mark.parametrize(
    ("rate", "degrees", "digested"),
    [(10, 15, True), (10, 16, False), (20, 5, True), (20, 6, False), (25, 3, True), (25, 4, False)],
)
def test_the_budget_of_a_frame(rate: float, degrees: int, digested: bool) -> None:
    board, angle = booted(), 90
    for number in range(600):
        angle += degrees if (number // 5) % 2 else -degrees
        board.receive(b"b%03d,s090,e090,g000," % angle, number / rate)
    assert (board.state(600 / rate + LONG).lost == 0) is digested


def test_a_frame_moves_all_servos_in_the_pulse_cycle_that_follows_its_last_comma() -> None:
    board = booted("armtree")
    board.receive(b"b000,s001,e002,g003,", 0.04 - 20 * BYTE - 1e-6)
    assert board.state(0.04 - 1e-6).servos == BOOT
    assert board.state(0.04).servos == (0, 1, 2, 3)
    board.receive(b"b100,s101,e102,g103,", 0.06 - 20 * BYTE + 1e-6)
    assert board.state(0.08 - 1e-6).servos == (0, 1, 2, 3)
    assert board.state(0.08).servos == (100, 101, 102, 103)


OURS_DAMAGE = {
    "unpadded": (b"b24,s125,e85,g0,", 16),
    "lost letter": (b"b024,125,e085,g010,", 19),
    "fields in another order": (b"s010,b020,e030,g040,", 20),
    "negative": (b"b00-1,s090,e090,g000,", 21),
    "too far": (b"b090,s204,e090,g000,", 20),
    "cut": (b"b024,s125,", 10),
    "noise": (b"\xff\x00\r\n", 4),
}


@pytest.mark.parametrize(("data", "refused"), OURS_DAMAGE.values(), ids=OURS_DAMAGE)
def test_armtree_drops_a_bad_frame_whole_and_accepts_the_next(data: bytes, refused: int) -> None:
    assert after(data + b"b001,s002,e003,g004,", firmware="armtree", refused=refused) == (
        1,
        2,
        3,
        4,
    )


@given(st.binary(max_size=80), st.integers(0, 180))
def test_no_noise_before_it_spoils_a_frame(noise: bytes, angle: int) -> None:
    board = booted("armtree")
    frame = b"b%03d,s%03d,e%03d,g%03d," % (angle, 180 - angle, angle, 0)
    board.receive(noise + b"," + frame, 0.0)
    assert board.state(LONG).servos == (angle, 180 - angle, angle, 0)


@given(st.lists(st.binary(min_size=1, max_size=30), max_size=6))
def test_whatever_comes_no_servo_leaves_its_travel(parts: list[bytes]) -> None:
    for firmware in FIRMWARES:
        board = booted(firmware)
        for number, part in enumerate(parts):
            board.receive(part, number * 0.01)
        assert all(0 <= angle <= 180 for angle in board.state(LONG).servos)


@given(st.lists(st.integers(0, 40), max_size=20))
def test_how_often_the_state_is_read_changes_nothing(looks: list[int]) -> None:
    watched, left = booted(), booted()
    for number in range(8):
        data = b"b%03d,s090,e%03d,g000," % (90 - 9 * number, 90 + 7 * number)
        now = number * 0.05
        watched.receive(data, now)
        left.receive(data, now)
        for look in sorted(looks):
            watched.state(now + look / 1000)
    assert watched.state(LONG) == left.state(LONG)
