"""The live view of a run in a terminal: progress, tree and joints, then the outcome."""

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TextIO, cast

from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

import logs
from executive.api.events import QuestionStatus, Where
from executive.api.outcome import GoalState, Outcome
from executive.cli.terminal.full_screen import FullScreen
from executive.cli.terminal.streams import LastingStream, fold
from executive.cli.terminal.view import Item, Prompt, View
from hardware import RealClock
from hardware.loading.dataclass import dataclass
from hardware.printable import printable

from .joint_rows import joint_rows
from .run_state import RunState
from .tree_rows import Row, tree_rows

# status: glyph, its style, style of the name
_STYLES = {
    "INVALID": ("·", "dim", "dim"),
    "RUNNING": ("▶", "cyan", "bold"),
    "SUCCESS": ("✓", "green", ""),
    "FAILURE": ("✗", "red", ""),
    logs.HALTED: ("■", "yellow", ""),
}
_OUTCOMES = {GoalState.SUCCEEDED: "green", GoalState.CANCELED: "yellow", GoalState.ABORTED: "red"}
_PERIOD = 0.1  # time between two pictures [s]
_BAR = 30  # largest number of columns of the progress bar


class LiveView(View):
    """Draws the running goal on the alternate screen. Then prints its end on the normal screen.

    It leaves the alternate screen while the operator types an answer.

    Args:
        console: Console to draw on. Default: standard output.
        now: Callback that returns the time [s]. Default: the machine's monotonic clock,
            synchronised with the times of events.
    """

    def __init__(
        self, console: Console | None = None, now: Callable[[], float] | None = None
    ) -> None:
        super().__init__(_PERIOD)
        self._console = console or Console(file=cast(TextIO, LastingStream(sys.stdout)))
        self._now = now or RealClock().now
        self._screen: FullScreen | None = None
        self._state = RunState()
        self._ahead = -float("inf")  # offset of the clock of the events [s]
        self._last = ""  # text below the picture
        self._said: list[str] = []  # texts to print after the alternate screen
        self._running = self._asks = False

    def show(self, item: Item) -> None:
        """Update the picture with an event, or show a text."""
        match item:
            case str():
                self._say(item)
            case Where():
                self._state.where = item
                self._state.positions = item.commanded or {}
                self._state.measured = item.measured or {}
            case Prompt():
                self._asks = bool(item.text)
                if item.text:
                    self._leave()
                    self._print(item.text)
            case QuestionStatus():
                if item.open:
                    self._say(item.text_with_command())
                elif self._last == item.text_with_command():
                    self._last = ""
            case Outcome():
                self._end(item)
            case _:
                self._take(item)

    def refresh(self) -> None:
        """Draw the picture, if a goal runs or the board boots."""
        shown = self._running or self._state.activated is not None
        if self._asks or not shown or not self._console.is_terminal:
            self._leave()
            return
        if self._screen is None:
            self._screen = FullScreen(self._console.file).__enter__()
        width, rows = self._console.size
        said = fold(printable(self._last), width).split("\n")[: rows // 3] if self._last else []
        with self._console.capture() as captured:
            self._console.print(self.picture(), height=rows - 1 - len(said))
            for line in said:
                self._console.print(Text(line), no_wrap=True, overflow="ellipsis")
        self._screen.draw(captured.get().rstrip("\n").split("\n")[:rows])

    def close(self) -> None:
        """Print the last picture of a goal without an outcome."""
        self._leave()
        if self._running:
            self._console.print(self.picture())
        self._running = False

    def picture(self) -> "Picture":
        """Return the picture of the run at this moment."""
        return Picture(self._state, self._now() + self._ahead)

    def _take(self, record: logs.Record) -> None:
        if isinstance(record, logs.Goal):
            self._ahead = record.time - self._now()
            self._state, self._running = self._state.begun(record), True
        else:
            self._ahead = max(self._ahead, record.time - self._now())
            self._state.update(record)

    def _end(self, outcome: Outcome) -> None:
        self._state.end(self._now() + self._ahead, outcome.state.name)
        self._leave()
        where = self._state.stopped(outcome)
        if self._running:
            self._console.print(replace(self.picture(), joints=not where))
        self._running, self._last = False, ""
        text = "\n".join(filter(None, (outcome.text(), where)))
        self._print(text, outcome.state.name, _OUTCOMES[outcome.state])

    def _leave(self) -> None:
        """Leave the alternate screen, and print the texts that it showed."""
        screen, self._screen = self._screen, None
        if screen:
            screen.__exit__()
        for text in self._said:
            self._print(text)
        self._said.clear()

    def _say(self, text: str) -> None:
        self._last = text
        if self._screen:
            self._said.append(text)
        else:
            self._print(text)

    def _print(self, words: str, styled: str = "", style: str = "") -> None:
        text = Text(fold(printable(words), self._console.width))
        text.highlight_words([styled] if styled else [], style)
        self._console.print(text, soft_wrap=True)


@dataclass(frozen=True, slots=True)
class Picture:
    """A run at one moment, drawn to the size of a terminal.

    Attributes:
        state: The run.
        now: The moment, on the clock of the events [s].
        joints: True to draw the joints.
    """

    state: RunState
    now: float
    joints: bool = True

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the rows of the picture, at most `options.height`, else the console's rows - 1."""
        state, width = self.state, options.max_width
        rows = max(3, options.height or console.height - 1) - 2
        for_joints = max(1, rows // 3, rows - max(1, len(state.nodes)))
        positions = state.positions if self.joints else {}
        joints = joint_rows(
            state.where, positions, state.targets, width, for_joints, state.measured
        )
        yield _line((state.title, "bold"), f"{'   ' if state.title else ''}arm {state.arm}")
        yield self._progress(width)
        if state.nodes:
            for row in tree_rows(state.nodes, max(1, rows - len(joints))):
                yield _tree_line(row, width)
        yield from joints

    def _progress(self, width: int) -> Text:
        """Return the line with the bar, the phase and the times."""
        state = self.state
        done, words = state.percentage, state.phase
        wait, booted = state.where.boot_wait, self._booted()
        if booted is not None:
            done = int(100 * min(1.0, booted / wait)) if wait else None
            words = "the board boots"
        percentage = "" if done is None else f"{done:3d} %"
        after = "  ".join(filter(None, (percentage, words, *self._times())))
        bar = max(0, min(_BAR, width - len(after) - 2))
        full = bar * (done or 0) // 100
        return _line(("━" * full, "cyan"), ("─" * (bar - full), "dim"), f"  {after}")

    def _booted(self) -> float | None:
        """Return the boot time of the board so far [s]; None if it is not booting."""
        began = self.state.activated
        return None if began is None else max(0.0, self.now - began)

    def _times(self) -> Iterator[str]:
        """Yield the elapsed time and the remaining time."""
        state, end = self.state, self.state.motion_end
        if state.began is not None:
            yield f"{_seconds((state.ended or self.now) - state.began)} elapsed"
        wait, booted = state.where.boot_wait, self._booted()
        if booted is not None and booted < wait:
            yield f"{_seconds(wait - booted)} left"
        elif end is not None:
            yield f"motion {_seconds(end - self.now)} left"


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
