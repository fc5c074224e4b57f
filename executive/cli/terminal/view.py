"""Views of a run: a live picture, plain lines, or JSON."""

import json
import sys
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Protocol, Self

import logs
from executive.api.events import QuestionStatus, event_to_json
from executive.api.outcome import Outcome
from hardware.printable import printable

from .streams import LastingStream

_Item = logs.Record | QuestionStatus | Outcome | str


class View(Protocol):
    """Shows a run. Any thread may call its methods, which do not block."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *raised: object) -> None: ...

    def say(self, text: str) -> None:
        """Show a line of text."""

    def watch(self, record: logs.Record | QuestionStatus) -> None:
        """Show an event."""

    def report(self, outcome: Outcome) -> None:
        """Show the outcome of a goal."""


class _Lines:
    """Prints on its own thread, so that a slow or closed pipe cannot block the arm.

    Args:
        line: Returns the line for an item, or "" for none.
    """

    def __init__(self, line: Callable[[_Item], str]) -> None:
        self._line, self._stream = line, LastingStream(sys.stdout)
        self._queue: SimpleQueue[_Item | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *raised: object) -> None:
        self._queue.put(None)
        self._thread.join()

    def say(self, text: str) -> None:
        """Show a line of text."""
        self._queue.put(text)

    def watch(self, record: logs.Record | QuestionStatus) -> None:
        """Show an event."""
        self._queue.put(record)

    def report(self, outcome: Outcome) -> None:
        """Show the outcome of a goal."""
        self._queue.put(outcome)

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            if line := self._line(item):
                self._stream.write(printable(line) + "\n")
                self._stream.flush()


def _json_line(item: _Item) -> str:
    """Return an event as JSON. The result is printed when its recording is closed."""
    if isinstance(item, (str, logs.Result)):
        return ""
    if isinstance(item, Outcome):
        event = {"event": "result", **item.to_json()}
    else:
        event = event_to_json(item)
    return json.dumps(event, allow_nan=False)


def _text_line(item: _Item) -> str:
    """Return the line for a goal, an ended node with a message, a question or an outcome."""
    match item:
        case str():
            return item
        case Outcome():
            return item.text()
        case QuestionStatus(open=True):
            return item.text_with_command()
        case logs.Goal():
            return logs.goal_title(item.task, item.name)
        case logs.NodeStatus(status="SUCCESS" | "FAILURE") if item.message:
            return f"  {item.name:<12} {item.status.lower()}  {item.message}"
    return ""


def view_for(as_json: bool, verbose: bool) -> View:
    """Return the view for standard output.

    Args:
        as_json: True for JSON.
        verbose: True if the log is printed, so that lines are printed instead of a live picture.
    """
    if as_json:
        return _Lines(_json_line)
    if verbose or not sys.stdout.isatty():
        return _Lines(_text_line)
    from .live_view import LiveView  # rich is slow to import

    return LiveView()
