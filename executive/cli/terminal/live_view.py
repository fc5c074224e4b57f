"""The live view of a run in a terminal: tree, progress and outcome."""

import sys
import threading
from dataclasses import replace
from typing import Self, TextIO, cast

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text
from rich.tree import Tree as Branch

import logs
from executive.api.events import QuestionStatus
from executive.api.outcome import Outcome
from hardware.printable import printable

from .streams import LastingStream

_HALTED = "HALTED"  # INVALID after RUNNING

# status: glyph and style
_STYLES = {
    "INVALID": ("·", "dim"),
    "RUNNING": ("▶", "bold yellow"),
    "SUCCESS": ("✓", "green"),
    "FAILURE": ("✗", "bold red"),
    _HALTED: ("■", "bold yellow"),
}


class LiveView:
    """Draws the tree of the running goal.

    Args:
        console: Console to draw on. Default: standard output.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(file=cast(TextIO, LastingStream(sys.stdout)))
        self._lock = threading.Lock()
        self._live: Live | None = None
        self._percentage: int | None = None
        self._clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self._stop()

    def say(self, text: str) -> None:
        """Print a line above the picture."""
        self._console.print(printable(text), highlight=False, markup=False)

    def watch(self, record: logs.Record | QuestionStatus) -> None:
        """Process an event. The picture is redrawn periodically."""
        if isinstance(record, QuestionStatus):
            if record.open:
                self.say(record.text_with_command())
            return
        with self._lock:
            match record:
                case logs.Goal():
                    self._clear()
                    self._title = printable(logs.goal_title(record.task, record.name))
                case logs.NodeStatus():
                    self._update(record)
                case logs.Feedback():
                    self._percentage, self._phase = record.percentage, printable(record.phase)
                case logs.Sent():
                    self._frame = printable(record.text)
                case logs.Transition():
                    self._arm = printable(record.goal)
                case logs.Result():
                    self._percentage = 100 if record.success else self._percentage
        if isinstance(record, logs.Goal):
            self._start()

    def report(self, outcome: Outcome) -> None:
        """Keep the last picture and print the outcome."""
        self._stop()
        style = (
            "green" if outcome.success else "yellow" if outcome.code.startswith("goal.c") else "red"
        )
        self._console.print(Text(printable(outcome.text()), style=style), highlight=False)

    def _update(self, record: logs.NodeStatus) -> None:
        record = replace(record, name=printable(record.name), message=printable(record.message))
        before = self._nodes.get(record.path)
        if record.status == "INVALID" and before and before.status == "RUNNING":
            record = replace(record, status=_HALTED)
        self._nodes[record.path] = record

    def _clear(self) -> None:
        self._nodes: dict[str, logs.NodeStatus] = {}
        self._title = self._phase = self._frame = ""
        self._percentage = None
        self._arm = getattr(self, "_arm", "unconfigured")

    def _start(self) -> None:
        self._stop()
        self._live = Live(
            console=self._console, get_renderable=self._draw, refresh_per_second=10, transient=False
        )
        self._live.start()

    def _stop(self) -> None:
        live, self._live = self._live, None
        if live:
            live.stop()

    def _draw(self) -> RenderableType:
        with self._lock:
            title = Text.assemble((self._title, "bold"), f"   arm {self._arm}", style="")
            if not self._nodes:
                return title
            return Group(title, self._bar(), self._tree())

    def _tree(self) -> Branch:
        branches: dict[str, Branch] = {}
        for path, node in self._nodes.items():
            glyph, style = _STYLES.get(node.status, ("?", ""))
            label = Text.assemble((f"{glyph} {node.name}", style), ("  " + node.message, "dim"))
            above = branches.get(path.rpartition("/")[0])
            branches[path] = above.add(label) if above else Branch(label, guide_style="dim")
        return next(iter(branches.values()))

    def _bar(self) -> Table:
        row = Table.grid(padding=(0, 1))
        value = self._percentage
        bar = ProgressBar(total=None if value is None else 100, completed=value or 0, width=30)
        percentage = "" if value is None else f"{value:3d} %"
        row.add_row(bar, percentage, self._phase, Text(self._frame, style="cyan"))
        return row
