"""Finishes recordings that a crash left unfinished."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from logs.errors import LogError, RecordingInUse
from logs.reading.file_state import is_complete, is_ours, locked
from logs.reading.tolerant_reader import TolerantReader

from .compaction import Summary, part_of, rewrite, write_finished


def recover(recording: Path) -> Summary | None:
    """Make a finished recording from the valid part of a journal or of a damaged recording.

    An empty file of armtree is removed: its process was killed before it recorded anything.

    Returns:
        What was recovered, and how many bytes were lost; None if the recording is complete.

    Raises:
        RecordingInUse: The file is being written.
        RecordingError: The file cannot be read.
        OSError: The disk failed or is full; the file is unchanged.
    """
    complete = is_complete(recording, every_byte=True)
    _remove_part(part_of(recording))
    return None if complete else _finished(recording)


def copy_valid(recording: Path, copy: Path) -> int:
    """Write a finished recording of what is valid in a file, which may be being written.

    Returns:
        The number of messages.

    Raises:
        RecordingError: The file cannot be read.
        OSError: The copy cannot be written.
    """
    records = TolerantReader(recording)
    part = part_of(copy)
    try:
        messages = write_finished(records, part)
        os.replace(part, copy)
    finally:
        part.unlink(missing_ok=True)
    return messages


def recover_all(folder: Path) -> Iterator[Summary | LogError | OSError]:
    """Recover all unfinished recordings of a folder, and remove partial copies.

    It reads only the ends of each file, so it is fast if there is nothing to do. It leaves files
    that are being written, and files of other programs, which take no lock.

    Yields:
        What was recovered, or why a file could not be recovered.
    """
    for part in folder.glob("*.mcap.part"):
        with suppress(LogError, OSError):  # a copy that stays does no harm
            _remove_part(part)
    for path in sorted(folder.glob("*.mcap")):
        try:
            if is_ours(path) and not is_complete(path, every_byte=False):
                yield _finished(path)
        except RecordingInUse:
            continue
        except (LogError, OSError) as error:
            yield error


def _finished(recording: Path) -> Summary:
    with locked(recording):
        if recording.stat().st_size or not is_ours(recording):
            return rewrite(recording)
        recording.unlink()
    return Summary(recording, 0, 0, whole=False, torn=0)


def _remove_part(part: Path) -> None:
    """Remove the partial copy that a compaction left, unless one is running."""
    recording = part.with_suffix("")
    if part.exists() and recording.exists():
        with locked(recording):
            part.unlink(missing_ok=True)
    else:
        part.unlink(missing_ok=True)
