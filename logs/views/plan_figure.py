"""Draws a plan: path, positions, speeds, accelerations, and the motion from two sides."""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hardware.loading.dataclass import dataclass

from .figure_file import save
from .motion_figure import MotionDrawing, draw_motion

_LINES = ("#0072B2", "#E69F00", "#CC79A7", "#000000", "#009E73", "#D55E00", "#56B4E9")
_LIMIT = "#999999"


@dataclass(frozen=True, slots=True)
class PlanDrawing:
    """The values of a plan for its figure. The shapes have N samples, W waypoints and J joints.

    Positions are in the unit of each joint: deg or mm. Speeds are in this unit per second,
    accelerations in this unit per second squared.

    Attributes:
        title: Title of the figure.
        joints: Names of the joints, (J,).
        units: Unit of each joint, `deg` or `mm`, (J,).
        times: Time of each sample [s], (N,).
        positions: Positions, (N, J).
        speeds: Speeds, (N, J).
        accelerations: Accelerations, (N, J).
        waypoints: Waypoints of the path, (W, J).
        speed_limits: Limits of the speeds, (J,).
        acceleration_limits: Limits of the accelerations, (J,).
        motion: Outlines of the arm and the bodies during the motion.
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


def draw_plan(plan: PlanDrawing, output: Path) -> None:
    """Draw a plan into a figure, and write the figure to a file.

    Args:
        plan: The values to draw.
        output: File to write. Its suffix sets the format.

    Raises:
        OSError: The file cannot be written.
    """
    figure = Figure(figsize=(7.16, 8.2), dpi=200, layout="constrained")
    axes = figure.subplots(3, 2, height_ratios=(1.0, 1.0, 1.5))
    _path(axes[0, 0], plan)
    _over_time(axes[0, 1], plan, plan.positions, f"position {_unit(plan)}", ())
    _over_time(axes[1, 0], plan, plan.speeds, f"speed {_unit(plan, '/s')}", plan.speed_limits)
    _over_time(
        axes[1, 1],
        plan,
        plan.accelerations,
        f"acceleration {_unit(plan, '/s²')}",
        plan.acceleration_limits,
    )
    draw_motion(axes[2], plan.motion)
    figure.legend(
        *axes[0, 1].get_legend_handles_labels(),
        title=plan.title,
        title_fontsize=9,
        fontsize=7,
        ncols=5,
        frameon=False,
        loc="outside upper center",
    )
    save(figure, output)


def _path(axes: Axes, plan: PlanDrawing) -> None:
    """Draw the path in joint space: positions of the other joints over those of the first joint."""
    if len(plan.joints) < 2:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "no path: there is only one joint", ha="center", fontsize=7)
        return
    columns = list(zip(*plan.positions, strict=True))
    corners = list(zip(*plan.waypoints, strict=True))
    axes.set_xlabel(f"{plan.joints[0]} [{plan.units[0]}]", fontsize=7)
    axes.set_ylabel(f"other joints {_unit(plan)}", fontsize=7)
    axes.tick_params(labelsize=6)
    for line, name, column, corner in zip(
        _LINES[1:] * len(columns), plan.joints[1:], columns[1:], corners[1:], strict=False
    ):
        axes.plot(columns[0], column, color=line, linewidth=1, label=name)
        axes.plot(corners[0], corner, "o:", color=line, linewidth=0.5, markersize=2)
    axes.set_title("path in joint space; dots and thin lines: waypoints", fontsize=7)


def _unit(plan: PlanDrawing, per: str = "") -> str:
    return "[" + " or ".join(unit + per for unit in dict.fromkeys(plan.units)) + "]"


def _over_time(
    axes: Axes,
    plan: PlanDrawing,
    rows: Sequence[Sequence[float]],
    label: str,
    limits: Sequence[float],
) -> None:
    axes.set_ylabel(label, fontsize=7)
    axes.set_xlabel("time [s]", fontsize=7)
    axes.tick_params(labelsize=6)
    for name, line, column in zip(
        plan.joints, cycle(_LINES), zip(*rows, strict=True), strict=False
    ):
        axes.plot(plan.times, column, color=line, linewidth=1, label=name)
    for limit in sorted({sign * limit for limit in limits for sign in (-1, 1)}):
        axes.axhline(limit, color=_LIMIT, linewidth=0.7, linestyle="--")
    if limits:
        axes.set_title("dashed: limits", fontsize=7)
