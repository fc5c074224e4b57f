"""A plan on paper: its joints, speeds and accelerations, and the arm's sweep from two sides."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .figure_file import save
from .motion_figure import MotionDrawing, draw_motion

_LINES = ("#0072B2", "#E69F00", "#CC79A7", "#000000", "#009E73", "#D55E00", "#56B4E9")
_LIMIT = "#999999"


@dataclass(frozen=True)
class PlanDrawing:
    """What is drawn of a plan; N samples, J joints.

    Attributes:
        title: Above it.
        joints: Their names (J,).
        units: Of their positions: rad or m (J,).
        times: Of the samples (N,) [s].
        positions: (N, J).
        speeds: Per second (N, J).
        accelerations: Per second squared (N, J).
        waypoints: Of the polyline (W, J).
        speed_limits: (J,).
        acceleration_limits: (J,).
        motion: The motion in space.
    """

    title: str
    joints: Sequence[str]
    units: Sequence[str]
    times: Sequence[float]
    positions: Sequence[Sequence[float]]
    speeds: Sequence[Sequence[float]]
    accelerations: Sequence[Sequence[float]]
    waypoints: Sequence[Sequence[float]]
    speed_limits: Sequence[float]
    acceleration_limits: Sequence[float]
    motion: MotionDrawing


def draw_plan(picture: PlanDrawing, output: Path) -> None:
    """Draws a plan to a file, as its suffix says.

    Raises:
        OSError: The file cannot be written.
    """
    figure = Figure(figsize=(7.16, 8.2), dpi=200, layout="constrained")
    axes = figure.subplots(3, 2, height_ratios=(1.0, 1.0, 1.5))
    _path(axes[0, 0], picture)
    _over_time(axes[0, 1], picture, picture.positions, f"position {_unit(picture)}", ())
    _over_time(
        axes[1, 0], picture, picture.speeds, f"speed {_unit(picture, '/s')}", picture.speed_limits
    )
    _over_time(
        axes[1, 1],
        picture,
        picture.accelerations,
        f"acceleration {_unit(picture, '/s²')}",
        picture.acceleration_limits,
    )
    draw_motion(axes[2], picture.motion)
    figure.legend(
        *axes[0, 1].get_legend_handles_labels(),
        title=picture.title,
        title_fontsize=9,
        fontsize=7,
        ncols=5,
        frameon=False,
        loc="outside upper center",
    )
    save(figure, output)


def _path(axes: Axes, picture: PlanDrawing) -> None:
    """The path in joint space: the second joint and those after it over the first."""
    if len(picture.joints) < 2:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "one joint: its path is a line", ha="center", fontsize=7)
        return
    columns = list(zip(*picture.positions, strict=True))
    corners = list(zip(*picture.waypoints, strict=True))
    axes.set_xlabel(f"{picture.joints[0]} [{picture.units[0]}]", fontsize=7)
    axes.set_ylabel(f"other joints {_unit(picture)}", fontsize=7)
    axes.tick_params(labelsize=6)
    for line, name, column, corner in zip(
        _LINES[1:] * len(columns), picture.joints[1:], columns[1:], corners[1:], strict=False
    ):
        axes.plot(columns[0], column, color=line, linewidth=1, label=name)
        axes.plot(corners[0], corner, "o:", color=line, linewidth=0.5, markersize=2)
    axes.set_title("path in joint space, dots: waypoints", fontsize=7)


def _unit(picture: PlanDrawing, per: str = "") -> str:
    return "[" + " or ".join(unit + per for unit in dict.fromkeys(picture.units)) + "]"


def _over_time(
    axes: Axes,
    picture: PlanDrawing,
    rows: Sequence[Sequence[float]],
    label: str,
    limits: Sequence[float],
) -> None:
    axes.set_ylabel(label, fontsize=7)
    axes.set_xlabel("time [s]", fontsize=7)
    axes.tick_params(labelsize=6)
    for name, line, column in zip(
        picture.joints, cycle(_LINES), zip(*rows, strict=True), strict=False
    ):
        axes.plot(picture.times, column, color=line, linewidth=1, label=name)
    for limit in sorted({sign * limit for limit in limits for sign in (-1, 1)}):
        axes.axhline(limit, color=_LIMIT, linewidth=0.7, linestyle="--")
    if limits:
        axes.set_title("dashed: limits", fontsize=7)
