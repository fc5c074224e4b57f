"""Draws a run: joints, frames, tree and lifecycle over time, and the motions in space."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import cycle, pairwise
from math import degrees
from pathlib import Path
from textwrap import wrap

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from hardware.loading.dataclass import dataclass
from logs.records.records import goal_title

from .figure_file import save, widen
from .motion_figure import MotionDrawing, draw_motion
from .timeline import Row, Timeline, Trace, timeline

# Colours of Okabe and Ito, which colour-blind readers can distinguish, also in grey print.
_STATES = {"RUNNING": "#56B4E9", "SUCCESS": "#009E73", "FAILURE": "#D55E00", "INVALID": "#999999"}
_SYMBOLS = {"RUNNING": "", "SUCCESS": "o", "FAILURE": "X", "INVALID": "D"}
_UNKNOWN = "#000000"
_LINES = ("#0072B2", "#E69F00", "#CC79A7", "#000000", "#009E73", "#D55E00")
_HOLD = "#D55E00"
_INK, _FAINT = "#333333", "#E4E4E4"
_LIFECYCLE = {
    "active": "#6E6E6E",
    "inactive": "#BDBDBD",
    "unconfigured": "#EDEDED",
    "finalized": "#FFFFFF",
    "errorprocessing": "#D55E00",
}
_IN_TRANSITION = "#9CC3DB"
_SHORT_S = 0.1  # shorter times are shown in milliseconds [s]
_DPI = 300
_WIDTH = 7.16  # two columns of an IEEE page; this and all following lengths are in inches
_LEFT, _RIGHT, _TOP, _BOTTOM, _GAP = 1.25, 0.75, 0.48, 0.42, 0.07
_CURVE, _CURVES, _RUG, _NODE, _BAND = 0.22, 0.75, 0.2, 0.165, 0.18
_LETTER, _LINE, _INDENT, _EDGE = 0.066, 0.125, 0.12, 0.1
_LETTERS_PER_LINE = 125
_MARK_LEVELS = 3  # rows of words above the curves
_SCENE, _SCENE_TITLE, _MOST_SCENES = 3.0, 0.35, 12


@dataclass(frozen=True, slots=True)
class MotionScene:
    """A drawing of the motions in one world.

    Attributes:
        title: Title above the drawing.
        motion: Outlines of the arm and the bodies during the motions.
    """

    title: str
    motion: MotionDrawing


def plot(recording: Path, output: Path, scenes: Sequence[MotionScene] = ()) -> None:
    """Draw a recorded run: joints, frames, tree and lifecycle over time.

    Also draws runs without frames, canceled runs, and recordings that were cut off.

    Args:
        recording: The recording, finished or not.
        output: File to write or overwrite. Its suffix sets the format. The figure is as wide as
            two columns of a paper.
        scenes: Motions in space, drawn below the other panels. Only the first twelve are drawn.

    Raises:
        RecordingError: The recording cannot be read.
        OSError: The file cannot be written.
    """
    draw(timeline(recording), output, scenes)


def draw(run: Timeline, output: Path, scenes: Sequence[MotionScene] = (), dpi: int = _DPI) -> None:
    """Draw a run into a figure, and write the figure to a file.

    Args:
        run: The timeline of the run.
        output: File to write. Its suffix sets the format.
        scenes: The motions of the run in space. Only the first twelve are drawn.
        dpi: Resolution [pixels per inch]. The figure is 7.16 inches wide.

    Raises:
        OSError: The file cannot be written.
    """
    style = rc_context(
        {
            "font.size": 8,
            "axes.linewidth": 0.6,
            "axes.edgecolor": _INK,
            "axes.labelcolor": _INK,
            "text.color": _INK,
            "xtick.color": _INK,
            "ytick.color": _INK,
            "xtick.major.width": 0.6,
            "ytick.major.width": 0.6,
            "xtick.labelsize": 7,
            "ytick.labelsize": 7,
        }
    )
    with style:
        figure = _figure(run, _fewer(scenes))
        figure.set_dpi(dpi)
        save(figure, output)


def _figure(run: Timeline, scenes: Sequence[MotionScene]) -> Figure:
    groups = _by_group(run.traces)
    curves = [_CURVES + _CURVE * len(traces) for traces in groups.values()]
    errors = [_CURVES] if any(trace.measured for trace in run.traces) else []
    heights = [*curves, *errors, _RUG, _NODE * _tree_lines(run.rows), _BAND]
    cut = "" if run.complete else "Recording cut off. "
    cause = wrap(cut + (run.result.message if run.result else ""), _LETTERS_PER_LINE)
    top = _TOP + _LINE * len(cause)
    tall = top + sum(heights) + _GAP * len(heights) + _BOTTOM + _SCENE * len(scenes)
    figure = Figure(figsize=(_WIDTH, tall), dpi=_DPI)
    panels = _panels(figure, heights, top, run)
    colours = dict(zip((trace.joint for trace in run.traces), cycle(_LINES), strict=False))
    for panel, (group, traces) in zip(panels, groups.items(), strict=False):
        _draw_joints(panel, group, traces, colours)
    if errors:
        _draw_errors(panels[-4], run.traces, colours)
    _draw_frames(panels[-3], run)
    _draw_tree(panels[-2], run.rows)
    _draw_lifecycle(panels[-1], run)
    _draw_marks(panels, run)
    _draw_title(figure, run, cause)
    for number, scene in enumerate(reversed(scenes)):
        _draw_scene(figure, scene, _SCENE * number)
    return figure


def _fewer(scenes: Sequence[MotionScene]) -> Sequence[MotionScene]:
    """Return the first twelve scenes, because the height of a figure is limited."""
    if len(scenes) <= _MOST_SCENES:
        return scenes
    *before, last = scenes[:_MOST_SCENES]
    title = f"{last.title} (of {len(scenes)} worlds, {_MOST_SCENES} are drawn)"
    return [*before, replace(last, title=title)]


def _by_group(traces: Iterable[Trace]) -> dict[str, list[Trace]]:
    groups: dict[str, list[Trace]] = {}
    for trace in traces:
        groups.setdefault(trace.group, []).append(trace)
    return groups


def _panels(figure: Figure, heights: Sequence[float], top: float, run: Timeline) -> list[Axes]:
    """Return panels of the given heights [in], one below the other, with the same time axis."""
    left, right = _margins(run)
    tall = figure.get_figheight()
    panels: list[Axes] = []
    floor = tall - top
    for height in heights:
        floor -= height
        width = _WIDTH - left - right
        panels.append(figure.add_axes((left / _WIDTH, floor / tall, width / _WIDTH, height / tall)))
        floor -= _GAP
    for panel in panels:
        panel.set_xlim(run.start, run.end + 0.01 * (run.end - run.start))
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(axis="x", labelbottom=False, bottom=False)
    _draw_time_axis(panels[-1], run)
    return panels


def _margins(run: Timeline) -> tuple[float, float]:
    """Return the left margin [in] for names of nodes, and the right margin for names of joints."""
    left = max((_INDENT * row.depth + _LETTER * len(row.name) for row in run.rows), default=0.0)
    right = max((_LETTER * len(trace.joint) for trace in run.traces), default=0.0)
    return max(_LEFT, left + 2 * _EDGE), max(_RIGHT, right + 2 * _EDGE)


def _draw_time_axis(panel: Axes, run: Timeline) -> None:
    short = run.end - run.start < _SHORT_S
    panel.tick_params(axis="x", labelbottom=True, bottom=True)
    panel.xaxis.set_major_locator(MaxNLocator(10))
    if short:
        panel.xaxis.set_major_formatter(lambda seconds, _: f"{seconds * 1e3:g}")
    zero = "goal" if run.goal else "beginning"
    panel.set_xlabel(f"time since the {zero} [{'ms' if short else 's'}]")


def _draw_joints(panel: Axes, group: str, traces: Sequence[Trace], colours: dict[str, str]) -> None:
    for trace in traces:
        angles = [degrees(position) for position in trace.positions]
        colour = colours[trace.joint]
        panel.step(trace.times, angles, where="post", color=colour, linewidth=1.1)
        measured = [degrees(position) for position in trace.measured]
        panel.plot(trace.measured_times, measured, ":", color=colour, linewidth=1.6, alpha=0.7)
        leader = [degrees(position) for position in trace.leader]
        panel.plot(trace.leader_times, leader, "--", color=colour, linewidth=0.7, alpha=0.7)
    panel.margins(y=0.08)
    widen(panel)
    panel.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 3, 5, 10]))
    panel.grid(axis="y", color=_FAINT, linewidth=0.5)
    panel.set_axisbelow(True)
    kinds = ["commanded"]
    kinds += ["measured (dots)"] if any(trace.measured for trace in traces) else []
    kinds += ["leader (dashes)"] if any(trace.leader for trace in traces) else []
    words = "\n".join([group, *kinds, "angle [°]"])
    _name_row(panel, words, sum(panel.get_ylim()) / 2, 0)
    _name_curves(panel, traces, colours)


def _draw_errors(panel: Axes, traces: Sequence[Trace], colours: dict[str, str]) -> None:
    for trace in traces:
        errors = [degrees(error) for error in trace.errors]
        panel.plot(trace.measured_times, errors, color=colours[trace.joint], linewidth=0.9)
    panel.margins(y=0.08)
    widen(panel)
    panel.yaxis.set_major_locator(MaxNLocator(4))
    panel.grid(axis="y", color=_FAINT, linewidth=0.5)
    _name_row(panel, "measured minus\ncommanded [°]", sum(panel.get_ylim()) / 2, 0)


def _name_curves(panel: Axes, traces: Sequence[Trace], colours: dict[str, str]) -> None:
    """Write each joint's name at the end of its curve. Move overlapping names apart."""
    low, high = panel.get_ylim()
    pitch = _LINE / (_CURVES + _CURVE * len(traces)) * (high - low)
    heights = _apart([degrees(trace.positions[-1]) for trace in traces], pitch)
    for trace, height in zip(traces, heights, strict=True):
        _beside(panel, trace.joint, height, colours[trace.joint])


