"""What a run shows, as a seam: a live picture, plain lines, or JSON."""

import dataclasses
import json
import logging
import sys
from types import TracebackType
from typing import Any, Protocol, Self

import logs

from .goal import Outcome


class View(Protocol):
    """Shows a run. `watch` is called from any thread and must be quick."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...

    def say(self, text: str) -> None:
        """Show a line that is no event."""

    def watch(self, record: logs.Record) -> None:
        """Show something that happened."""

    def report(self, outcome: Outcome) -> None:
        """Show how a goal ended."""


class JsonView:
    """One JSON object per event on standard output, and nothing else there."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        sys.stdout.flush()

    def say(self, text: str) -> None:
        """Nothing: only events belong here."""

    def watch(self, record: logs.Record) -> None:
        """Print a record; results are printed by `report`, when their recording is closed."""
        if not isinstance(record, logs.Result):
            self._print({"event": _EVENTS[type(record)], **_fields(record)})

    def report(self, outcome: Outcome) -> None:
        """Print an outcome."""
        self._print(
            {
                "event": "result",
                "task_number": outcome.task,
                "state": outcome.state.name,
                "success": outcome.success,
                "code": outcome.code,
                "message": outcome.message,
                "frames": outcome.frames,
                "duration_s": round(outcome.duration, 6),
                "recording": outcome.recording,
            }
        )

    def _print(self, event: dict[str, Any]) -> None:
        # One write per line, so that lines of several threads do not mix.
        sys.stdout.write(json.dumps(event, allow_nan=False) + "\n")
        sys.stdout.flush()


_EVENTS: dict[type, str] = {
    logs.Goal: "goal",
    logs.Sent: "sent",
    logs.Received: "received",
    logs.Transition: "lifecycle",
    logs.Feedback: "feedback",
    logs.NodeStatus: "node",
    logs.Plan: "plan",
    logs.Schedule: "schedule",
    logs.LogLine: "log",
}

_UNITS = {"time": "time_s", "duration": "duration_s", "scheduled": "scheduled_s"}


def _fields(record: logs.Record) -> dict[str, Any]:
    fields = {_UNITS.get(key, key): value for key, value in dataclasses.asdict(record).items()}
    for key, value in fields.items():
        if isinstance(value, bytes):
            fields[key] = value.decode("ascii", "backslashreplace")
    return fields


class TextView:
    """Plain lines, for logs and pipes."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        sys.stdout.flush()

    def say(self, text: str) -> None:
        """Print a line."""
        sys.stdout.write(text + "\n")
        sys.stdout.flush()

    def watch(self, record: logs.Record) -> None:
        """Print goals, and skills that have ended."""
        if isinstance(record, logs.Goal):
            self.say(f"task {record.task} {record.name}")
        elif isinstance(record, logs.NodeStatus) and record.status in ("SUCCESS", "FAILURE"):
            if record.message:
                self.say(f"  {record.name:<12} {record.status.lower()}  {record.message}")

    def report(self, outcome: Outcome) -> None:
        """Print an outcome in words."""
        self.say(in_words(outcome))


def in_words(outcome: Outcome) -> str:
    """An outcome for people."""
    spent = f"{outcome.frames} frames, {outcome.duration:.2f} s"
    text = f"task {outcome.task} {outcome.state.name}: {outcome.message} ({spent})"
    return f"{text}\n  recording {outcome.recording}" if outcome.recording else text


class RecordingHandler(logging.Handler):
    """Hands log lines to whoever records.

    Args:
        tell: Where they go.
        now: The time [s].
    """

    def __init__(self, tell: Any, now: Any) -> None:
        super().__init__()
        self._tell, self._now = tell, now

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line on."""
        self._tell(logs.LogLine(self._now(), record.levelno, record.name, record.getMessage()))
