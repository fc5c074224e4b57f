"""Deletes old recordings by a rule, and pins recordings that must stay."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from hardware.loading.dataclass import dataclass
from logs.errors import LogError, RecordingError, RecordingKept
from logs.reading.file_state import is_complete, is_ours, locked
from logs.reading.tolerant_reader import TolerantReader

_DAY = 86400.0  # a day [s]
_WRITE = 0o222  # write permissions of all users in a file's mode
_PICTURES = (".png", ".svg", ".pdf")  # pictures of a recording have its name with such a suffix
_DAMAGED = "*.mcap.damaged*"  # copies of damaged recordings
_DELETED = ".deleted"  # suffix of a deleted recording that can be restored


@dataclass(frozen=True, slots=True)
class Rule:
    """Rule that says which recordings are deleted. It deletes none if both limits are None.

    Attributes:
        days: Largest age [days]; older recordings are deleted. None for no limit.
        megabytes: Largest total size [MB]; the oldest recordings above it are deleted. None for no
            limit.
    """

    days: float | None
    megabytes: float | None


def prune(folder: Path, rule: Rule, utc: float, dry_run: bool = False) -> Iterator[Path]:
    """Delete the recordings that a rule selects, oldest first, with their pictures.

    Pinned and unfinished recordings, recordings that are being written, and files of other programs
    are never deleted. A copy of a damaged recording counts as a recording.

    Args:
        folder: Folder with recordings.
        rule: The rule.
        utc: Current time [s since 1970].
        dry_run: True to delete nothing.

    Yields:
        The path of each deleted file; with `dry_run`, of each file that would be deleted.
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
    """Rename a finished recording, so that it is no longer listed and `purge` can remove it.

    Raises:
        RecordingInUse: The recording is being written.
        RecordingKept: The recording is pinned or unfinished, or another program wrote the file.
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
    """Restore a recording that `delete` renamed.

    Raises:
        RecordingError: The recording was not deleted, `purge` has removed it, or a file of its name
            exists.
        OSError: The folder cannot be changed.
    """
    try:
        os.link(_deleted(recording), recording)  # unlike a rename, a link never replaces a file
    except OSError as cause:
        why = f"cannot be restored ({cause.strerror})"
        raise RecordingError(recording, why) from cause
    _deleted(recording).unlink()


def purge(folder: Path, before: float) -> None:
    """Remove the recordings in a folder that `delete` has renamed, and their pictures.

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
    """Pin a recording: protect it from deletion by removing its write permission (`chmod -w`).

    Args:
        recording: The file.
        on: True to pin the recording, False to allow its deletion again.

    Raises:
        RecordingError: The file does not exist, or is not an MCAP file.
        OSError: The file belongs to another user, or the file system has no write permissions.
    """
    TolerantReader(recording)
    mode = recording.stat().st_mode
    recording.chmod(mode & ~_WRITE if on else mode | stat.S_IWUSR)
    if pinned(recording) is not on:
        what = "its file system has no write protection; move it out of the folder to keep it"
        raise PermissionError(errno.EPERM, what, str(recording))


def pinned(recording: Path) -> bool:
    """Return True if a recording is pinned, so that it is not deleted."""
    return not recording.stat().st_mode & _WRITE


def _files(folder: Path) -> Iterator[tuple[os.stat_result, Path]]:
    for path in (*folder.glob("*.mcap"), *folder.glob(_DAMAGED)):
        with suppress(OSError):  # another process has just deleted the file
            yield path.stat(), path


def _delete(path: Path, dry_run: bool) -> list[Path]:
    """Delete a finished recording of armtree and its pictures.

    Args:
        path: The recording, or a copy of a damaged recording.
        dry_run: True to delete nothing.

    Returns:
        The deleted files, or with `dry_run` the files that would be deleted. Empty if the recording
        may not be deleted.
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