def _apart(wanted: Sequence[float], pitch: float) -> list[float]:
    """Return heights for names: close to the wanted heights, but at least `pitch` apart."""
    order = sorted(range(len(wanted)), key=lambda i: (wanted[i], -i))
    placed = list(wanted)
    for below, above in pairwise(order):
        placed[above] = max(placed[above], placed[below] + pitch)
    shift = (sum(placed) - sum(wanted)) / len(placed)
    return [height - shift for height in placed]


def _draw_frames(panel: Axes, run: Timeline) -> None:
    _clear(panel)
    thin = min(0.7, 150 / max(len(run.frames), 1))
    panel.vlines(run.frames, 0.1, 0.9, color=_INK, linewidth=thin)
    panel.vlines(run.holds, -0.1, 1.1, color=_HOLD, linewidth=1.4, clip_on=False)
    panel.set_ylim(0, 1)
    _name_row(panel, "frames sent", 0.5, 0)
    count = str(len(run.frames)) if run.frames else "none"
    _beside(panel, f"{count} + hold" if run.holds else count, 0.5)


def _draw_tree(panel: Axes, rows: Sequence[Row]) -> None:
    _clear(panel)
    panel.set_ylim(_tree_lines(rows) - 0.5, -0.5)
    for place, row in enumerate(rows):
        panel.axhline(place, color=_FAINT, linewidth=0.5, zorder=0)
        _name_row(panel, row.name, place, row.depth)
        _draw_node(panel, row, place)
    if rows:
        _explain_states(panel)
    else:
        _name_row(panel, "no tree", 0, 0)


