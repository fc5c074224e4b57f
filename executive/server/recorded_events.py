"""The events of a goal that has ended, read from its recording."""

from collections.abc import Iterator
from pathlib import Path

import logs
from executive.api.events import EVENTS, STATUS, Event, QuestionStatus
from executive.api.outcome import GoalStatus

from .event_hub import event_text

CHUNK = 64 * 1024  # bytes that are sent together


def recorded_events(goal: GoalStatus, kinds: frozenset[str]) -> Iterator[bytes]:
    """Return recorded events as server-sent events, and the final state of the goal at the end.

    Args:
        goal: The goal, with a recording.
        kinds: Kinds of events; empty for all.

    Raises:
        RecordingError: The recording is missing or damaged.
    """
    assert goal.outcome
    recording = logs.Recording(Path(goal.outcome.recording))
    recorded = {kind: name for kind, name in EVENTS.items() if kind is not QuestionStatus}
    wanted = tuple(kind for kind, name in recorded.items() if not kinds or name in kinds)
    return _chunks(_texts(recording, wanted, goal, not kinds or STATUS in kinds))


def _texts(
    recording: logs.Recording, wanted: tuple[type, ...], goal: GoalStatus, ends: bool
) -> Iterator[bytes]:
    records: Iterator[Event] = recording.records(*wanted) if wanted else iter(())
    yield from map(event_text, records)
    if ends:
        yield event_text(goal)


def _chunks(texts: Iterator[bytes]) -> Iterator[bytes]:
    found = b""
    for text in texts:
        found += text
        if len(found) >= CHUNK:
            yield found
            found = b""
    yield found
