"""What a crash left behind, made whole again."""

import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from logs.errors import LogError, RecordingInUse, RecordingTruncated
from logs.writing.checksums import MAGIC, is_journal
from logs.writing.compaction import locked, part_of, rewrite
from logs.writing.summary import Summary

from .recording import Recording
from .tolerant_reader import Salvage

_HEAD = 64  # the profile and the name of the library begin before that [bytes]
_LIBRARY = b"armtree"  # begins that name in files of ours
_NAME = "*T*Z-*.mcap"  # as `recording_path` makes it
_FOOTER_OPCODE, _FOOTER_CONTENT = 0x02, 20
_FOOTER = struct.Struct(f"<BQ{_FOOTER_CONTENT}s8s")  # and the magic behind it


def recover(recording: Path) -> Summary | None:
    """Makes a recording of what is valid in a journal that was left, or in a damaged recording.

    Returns:
        What was made, and by how much the end was torn; None for a recording that is complete. An
        empty file of ours is removed: its process was killed before anything happened.

    Raises:
        RecordingInUse: It is still being written.
        RecordingError: It cannot be read.
        OSError: The disk failed or is full; the file is unchanged.
    """
    _remove_part(part_of(recording))
    return None if complete(recording, every_byte=True) else _made_whole(recording)


def recover_all(folder: Path) -> Iterator[Summary | LogError | OSError]:
    """Recovers every recording of a folder that was left unfinished, and removes stray parts.

    Quick where there is nothing to do: of each file only its ends are looked at. What is still
    being written is left alone, and so is what another program began, which takes no lock.

    Yields:
        What was recovered, or why it could not be.
    """
    for part in folder.glob("*.mcap.part"):
        with suppress(LogError, OSError):  # it stays, and harms nobody
            _remove_part(part)
    for path in sorted(folder.glob("*.mcap")):
        try:
            if is_ours(path) and not complete(path, every_byte=False):
                yield _made_whole(path)
        except RecordingInUse:
            continue
        except (LogError, OSError) as error:
            yield error


def _made_whole(recording: Path) -> Summary:
    with locked(recording):
        if recording.stat().st_size or not is_ours(recording):
            return rewrite(recording)
        recording.unlink()
    return Summary(recording, 0, 0, whole=False, torn=0)


def _remove_part(part: Path) -> None:
    """Removes what was to become a recording, unless that is being made; it is no only copy."""
    recording = part.with_suffix("")
    if part.exists() and recording.exists():
        with locked(recording):
            part.unlink(missing_ok=True)
    else:
        part.unlink(missing_ok=True)


def left(folder: Path, since: float) -> Iterator[Recording]:
    """Recordings that nobody is writing, in the order of their names: recovered or not.

    Args:
        folder: Where recordings are.
        since: Only those that were changed since then [s since 1970].
    """
    for path in sorted(folder.glob("*.mcap")):
        try:
            if path.stat().st_mtime < since:
                continue
            with locked(path):
                yield Recording(path)
        except (LogError, OSError):
            continue  # in use, or no recording of ours


def lacking(recording: Recording) -> str:
    """Why a recording does not tell all there is, with the path; nothing where it does."""
    if recording.complete:
        return ""
    if being_written(recording.path):
        return str(RecordingInUse(recording.path))
    return str(RecordingTruncated(recording.path, recording.messages))


def being_written(path: Path) -> bool:
    """Whether somebody writes a recording now.

    Raises:
        RecordingError: There is no such file.
    """
    try:
        with locked(path):
            return False
    except RecordingInUse:
        return True


def is_ours(path: Path) -> bool:
    """Whether armtree began a file: by its head, or, while it is empty, by its name.

    Raises:
        OSError: It cannot be read.
    """
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    return _LIBRARY in head if head else path.match(_NAME)


def complete(path: Path, every_byte: bool) -> bool:
    """Whether a file is a finished recording, chunked and indexed.

    Args:
        path: Which.
        every_byte: Whether to look for damage everywhere, not at its end alone.

    Raises:
        RecordingError: There is no such file, or it never was an MCAP file.
    """
    salvage = Salvage(path)
    size = path.stat().st_size
    with path.open("rb") as stream:
        unfinished = is_journal(stream)
        stream.seek(max(0, size - _FOOTER.size))
        footer = stream.read()
    if unfinished or len(footer) < _FOOTER.size:
        return False
    opcode, length, _, magic = _FOOTER.unpack(footer)
    if (opcode, length, magic) != (_FOOTER_OPCODE, _FOOTER_CONTENT, MAGIC):
        return False
    if every_byte:
        for _ in salvage:
            pass
        return salvage.intact
    return True
