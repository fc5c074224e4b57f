"""Drawings of trees: text, Mermaid, Graphviz DOT and SVG."""

from collections.abc import Callable, Mapping
from html import escape
from typing import NamedTuple

import click

from hardware.printable import printable

from .outline import Entry


class Look(NamedTuple):
    """How drawings show the status of a node.

    Attributes:
        glyph: Character before the name of the node.
        ink: Colour of the text in a terminal.
        fill: Colour of the box in a drawing.
    """

    glyph: str
    ink: str
    fill: str


LOOKS: Mapping[str, Look] = {
    "INVALID": Look("·", "bright_black", "#eeeeee"),
    "RUNNING": Look("▶", "yellow", "#fff2b3"),
    "SUCCESS": Look("✓", "green", "#c8ebc0"),
    "FAILURE": Look("✗", "red", "#f5b7b1"),
    "HALTED": Look("■", "yellow", "#fadfb0"),
}

_WIDTH, _LINE, _GAP = 7.3, 16, 14  # width of a character, height of a line, gap between boxes [px]


def as_text(root: Entry, ports: bool) -> str:
    """Return the tree as text for a terminal, with values and keys if `ports` is True."""
    return "\n".join(_lines(root, "", "", ports))


def _lines(entry: Entry, first: str, rest: str, ports: bool) -> list[str]:
    below = "│ " if entry.children else "  "
    lines = [first + _inked(entry)]
    lines += [f"{rest}{below}  {printable(wire)}" for wire in (entry.wiring() if ports else [])]
    for child in entry.children:
        last = child is entry.children[-1]
        turn, on = ("└─ ", "   ") if last else ("├─ ", "│  ")
        lines += _lines(child, rest + turn, rest + on, ports)
    return lines


def _inked(entry: Entry) -> str:
    if not entry.state:
        return printable(entry.title)
    look = LOOKS[entry.state]
    note = click.style(f"  {printable(entry.note)}", dim=True) if entry.note else ""
    return click.style(f"{look.glyph} {printable(entry.title)}", fg=look.ink) + note


def as_mermaid(root: Entry, ports: bool) -> str:
    """Return a Mermaid flowchart of the tree."""
    numbers = {id(entry): f"n{number}" for number, entry in enumerate(root.walk())}
    lines = ["flowchart TD"]
    for entry in root.walk():
        label = "<br/>".join(_mermaid(line) for line in _label(entry, ports))
        opening, closing = ('["', '"]') if entry.children else ('(["', '"])')
        lines.append(f"    {numbers[id(entry)]}{opening}{label}{closing}")
        lines += [f"    {numbers[id(entry)]} --> {numbers[id(c)]}" for c in entry.children]
        if entry.state:
            lines.append(f"    style {numbers[id(entry)]} fill:{LOOKS[entry.state].fill}")
    return "\n".join(lines)


def _mermaid(text: str) -> str:
    return "".join(c if c.isalnum() or c in " _.,:-+=/$" else f"#{ord(c)};" for c in text)


def as_dot(root: Entry, ports: bool) -> str:
    """Return a Graphviz graph of the tree in DOT."""
    numbers = {id(entry): f"n{number}" for number, entry in enumerate(root.walk())}
    lines = ["digraph tree {", "    ordering=out; node [fontname=Helvetica, fontsize=11];"]
    for entry in root.walk():
        label = "\\n".join(_quoted(line) for line in _label(entry, ports))
        shape = "box" if entry.children else "ellipse"
        fill = f', style=filled, fillcolor="{LOOKS[entry.state].fill}"' if entry.state else ""
        lines.append(f'    {numbers[id(entry)]} [label="{label}", shape={shape}{fill}];')
        lines += [f"    {numbers[id(entry)]} -> {numbers[id(c)]};" for c in entry.children]
    return "\n".join([*lines, "}"])


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


def as_svg(root: Entry, ports: bool) -> str:
    """Return an SVG drawing of the tree, from left to right."""
    labels = {id(entry): _label(entry, ports) for entry in root.walk()}
    shapes: list[str] = []
    columns = _columns(root, labels, 0, {})
    height, _ = _draw(root, labels, columns, 0, 10.0, shapes)
    width = sum(columns.values()) + 40.0 * len(columns)
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
            f'width="{width:.0f}" height="{height:.0f}" font-family="Helvetica, sans-serif" '
            'font-size="12">',
            '<rect width="100%" height="100%" fill="white"/>',
            *shapes,
            "</svg>",
        ]
    )


def _columns(
    entry: Entry, labels: Mapping[int, list[str]], depth: int, widths: dict[int, float]
) -> dict[int, float]:
    """Return the width of every level [px]."""
    own = max(map(len, labels[id(entry)])) * _WIDTH + 16
    widths[depth] = max(widths.get(depth, 0.0), own)
    for child in entry.children:
        _columns(child, labels, depth + 1, widths)
    return widths


def _draw(
    entry: Entry,
    labels: Mapping[int, list[str]],
    columns: Mapping[int, float],
    depth: int,
    top: float,
    shapes: list[str],
) -> tuple[float, float]:
    """Draw a node and all nodes below it. Return the y of their lower edge and its middle [px]."""
    lines = labels[id(entry)]
    left = 10.0 + sum(columns[level] + 40.0 for level in range(depth))
    own, bottom, middles = len(lines) * _LINE + 10.0, top, []
    for child in entry.children:
        bottom, middle = _draw(child, labels, columns, depth + 1, bottom, shapes)
        middles.append(middle)
    bottom = max(bottom, top + own + _GAP)
    middle = (middles[0] + middles[-1]) / 2 if middles else top + own / 2
    middle = max(middle, top + own / 2)
    right = left + columns[depth]
    for end in middles:
        shapes.append(
            f'<path d="M{right:.0f} {middle:.0f}H{right + 20:.0f}V{end:.0f}H{right + 40:.0f}" '
            'fill="none" stroke="#888"/>'
        )
    fill, radius = ("#e8eef7", 3) if entry.children else ("#f3f7e8", 12)
    fill = LOOKS[entry.state].fill if entry.state else fill
    shapes.append(
        f'<rect x="{left:.0f}" y="{middle - own / 2:.0f}" width="{columns[depth]:.0f}" '
        f'height="{own:.0f}" rx="{radius}" fill="{fill}" stroke="#556"/>'
    )
    for number, line in enumerate(lines):
        baseline = middle - own / 2 + 5 + (number + 0.8) * _LINE
        shapes.append(f'<text x="{left + 8:.0f}" y="{baseline:.0f}">{escape(line)}</text>')
    return bottom, middle


def _label(entry: Entry, ports: bool) -> list[str]:
    notes = [entry.note] if entry.note else []
    texts = [entry.title, *notes, *(entry.wiring() if ports else [])]
    return [line for text in texts for line in text.split("\n")]


DRAWINGS: Mapping[str, Callable[[Entry, bool], str]] = {
    "text": as_text,
    "mermaid": as_mermaid,
    "dot": as_dot,
    "svg": as_svg,
}
