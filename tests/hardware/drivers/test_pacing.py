"""The pacing model: after every frame that it allows, a hold fits the board's buffer."""

import dataclasses
import math

import pytest
from hypothesis import given, strategies as st

from hardware.drivers.arduino.firmware_profile import FIRMWARES
from hardware.drivers.arduino.virtual.board import Board
from hardware.drivers.pacing import PacingModel, unread_bytes
from hardware.drivers.wire_format import Frame

BAUD = 115200
LETTERS = "bsegtw"


def frame(angles: list[int]) -> Frame:
    text = "".join(f"{letter}{angle:03d}," for letter, angle in zip(LETTERS, angles, strict=False))
    return Frame(tuple(angles), text.encode())


def test_the_bytes_that_wait_are_those_behind_the_first_field() -> None:
    four = frame([90, 90, 90, 0])
    assert [unread_bytes(four, waiting) for waiting in (0, 1, 2)] == [15, 35, 55]


@pytest.mark.parametrize(("ring", "one_waits"), [(54, False), (55, True)])
def test_one_frame_waits_if_the_buffer_then_has_room_for_a_hold(ring: int, one_waits: bool) -> None:
    firmware = dataclasses.replace(FIRMWARES["stock"], ring=ring)
    pacing = PacingModel(firmware, BAUD, frame([90, 90, 90, 0]))
    assert pacing.earliest == pacing.done == -math.inf
    pacing.note_sent(frame([91, 90, 90, 0]), 1.0)
    done = 1.0 + 20 * 10 / BAUD + 5 * firmware.unit_time + 4 * firmware.turn_time
    assert pacing.done == pytest.approx(done)
    assert pacing.earliest == (-math.inf if one_waits else pacing.done)
    pacing.note_sent(frame([91, 90, 90, 3]), 1.01)
    assert pacing.done == pytest.approx(done + 7 * firmware.unit_time + 4 * firmware.turn_time)
    assert pacing.earliest == (pytest.approx(done) if one_waits else pacing.done)


@pytest.mark.parametrize("count", [3, 5])
def test_a_frame_of_another_robot_has_no_step(count: int) -> None:
    pacing = PacingModel(FIRMWARES["stock"], BAUD, frame([90, 90, 90, 0]))
    with pytest.raises(ValueError, match=r"argument 2 is (shorter|longer)"):
        pacing.step(frame([90] * count))


@pytest.mark.slow
@pytest.mark.parametrize("joints", range(1, 7))
@given(data=st.data())
def test_a_hold_at_any_instant_loses_nothing(joints: int, data: st.DataObject) -> None:
    stock = FIRMWARES["stock"]
    held = [90] * joints
    board, pacing = (
        Board(LETTERS[:joints], held, stock, BAUD),
        PacingModel(stock, BAUD, frame(held)),
    )
    now = stock.boot_time
    for _ in range(data.draw(st.integers(1, 12))):
        steps = st.lists(st.integers(-4, 4), min_size=joints, max_size=joints)
        held = [min(180, max(0, h + s)) for h, s in zip(held, data.draw(steps), strict=True)]
        now = max(now + data.draw(st.floats(0.0, 0.2)), pacing.earliest)
        board.receive(frame(held).data, now)
        pacing.note_sent(frame(held), now)
    board.receive(frame(held).data, now + data.draw(st.floats(0.0, 0.2)))
    state = board.state(now + 60.0)
    assert state.lost == 0
    assert state.servos == tuple(held)
