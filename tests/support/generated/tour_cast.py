"""Two pictures of one run, for README and site: what a terminal shows, and its plot.

`python -m tests.support.generated.tour_cast` runs `armtree run 1` and `armtree log plot`. It writes
`tour.svg` and `run.svg` in `docs/pages/assets/`. Look at them afterwards.
"""

import subprocess
import sys
import time
from collections.abc import Sequence
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.support.command_line.screen import Screen, on_screen
from tests.support.paths import ROOT

ASSETS = ROOT / "docs" / "pages" / "assets"
COLUMNS, ROWS = 76, 18
_STEP = 0.3  # least time between two pictures [s]
_BOOT = 0.6  # how long the boot of the board is shown [s]
_HOLD = 3.0  # how long the end is shown [s]
_WIDTH, _LINE = 8.43, 18  # of a character and a line [px]
_COLOURS = {"✓": "#3fb68b", "●": "#4aa3ff", "▶": "#4aa3ff", "✗": "#ff6b5e", "$": "#ff9d5c"}

Shot = tuple[float, list[str]]


def shots(plot: Path | None = None) -> list[Shot]:
    """Run task 1, and return what the terminal showed, each with its time [s].

    Args:
        plot: File for the plot of the recording, or None.
    """
    found: list[Shot] = []
    begun = time.monotonic()

    def look(screen: Screen, _: object) -> None:
        now = time.monotonic() - begun
        if screen.alternate and (not found or now - found[-1][0] >= _STEP):
            found.append((now, screen.lines))

    screen = Screen(COLUMNS, ROWS - 1)
    with TemporaryDirectory() as folder:
        armtree = [sys.executable, "-P", "-m", "armtree"]
        words = ("run", "1", "--port", "virtual", "--recordings", f"{folder}/recordings")
        status = on_screen([*armtree, *words], screen, {}, look)
        assert status == 0
        if plot:
            (recording,) = Path(folder, "recordings").glob("*.mcap")
            subprocess.run([*armtree, "log", "plot", recording, "-o", plot], check=True)
    last = [line.replace(folder + "/", "") for line in screen.lines]
    return _without_boot([*found, (time.monotonic() - begun, last[: ROWS - 1])])


def _without_boot(found: list[Shot]) -> list[Shot]:
    """Cut the beginning, in which only a countdown moves."""
    moves = next(when for when, lines in found if not any(" boot" in line for line in lines))
    return [(when, lines) for when, lines in found if when >= moves - _BOOT]


def svg(pictures: Sequence[Shot]) -> str:
    """Return pictures as an SVG that shows one after the other, for ever."""
    first = pictures[0][0]
    begins = [when - first for when, _ in pictures]
    whole = begins[-1] + _HOLD
    parts, styles = [], []
    for number, ((_, lines), begin) in enumerate(zip(pictures, begins, strict=True)):
        end = begins[number + 1] if number + 1 < len(begins) else whole
        start, stop = (f"{100 * each / whole:.2f}%" for each in (begin, end))
        before = f"0%{{opacity:0}}{start}{{opacity:0}}" if number else ""
        after = f"{stop}{{opacity:0}}" if end < whole else ""
        styles.append(f"@keyframes p{number}{{{before}{start}{{opacity:1}}{after}}}")
        styles.append(f"#p{number}{{animation:p{number} {whole:.1f}s step-end infinite}}")
        rows = "".join(_row(line, 1 + row) for row, line in enumerate(lines) if line)
        shown = "" if number == len(pictures) - 1 else ' opacity="0"'  # without animation: the end
        parts.append(f'<g id="p{number}"{shown}>{rows}</g>')
    width, height = round(COLUMNS * _WIDTH) + 24, ROWS * _LINE + 28
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-size="14" '
        'font-family="ui-monospace,Menlo,Consolas,monospace" fill="#d7dce2">\n'
        f"<style>{''.join(styles)}</style>\n"
        f'<rect width="{width}" height="{height}" rx="8" fill="#1b1f24"/>\n'
        + "\n".join([_row("$ armtree run 1", 0), *parts])
        + "\n</svg>\n"
    )


def _row(line: str, row: int) -> str:
    text = escape(line).replace(" ", "\u00a0")  # several spaces stay several
    for sign, colour in _COLOURS.items():
        text = text.replace(sign, f'<tspan fill="{colour}">{sign}</tspan>')
    return f'<text x="12" y="{24 + row * _LINE}">{text}</text>'


if __name__ == "__main__":
    (ASSETS / "tour.svg").write_text(svg(shots(ASSETS / "run.svg")))
