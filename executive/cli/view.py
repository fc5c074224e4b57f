"""What a run shows, as a seam: a live picture, plain lines, or JSON."""

import json
import os
import sys
import threading
from queue import SimpleQueue
from typing import Protocol, Self, TextIO

import logs
from executive.goals.events import QuestionStatus, event_to_json
from executive.goals.outcome import Outcome

_Item = logs.Record | QuestionStatus | Outcome | str


class View(Protocol):
    """Shows a run. `watch` is called from any thread and must be quick."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *raised: object) -> None: ...

    def say(self, text: str) -> None:
        """Show a line that is no event."""

    def watch(self, record: logs.Record | QuestionStatus) -> None:
        """Show something that happened."""

    def report(self, outcome: Outcome) -> None:
        """Show how a goal ended."""


class _Lines:
    """Prints from a thread of its own: a slow or closed pipe must not hold the arm up."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._queue: SimpleQueue[_Item | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="view", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *raised: object) -> None:
        self._queue.put(None)
        self._thread.join()

    def say(self, text: str) -> None:
        """Show a line that is no event."""
        self._queue.put(text)

    def watch(self, record: logs.Record | QuestionStatus) -> None:
        """Show something that happened."""
        self._queue.put(record)

    def report(self, outcome: Outcome) -> None:
        """Show how a goal ended."""
        self._queue.put(outcome)

    def line(self, item: _Item) -> str:
        """What to print for an item; empty for nothing."""
        raise NotImplementedError

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            if line := self.line(item):
                self._print(line)

    def _print(self, line: str) -> None:
        try:
            self._stream.write(line + "\n")
            self._stream.flush()
        except OSError:  # nobody reads any more; the goal goes on, and so does what is buffered
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


class JsonView(_Lines):
    """One JSON object per event on standard output, and nothing else there."""

    def __init__(self) -> None:
        super().__init__(sys.stdout)

    def line(self, item: _Item) -> str:
        """An event as JSON. A result is printed when its recording is closed."""
        if isinstance(item, (str, logs.Result)):
            return ""
        if isinstance(item, Outcome):
            event = {"event": "result", **item.to_json()}
        else:
            event = event_to_json(item)
        return json.dumps(event, allow_nan=False)


class TextView(_Lines):
    """Plain lines, for logs and pipes."""

    def __init__(self) -> None:
        super().__init__(sys.stdout)

    def line(self, item: _Item) -> str:
        """A goal, a skill that has ended with something to say, or an outcome, in words."""
        match item:
            case str():
                return item
            case Outcome():
                return in_words(item)
            case QuestionStatus(open=True):
                return asked_in_words(item)
            case logs.Goal():
                return f"task {item.task} {item.name}".rstrip()
            case logs.NodeStatus(status="SUCCESS" | "FAILURE") if item.message:
                return f"  {item.name:<12} {item.status.lower()}  {item.message}"
        return ""


def asked_in_words(asked: QuestionStatus) -> str:
    """A question for people, and how to answer it."""
    choices = f" [{'/'.join(asked.choices)}]" if asked.choices else ""
    return f"? {asked.text}{choices}  (armtree answer {asked.question_id} WORDS)"


def in_words(outcome: Outcome) -> str:
    """An outcome for people."""
    spent = f"{outcome.duration:.2f} s, {outcome.frames} frames"
    cause = outcome.cause
    text = f"task {outcome.task} {outcome.state.name} ({spent}): {cause or outcome.message}"
    text += f"\n  -> {cause.hint}" if cause and cause.hint else ""
    return f"{text}\n  recording {outcome.recording}" if outcome.recording else text
