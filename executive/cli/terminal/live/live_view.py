"""The live view of a run in a terminal: progress, tree and joints, then the outcome."""

import sys
from collections.abc import Callable, Iterator
from typing import TextIO, cast

from rich.console import Console, ConsoleOptions, RenderResult
from rich.live import Live
from rich.text import Text

import logs
from executive.api.events import QuestionStatus, Where
from executive.api.outcome import GoalState, Outcome
from executive.cli.terminal.streams import LastingStream, fold
from executive.cli.terminal.view import Item, View
from hardware import RealClock
from hardware.printable import printable

from .joint_rows import joint_rows
from .run_state import RunState
from .tree_rows import HALTED, Row, tree_rows

# status: glyph, its style, style of the name
_STYLES = {
    "INVALID": ("·", "dim", "dim"),
    "RUNNING": ("▶", "cyan", "bold"),
    "SUCCESS": ("✓", "green", ""),
    "FAILURE": ("✗", "red", ""),
    HALTED: ("■", "yellow", ""),
}
_OUTCOMES = {GoalState.SUCCEEDED: "green", GoalState.CANCELED: "yellow", GoalState.ABORTED: "red"}
_PERIOD = 0.1  # between two pictures [s]
_BAR = 30  # most columns of the progress bar


class LiveView(View):
    """Draws the running goal, in at most one row less than the terminal has.

    Args:
        console: Console to draw on. Default: standard output.
        now: Returns the time [s]. Default: the machine's monotonic clock. Events may be of another
            clock: their times are compared with it.
    """

    def __init__(
        self, console: Console | None = None, now: Callable[[], float] | None = None
    ) -> None:
        super().__init__(_PERIOD)
        self._console = console or Console(file=cast(TextIO, LastingStream(sys.stdout)))
        self._now = now or RealClock().now
        self._live: Live | None = None
        self._state = RunState()
        self._ahead = -float("inf")  # of the clock of the events [s]

    def show(self, item: Item) -> None:
        """Take an event into the picture, or print a text above it."""
        match item:
            case str():
                self._print(item)
            case Where():
                self._state.where = item
                self._state.positions = item.commanded or {}
            case QuestionStatus():
                if item.open:
                    self._print(item.text_with_command())
            case Outcome():
                self._end(item)
            case _:
                self._take(item)

    def refresh(self) -> None:
        """Draw the picture."""
        if self._live:
            self._live.refresh()

    def close(self) -> None:
        """Keep the last picture."""
        live, self._live = self._live, None
        if live:
            live.stop()

    def picture(self) -> "Picture":
        """Return the run at this moment."""
        return Picture(self._state, self._now() + self._ahead)

    def _take(self, record: logs.Record) -> None:
        if not isinstance(record, logs.Goal):
            self._ahead = max(self._ahead, record.time - self._now())
            self._state.update(record)
            return
        self._ahead = record.time - self._now()
        again = record.goal_id == self._state.goal_id  # a recording was rewound
        self._state = self._state.begun(record)
        if not (again and self._live):
            self.close()
            self._live = Live(
                console=self._console, get_renderable=self.picture, auto_refresh=False
            )
            self._live.start()

    def _end(self, outcome: Outcome) -> None:
        self._state.end(self._now() + self._ahead, outcome.state.name)
        self.close()
        where = self._state.stopped(outcome)
        text = "\n".join(filter(None, (outcome.text(), where)))
        self._print(text, outcome.state.name, _OUTCOMES[outcome.state])

    def _print(self, words: str, styled: str = "", style: str = "") -> None:
        text = Text(fold(printable(words), self._console.width))
        text.highlight_words([styled] if styled else [], style)
        self._console.print(text, soft_wrap=True)


class Picture:
    """A run at one moment, drawn to the size of a terminal.

    Args:
        state: The run.
        now: The moment, on the clock of its events [s].
    """

    def __init__(self, state: RunState, now: float) -> None:
        self._state, self._now, self._boot_wait = state, now, state.where.boot_wait

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield its rows: at most one less than the console has."""
        state, width = self._state, options.max_width
        rows = max(3, console.height - 1) - 2
        for_joints = max(1, rows // 3, rows - max(1, len(state.nodes)))
        joints = joint_rows(state.where, state.positions, state.targets, width, for_joints)
        yield _line((state.title, "bold"), f"   arm {state.arm}")
        yield self._progress(width)
        if state.nodes:
            for row in tree_rows(state.nodes, max(1, rows - len(joints))):
                yield _tree_line(row, width)
        yield from joints

    def _progress(self, width: int) -> Text:
        """Return the line with the bar, the phase and the times."""
        state = self._state
        done, words = state.percentage, state.phase
        if (booted := self._booted()) is not None:
            done = int(100 * min(1.0, booted / self._boot_wait)) if self._boot_wait else None
            words = "the board boots"
        percentage = "" if done is None else f"{done:3d} %"
        after = "  ".join(filter(None, (percentage, words, *self._times())))
        bar = max(0, min(_BAR, width - len(after) - 2))
        full = bar * (done or 0) // 100
        return _line(("━" * full, "cyan"), ("─" * (bar - full), "dim"), f"  {after}")

    def _booted(self) -> float | None:
        """Return how long the board has booted [s]; None if it does not boot."""
        began = self._state.activated
        return None if began is None else max(0.0, self._now - began)

    def _times(self) -> Iterator[str]:
        """Yield the elapsed time, and the time that is left."""
        state, end = self._state, self._state.motion_end
        if state.began is not None:
            yield f"{_seconds((state.ended or self._now) - state.began)} elapsed"
        booted = self._booted()
        if booted is not None and self._boot_wait and booted < self._boot_wait:
            yield f"{_seconds(self._boot_wait - booted)} left"
        elif end is not None:
            yield f"motion {_seconds(end - self._now)} left"


def _seconds(seconds: float) -> str:
    """Return a time [s] for people."""
    if seconds < 60:
        return f"{max(0.0, seconds):.1f} s"
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def _line(*parts: str | tuple[str, str]) -> Text:
    return Text.assemble(*parts, no_wrap=True, overflow="ellipsis")


def _tree_line(row: Row, width: int) -> Text:
    guide = row.guide[-(width // 2) :]
    if not row.status:
        return _line((f"{guide}{row.name}", "dim"))
    glyph, style, name_style = _STYLES.get(row.status, ("?", "", ""))
    style = style if row.at_work or row.status != "FAILURE" else "dim"
    message = f"  {row.message}" if row.message else ""
    return _line((guide, "dim"), (f"{glyph} ", style), (row.name, name_style), (message, "dim"))
