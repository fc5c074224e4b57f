"""The moving picture of the terminal shows what the program shows today."""

import re
from html import unescape

import pytest

from tests.support.generated.tour_cast import ASSETS, shots, svg


def end_of(picture: str) -> list[str]:
    """The lines at the end of a picture, every number as 0."""
    last = picture.rpartition('<g id="p')[2]
    lines = re.findall(r"<text[^>]*>(.*?)</text>", last)
    return [re.sub(r"[\d.]+", "0", unescape(re.sub("<[^>]+>", "", line))) for line in lines]


@pytest.mark.slow
def test_it_ends_as_a_run_does_today() -> None:
    shown = end_of((ASSETS / "tour.svg").read_text())
    assert len(shown) > 5
    assert end_of(svg(shots())) == shown, "python -m tests.support.generated.tour_cast"
