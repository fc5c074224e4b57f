"""Compacts a recording, as the end of a run does."""

from pathlib import Path

from logs import Summary
from logs.reading.file_state import locked
from logs.writing.compaction import rewrite


def compact(journal: Path) -> Summary:
    """Replace a journal with a finished recording."""
    with locked(journal):
        return rewrite(journal)