def _tree_lines(rows: Sequence[Row]) -> int:
    return max(len(rows), len(_STATES) - 1) if rows else 1  # at least the height of the legend


def _draw_node(panel: Axes, row: Row, place: int) -> None:
    for span in row.spans:
        colour = _STATES.get(span.state, _UNKNOWN)
        tall = 0.66 if span.state == "RUNNING" else 0.2
        panel.broken_barh(
            [(span.start, span.end - span.start)],
            (place - tall / 2, tall),
            facecolors=colour,
            linewidth=0,
        )
        # A state may be narrower than a pixel. A symbol makes it visible, also without colour.
        symbol = _SYMBOLS.get(span.state, "d")
        panel.plot([span.start], [place], symbol or "|", color=colour, ms=4, mew=0.8, clip_on=False)


def _explain_states(panel: Axes) -> None:
    """Draw the legend of the node states into the right margin."""
    rows = panel.get_ylim()[0] + 0.5
    for number, (state, colour) in enumerate(_STATES.items()):
        y = (rows - 1) / 2 + (number - 1.5) * 0.85
        panel.plot(
            [1.03],
            [y],
            _SYMBOLS[state] or "s",
            color=colour,
            ms=4,
            clip_on=False,
            transform=panel.get_yaxis_transform(),
        )
        _write(panel, state.lower(), (1.0, y), 0.23, 7, _INK)


