"""The pictures of a run show what the program shows today."""

import re
from html import unescape
from pathlib import Path

import pytest

from tests.support.generated.tour_cast import ASSETS, shots, svg


def end_of(picture: str) -> list[str]:
    """The lines at the end of a moving picture of the terminal, every number as 0."""
    last = picture.rpartition('<g id="p')[2]
    lines = re.findall(r"<text[^>]*>(.*?)</text>", last)
    return [re.sub(r"[\d.]+", "0", unescape(re.sub("<[^>]+>", "", line))) for line in lines]


def words_of(plot: Path) -> set[str]:
    """The texts of a plot, every number as 0. They are drawn as curves, with the text beside."""
    texts = re.findall("<!-- (.*?) -->", plot.read_text())
    return {re.sub(r"[\d.]+", "0", text) for text in texts}


@pytest.mark.slow
def test_they_show_what_a_run_shows_today(tmp_path: Path) -> None:
    shown, drawn = end_of((ASSETS / "tour.svg").read_text()), words_of(ASSETS / "run.svg")
    assert len(shown) > 5
    assert {"PlanGripper", "SUCCEEDED, 0 s"} < drawn
    plot = tmp_path / "run.svg"
    assert end_of(svg(shots(plot))) == shown, "python -m tests.support.generated.tour_cast"
    assert words_of(plot) == drawn, "python -m tests.support.generated.tour_cast"
