"""Deletes old recordings by a rule, and pins recordings that must stay."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from logs.errors import LogError, RecordingError, RecordingKept
from logs.reading.file_state import is_complete, is_ours, locked
from logs.reading.tolerant_reader import TolerantReader

_DAY = 86400.0  # a day [s]
_WRITE = 0o222  # write permission in a file's mode, for any user
_PICTURES = (".png", ".svg", ".pdf")  # suffixes of pictures beside a recording, with its name
_DAMAGED = "*.mcap.damaged*"  # copies of damaged recordings
_DELETED = ".deleted"  # suffix of a deleted recording that can be restored


@dataclass(frozen=True, slots=True)
class Rule:
    """Rule for the recordings that may be deleted. If both limits are None, none may be deleted.

    Attributes:
        days: Delete recordings older than this [days].
        megabytes: Delete the oldest recordings until the total size is at most this [MB].
    """

    days: float | None
    megabytes: float | None


def prune(folder: Path, rule: Rule, utc: float, dry_run: bool = False) -> Iterator[Path]:
    """Delete the recordings that a rule selects, oldest first, with their pictures.

    It never deletes a recording that is pinned, unfinished, being written or of another program. A
    copy of a damaged recording counts as a recording.

    Args:
        folder: Folder with recordings.
        rule: The rule.
        utc: Current time [s since 1970].
        dry_run: True to delete nothing.

    Yields:
        Each deleted file; with `dry_run`, each file that would be deleted.
    """
    files = list(_files(folder))
    left = sum(facts.st_size for facts, _ in files)
    for facts, path in sorted(files, key=lambda file: file[0].st_mtime):
        old = rule.days is not None and utc - facts.st_mtime > rule.days * _DAY
        much = rule.megabytes is not None and left > rule.megabytes * 1e6
        if (old or much) and facts.st_mode & _WRITE and (gone := _delete(path, dry_run)):
            left -= facts.st_size
            yield from gone


def delete(recording: Path) -> None:
    """Mark a finished recording as deleted. It is not listed any more, and `purge` deletes it.

    Raises:
        RecordingInUse: The recording is being written.
        RecordingKept: The recording is pinned, is unfinished, or is of another program.
        RecordingError: The recording does not exist.
        OSError: The folder cannot be changed.
    """
    with locked(recording):
        if pinned(recording):
            raise RecordingKept(recording, "is pinned; unpin it first")
        if not (is_ours(recording) and is_complete(recording, every_byte=False)):
            why = "is unfinished, or another program wrote it; delete the file yourself"
            raise RecordingKept(recording, why)
        os.rename(recording, _deleted(recording))


def restore(recording: Path) -> None:
    """Undo `delete`.

    Raises:
        RecordingError: The recording was not deleted, or was deleted for good.
        OSError: The folder cannot be changed.
    """
    try:
        os.link(_deleted(recording), recording)  # unlike a rename, a link never replaces a file
    except OSError as cause:
        why = f"cannot be restored ({cause.strerror})"
        raise RecordingError(recording, why) from cause
    _deleted(recording).unlink()


def purge(folder: Path, before: float) -> None:
    """Remove the files of deleted recordings in a folder, and their pictures. See `delete`.

    Args:
        folder: Folder with recordings.
        before: Remove only recordings that were deleted before this time [s since 1970].
    """
    for path in folder.glob(f"*.mcap{_DELETED}"):
        with suppress(OSError):
            if path.stat().st_ctime < before and is_ours(path):
                path.unlink()
                for picture in _pictures(path.with_suffix("")):
                    picture.unlink()


def _deleted(recording: Path) -> Path:
    return recording.with_name(recording.name + _DELETED)


def _pictures(recording: Path) -> list[Path]:
    beside = (recording.with_suffix(suffix) for suffix in _PICTURES)
    return [picture for picture in beside if picture.is_file()]


def pin(recording: Path, on: bool) -> None:
    """Protect a recording from deletion by removing its write permission (`chmod -w`).

    Args:
        recording: The file.
        on: False to allow deletion again.

    Raises:
        RecordingError: The file does not exist, or is not a recording.
        OSError: The file belongs to another user, or its file system has no permissions.
    """
    TolerantReader(recording)
    mode = recording.stat().st_mode
    recording.chmod(mode & ~_WRITE if on else mode | stat.S_IWUSR)
    if pinned(recording) is not on:
        what = "its file system has no write protection; move it out of the folder to keep it"
        raise PermissionError(errno.EPERM, what, str(recording))


def pinned(recording: Path) -> bool:
    """Return True if a recording is protected from deletion."""
    return not recording.stat().st_mode & _WRITE


def _files(folder: Path) -> Iterator[tuple[os.stat_result, Path]]:
    for path in (*folder.glob("*.mcap"), *folder.glob(_DAMAGED)):
        with suppress(OSError):  # another process has just deleted the file
            yield path.stat(), path


def _delete(path: Path, dry_run: bool) -> list[Path]:
    """Delete a recording of armtree and its pictures, if it is finished.

    Returns:
        The deleted files, or those that would be deleted.
    """
    files = [path, *_pictures(path)]
    try:
        with locked(path):
            finished = path.match(_DAMAGED) or is_complete(path, every_byte=False)
            if not (is_ours(path) and finished):
                return []
            for file in reversed([] if dry_run else files):  # the recording comes last
                file.unlink()
    except (LogError, OSError):
        return []
    return files
