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
    """Replace a journal or a damaged recording with a finished recording of its valid part.

    An empty file of armtree is removed, because its process was killed before the first record.

    Returns:
        A summary of the recovered records and lost bytes; None if the recording was complete.

    Raises:
        RecordingInUse: The file is being written.
        RecordingError: The file cannot be read.
        OSError: The disk failed or is full. The file is unchanged.
    """
    complete = is_complete(recording, every_byte=True)
    _remove_part(part_of(recording))
    return None if complete else _finished(recording)


def copy_valid(recording: Path, copy: Path) -> int:
    """Write the valid part of a recording to another file, as a finished recording.

    Args:
        recording: The recording. It may be in use by a run that still writes it.
        copy: File to write.

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

    Reads only the beginning and the end of a finished file, so it is fast. Ignores files that are
    being written. Ignores files of other programs: those take no lock, so they may be in use.

    Yields:
        A summary of each recovered file; an error if a file could not be recovered.
    """
    for part in folder.glob("*.mcap.part"):
        with suppress(LogError, OSError):  # a remaining copy is harmless
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
    """Remove the temporary file of an interrupted compaction.

    Raises:
        RecordingInUse: The recording is locked, so a compaction may still write the file.
    """
    recording = part.with_suffix("")
    if part.exists() and recording.exists():
        with locked(recording):
            part.unlink(missing_ok=True)
    else:
        part.unlink(missing_ok=True)
