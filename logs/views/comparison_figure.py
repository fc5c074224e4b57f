"""Draws the joints of two runs into one figure."""

from math import degrees
from pathlib import Path

from matplotlib.figure import Figure

from .comparison import Comparison
from .figure_file import save, widen

_STYLES = (("#0072B2", "-", 2.2), ("#D55E00", "--", 1.1))


def draw_comparison(both: Comparison, output: Path) -> None:
    """Draw the positions of each joint in two runs into a figure, and write the figure to a file.

    Args:
        both: The comparison of the two runs.
        output: File to write. Its suffix sets the format.

    Raises:
        OSError: The file cannot be written.
    """
    joints = list(both.joints)
    rows = max(1, len(joints))
    figure = Figure(figsize=(7.16, 0.8 + 1.3 * rows), dpi=300, layout="constrained")
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for joint, panel in zip(joints, panels, strict=False):
        for run, (colour, line, width) in zip(both.runs, _STYLES, strict=True):
            column = run.joints.index(joint)
            angles = [degrees(row[column]) for row in run.positions]
            panel.step(
                run.times, angles, line, where="post", color=colour, linewidth=width,
                label=run.path.name,
            )  # fmt: skip
        widen(panel)
        panel.set_ylabel(f"{joint}\ncommanded [°]", fontsize=8)
        panel.tick_params(labelsize=7)
        panel.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel("time since the first frame [s]", fontsize=8)
    if joints:
        panels[0].legend(
            fontsize=7, frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=2
        )
    save(figure, output)
