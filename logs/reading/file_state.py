"""The state of a recording's file: finished, unfinished, being written, or of another program."""

import fcntl
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from logs.errors import LogError, RecordingCut, RecordingError, RecordingInUse, RecordingTruncated
from logs.records.file_format import MAGIC, is_journal

from .tolerant_reader import TolerantReader

if TYPE_CHECKING:
    from .recording import Recording

_HEAD = 64  # number of first bytes, which contain the name of the library that wrote the file
_LIBRARY = b"armtree"  # beginning of the library's name in files of armtree
_NAME = "*T*Z-*.mcap"  # names from `recording_path`
_FOOTER_OPCODE, _FOOTER_CONTENT = 0x02, 20
_FOOTER = struct.Struct(f"<BQ{_FOOTER_CONTENT}s8s")  # followed by the magic


@contextmanager
def locked(recording: Path, shared: bool = False) -> Iterator[None]:
    """Context that holds the lock of a recording. The writer of a recording holds the same lock.

    Args:
        recording: The file.
        shared: True if other readers may hold the lock at the same time.

    Raises:
        RecordingInUse: Another process or thread holds the lock.
        RecordingError: The file does not exist.
    """
    try:
        handle = os.open(recording, os.O_RDONLY | os.O_NONBLOCK)  # in case it is a pipe
    except OSError as cause:
        reason = cause.strerror or str(cause)
        raise RecordingError(recording, f"cannot be read ({reason}); check the path") from cause
    try:
        fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        yield
    except BlockingIOError as cause:
        raise RecordingInUse(recording) from cause
    finally:
        os.close(handle)


def being_written(path: Path) -> bool:
    """Return True if a recording is being written now.

    Raises:
        RecordingError: The file does not exist.
    """
    try:
        with locked(path, shared=True):  # other readers may check at the same moment
            return False
    except RecordingInUse:
        return True


def is_ours(path: Path) -> bool:
    """Return True if armtree created a file.

    Checks the first bytes of the file. If the file is empty, checks its name.

    Raises:
        OSError: The file cannot be read.
    """
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    return _LIBRARY in head if head else path.match(_NAME)


def is_complete(path: Path, every_byte: bool) -> bool:
    """Return True if a file is a finished recording.

    Args:
        path: The file.
        every_byte: True to check the whole file for damage; False to check only its beginning and
            its end.

    Raises:
        RecordingError: The file does not exist, or is not an MCAP file.
    """
    reader = TolerantReader(path)
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
        for _ in reader:
            pass
        return reader.intact
    return True


def why_incomplete(recording: "Recording") -> LogError | None:
    """Return the error if a recording lacks the end of its run, else None."""
    if recording.whole:
        return None
    if not recording.complete and being_written(recording.path):
        return RecordingInUse(recording.path)
    if recording.complete:
        return RecordingCut(recording.path)
    return RecordingTruncated(recording.path, recording.messages)


def closed_recordings(folder: Path, since: float) -> "Iterator[Recording]":
    """Yield the recordings of a folder that are not being written, ordered by name.

    Args:
        folder: Folder with recordings.
        since: Skip files last changed before this time [s since 1970].
    """
    from .recording import Recording  # a run without its use starts sooner

    for path in sorted(folder.glob("*.mcap")):
        try:
            if path.stat().st_mtime < since:
                continue
            with locked(path):
                yield Recording(path)
        except (LogError, OSError):
            continue  # in use, or not our recording
