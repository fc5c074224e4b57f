"""How far servos were turned by hand."""

import pytest
from hypothesis import given, strategies as st

from hardware.bring_up.sweep import Swept


def swept(*positions: int) -> Swept:
    first, *more = positions
    found = Swept(4096, first, first, first)
    for position in more:
        found.move(position)
    return found


def test_the_range_is_what_was_passed() -> None:
    found = swept(2000, 1000, 2500, 3000, 2000)
    assert (found.least, found.most, found.range) == (1000, 3000, 2000)
    assert not found.seam_inside
    assert found.kept(None, centre=False) == {"least": 1000, "most": 3000}
    assert found.kept(7, centre=False) == {"homing": 7, "least": 1000, "most": 3000}


@pytest.mark.parametrize("positions", [(3000, 4000, 500), (500, 4000, 3000), (100, 4090)])
def test_a_seam_inside_is_found(positions: tuple[int, ...]) -> None:
    assert swept(*positions).seam_inside


def test_a_sweep_of_the_next_turn_has_no_seam() -> None:
    found = Swept(4096, 0, 4096 + 10, 4096 + 900)
    assert not found.seam_inside
    assert found.kept(None, centre=False) == {"least": 10, "most": 900}


def test_a_whole_turn_is_found() -> None:
    assert swept(0, 1500, 3000, 400).whole_turn


@given(
    raw=st.integers(0, 4095),
    homing=st.integers(-2047, 2047),
    down=st.integers(0, 2000),
    up=st.integers(0, 2000),
)
def test_centred_the_range_lies_around_the_middle(
    raw: int, homing: int, down: int, up: int
) -> None:
    """A servo reports its raw position less its offset, within a turn."""

    def reported(turned: int, offset: int) -> int:
        return (raw + turned - offset) % 4096

    found = Swept(4096, *[reported(0, homing)] * 3)
    for turned in (-down // 2, -down, 0, up // 2, up):
        found.move(reported(turned, homing))
    kept = found.kept(homing, centre=True)
    assert -2048 < kept["homing"] < 2048
    assert (kept["least"] + kept["most"]) // 2 == 2048
    ends = reported(-down, kept["homing"]), reported(up, kept["homing"])
    assert ends == pytest.approx((kept["least"], kept["most"]), abs=1)