def _draw_lifecycle(panel: Axes, run: Timeline) -> None:
    panel.set_yticks([])
    panel.spines["left"].set_visible(False)
    panel.set_ylim(0, 1)
    for span in run.lifecycle:
        colour = _LIFECYCLE.get(span.state, _IN_TRANSITION)
        panel.axvspan(span.start, span.end, facecolor=colour, edgecolor="white", linewidth=0.4)
        start, end = max(span.start, run.start), min(span.end, run.end)
        if end - start > 0.0115 * len(span.state) * (run.end - run.start):
            ink = "white" if span.state in ("active", "errorprocessing") else _INK
            middle = (start + end) / 2
            panel.text(middle, 0.46, span.state, ha="center", va="center", color=ink, fontsize=7)
    _name_row(panel, "lifecycle", 0.5, 0)
    if not run.lifecycle:
        _beside(panel, "no change", 0.5)


def _draw_marks(panels: Sequence[Axes], run: Timeline) -> None:
    taken, level, written = -1.0, 0, ""
    for time, what in run.marks:
        for panel in panels[:-1]:
            panel.axvline(time, color=_INK, linewidth=0.6, linestyle=(0, (3, 2)), zorder=0.5)
        place = (time - run.start) / (run.end - run.start)
        if place < taken and what == written:
            continue  # of equal marks that follow each other closely, only the first has a label
        level = (level + 1) % _MARK_LEVELS if place < taken else 0
        taken, written = place + 0.012 * len(what), what
        panels[0].annotate(
            what,
            (time, 1.0),
            (2, 2 + 8 * level),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            fontsize=7,
            style="italic",
        )


def _draw_scene(figure: Figure, scene: MotionScene, floor: float) -> None:
    """Draw a scene from two sides. Its lower edge is `floor` [in] above the figure's lower edge."""
    tall = figure.get_figheight()
    left, across = 0.5, _WIDTH / 2 - 0.6
    up = _SCENE - _SCENE_TITLE - 0.55
    sides = [
        figure.add_axes(
            ((left + _WIDTH / 2 * side) / _WIDTH, (floor + 0.4) / tall, across / _WIDTH, up / tall)
        )
        for side in range(2)
    ]
    draw_motion(sides, scene.motion)
    place = (floor + _SCENE - 0.1) / tall
    figure.text(_EDGE / _WIDTH, place, scene.title, va="top")


def _draw_title(figure: Figure, run: Timeline, cause: Sequence[str]) -> None:
    tall = figure.get_figheight()
    left, top = _EDGE / _WIDTH, 1 - 0.07 / tall
    title = goal_title(run.goal.task, run.goal.name) if run.goal else "no goal recorded"
    figure.text(left, top, title[0].upper() + title[1:], fontsize=10, weight="bold", va="top")
    figure.text(1 - left, top, _outcome(run), fontsize=10, ha="right", va="top")
    figure.text(left, 1 - 0.26 / tall, "\n".join(cause), fontsize=7.5, va="top")


def _outcome(run: Timeline) -> str:
    if not run.result or not run.goal:
        return "no result recorded" if run.goal else ""
    seconds = run.result.duration
    took = f"{seconds:.2f} s" if seconds >= _SHORT_S else f"{seconds * 1e3:.1f} ms"
    before = run.result.queued(run.goal)
    queued = f", {before:.2f} s of it in the queue" if before else ""
    return f"{run.result.state}, {took}{queued}"


def _clear(panel: Axes) -> None:
    panel.set_yticks([])
    panel.spines[["left", "bottom"]].set_visible(False)


def _name_row(panel: Axes, name: str, y: float, depth: int) -> None:
    left = panel.get_position().x0 * _WIDTH
    _write(panel, name, (0.0, y), _EDGE + _INDENT * depth - left, 8, _INK)


def _beside(panel: Axes, text: str, y: float, colour: str = _INK) -> None:
    _write(panel, text, (1.0, y), 0.06, 7.5, colour)


def _write(
    panel: Axes, text: str, at: tuple[float, float], right: float, size: float, colour: str
) -> None:
    """Write a text into a figure. It starts `right` inches to the right of the point `at`."""
    panel.annotate(
        text,
        at,
        (72 * right, 0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        fontsize=size,
        color=colour,
        va="center",
        annotation_clip=False,
    )
