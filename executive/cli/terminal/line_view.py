"""Views of a run: a live picture, plain lines, or JSON."""

import json
import sys
from collections.abc import Callable, Sequence

import logs
from executive.api.events import QuestionStatus, Where, event_to_json
from executive.api.outcome import Outcome
from hardware.printable import printable

from .live.run_state import RunState
from .streams import LastingStream, fit, is_screen
from .view import Item, Prompt, View


class _Lines(View):
    """A view that prints a line for each item.

    Args:
        line: Callback that returns the line for an item, or "" for no line.
    """

    def __init__(self, line: Callable[[Item], str]) -> None:
        super().__init__()
        self._line, self._stream = line, LastingStream(sys.stdout)

    def show(self, item: Item) -> None:
        """Print the line for an item."""
        if line := self._line(item):
            self._stream.write(fit(printable(line), sys.stdout) + "\n")
            self._stream.flush()


def _json_line(item: Item) -> str:
    """Return an item as a line of JSON, or "" for no line. A Result has none; its Outcome has."""
    if isinstance(item, (str, Prompt, Where, logs.Result)):
        return ""
    if isinstance(item, Outcome):
        event = {"event": "result", **item.to_json()}
    else:
        event = event_to_json(item)
    return json.dumps(event, allow_nan=False)


class _TextLine:
    """Converts a goal, an ended node with a message, a question or an outcome to a line.

    A node in other subtrees than the previous node gets a further line with their names.

    Args:
        verbose: True to also return a line for each frame.
    """

    def __init__(self, verbose: bool) -> None:
        self._verbose, self._state = verbose, RunState()
        self._step: Sequence[str] = []  # names of the subtrees around the last printed node

    def __call__(self, item: Item) -> str:
        """Return the line for an item, or "" for no line."""
        match item:
            case str():
                return item
            case Prompt():
                return item.text
            case Where():
                self._state.where = item
            case Outcome():
                where = self._state.stopped(item)
                return "\n".join(filter(None, (item.text(), where)))
            case QuestionStatus():
                return item.text_with_command() if item.open else ""
            case logs.Goal():
                self._state, self._step = self._state.begun(item), []
                return self._state.title
            case _:
                self._state.update(item)
                return self._line(item)
        return ""

    def _line(self, record: logs.Record) -> str:
        match record:
            case logs.NodeStatus(status="SUCCESS" | "FAILURE") if (
                record.message and self._state.has_nodes
            ):
                words = f"  {record.name:<12} {record.status.lower()}  {record.message}"
                return f"{self._heading(record)}{words}"
            case logs.Sent() if self._verbose:
                return f"  {'sent':<12} {record.text}"
        return ""

    def _heading(self, record: logs.NodeStatus) -> str:
        """Return a line with the subtrees around a node, or "" if they are those of before."""
        step = _subtrees(record.path)
        if step == self._step:
            return ""
        self._step = step
        return f"  {' / '.join(step)}:\n" if step else ""


def _subtrees(path: str) -> Sequence[str]:
    """Return the names of the outer two subtrees around a node, without the task."""
    from trees.nodes import KINDS

    subtrees = [each for each in path.split("/")[1:-1] if each.rpartition(":")[2] not in KINDS]
    return subtrees[:2]


def view_for(as_json: bool, verbose: bool, now: Callable[[], float] | None = None) -> View:
    """Return the view for standard output.

    Args:
        as_json: True for JSON.
        verbose: True if the log is printed, so that lines are printed instead of a live picture.
            The lines include the frames.
        now: Time source of the events [s]. Default: the machine's clock, synchronised with the
            times of the events.
    """
    if as_json:
        return _Lines(_json_line)
    if verbose or not is_screen(sys.stdout):
        return _Lines(_TextLine(verbose))
    from .live.live_view import LiveView  # rich is slow to import

    return LiveView(now=now)
