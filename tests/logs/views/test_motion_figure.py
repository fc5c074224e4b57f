"""Drawings of motions in space: everything drawn is visible."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from logs.views.motion_figure import MotionDrawing, draw_motion

SQUARE = [(x, y, z) for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.3)]
HIGH = [(x, y, z + 0.2) for x, y, z in SQUARE]


@pytest.mark.parametrize("size", [(7.0, 3.0), (7.0, 9.0)])
def test_the_key_hides_nothing_that_is_drawn(
    size: tuple[float, float], caplog: pytest.LogCaptureFixture
) -> None:
    figure = Figure(figsize=size)
    FigureCanvasAgg(figure)
    sides = figure.subplots(1, 2)
    draw_motion(sides, MotionDrawing([[SQUARE], [SQUARE, HIGH], [HIGH]], [HIGH]))
    figure.draw_without_rendering()
    for axes in sides:
        legend = axes.get_legend()
        assert legend
        assert [text.get_text() for text in legend.get_texts()] == ["start", "end", "bodies"]
        shapes = [drawn for drawn in axes.collections if isinstance(drawn, PolyCollection)]
        colors = [to_hex(np.array(shape.get_facecolor())[0].tolist()) for shape in shapes]
        assert colors == ["#d55e00", "#0072b2", "#777777", "#0072b2"]  # bodies, between, start, end
        corners = np.vstack([path.vertices for each in shapes for path in each.get_paths()])
        top = axes.transData.transform(corners)[:, 1].max()
        assert axes.bbox.y0 < top < legend.get_window_extent().y0
    assert not caplog.records


def test_a_hollow_body_hides_nothing() -> None:
    figure = Figure()
    FigureCanvasAgg(figure)
    sides = figure.subplots(1, 2)
    draw_motion(sides, MotionDrawing([[SQUARE]], [], [], [HIGH]))
    for axes in sides:
        assert [text.get_text() for text in axes.get_legend().get_texts()][-1] == "bodies"
        ((*_, alpha),) = np.array(axes.collections[0].get_facecolor())
        ((*_, edge),) = np.array(axes.collections[0].get_edgecolor())
        assert (alpha, edge) == (0.0, 1.0)


def test_a_held_body_is_drawn_like_other_bodies() -> None:
    figure = Figure()
    FigureCanvasAgg(figure)
    sides = figure.subplots(1, 2)
    draw_motion(sides, MotionDrawing([[SQUARE], [HIGH]], [], [[HIGH], [SQUARE]]))
    for axes in sides:
        assert [text.get_text() for text in axes.get_legend().get_texts()][-1] == "bodies"
        held = axes.collections[-1]
        assert to_hex(np.array(held.get_facecolor())[0].tolist()) == "#d55e00"
        assert len(held.get_paths()) == 2
