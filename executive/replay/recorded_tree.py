"""The tree of a recorded run: the state of every node, and its times."""

from collections.abc import Sequence
from pathlib import Path

from logs import RecordingError, shown_status
from logs.views.timeline import Row, timeline
from trees.export.outline import Entry


def tree_of(path: Path) -> Entry:
    """Return the tree of a run.

    Args:
        path: The recording. It may be cut off.

    Raises:
        RecordingError: The recording cannot be read, or holds no tree.
    """
    rows = timeline(path).rows
    if not rows:
        raise RecordingError(path, "no tree was run; give a recording of a task")
    return _entry(rows, 0)


def _entry(rows: Sequence[Row], number: int) -> Entry:
    """Return the node of a row, with the nodes of its child rows."""
    row, below = rows[number], []
    for child in range(number + 1, len(rows)):
        if rows[child].depth <= row.depth:
            break
        if rows[child].depth == row.depth + 1:
            below.append(_entry(rows, child))
    states = ["", "INVALID", *(each.state for each in row.spans)]
    state = shown_status(states[-1], states[-2])
    return Entry(row.name, row.name, tuple(below), state=state, note=_note(row))


def _note(row: Row) -> str:
    if not row.spans:
        return ""
    spent = sum(each.end - each.start for each in row.spans[:-1] if each.state == "RUNNING")
    took = f", {spent:.3f} s" if spent else ""
    return f"+{row.spans[0].start:.3f} s{took}  {row.message}".rstrip()
