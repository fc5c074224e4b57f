"""Which recordings are kept, and which make room."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from logs.errors import LogError
from logs.reading.recovery import complete, is_ours
from logs.reading.tolerant_reader import Salvage

from .compaction import locked

_DAY = 86400.0  # [s]
_WRITE = 0o222  # of a file's mode, whoever may
_DAMAGED = "*.mcap.damaged*"  # what was kept of recordings that were recovered


@dataclass(frozen=True, slots=True)
class Rule:
    """What may go; nothing where both are None.

    Attributes:
        days: A recording older than this [days].
        megabytes: The oldest, until all together take no more than this [MB].
    """

    days: float | None
    megabytes: float | None


def prune(folder: Path, rule: Rule, utc: float) -> Iterator[Path]:
    """Deletes what a rule does not keep, the oldest first.

    Never one that is pinned, unfinished, being written, or no recording of ours. What was kept of
    one that was damaged counts as a recording.

    Args:
        folder: Where recordings are.
        rule: What may go.
        utc: Now, since 1970 [s].

    Yields:
        What was deleted.
    """
    files = list(_files(folder))
    left = sum(facts.st_size for facts, _ in files)
    for facts, path in sorted(files, key=lambda file: file[0].st_mtime):
        old = rule.days is not None and utc - facts.st_mtime > rule.days * _DAY
        much = rule.megabytes is not None and left > rule.megabytes * 1e6
        if (old or much) and facts.st_mode & _WRITE and _delete(path):
            left -= facts.st_size
            yield path


def pin(recording: Path, on: bool) -> None:
    """Keeps a recording for good: it is write-protected, as `chmod -w` does it.

    Raises:
        RecordingError: It is no recording, or not there.
        OSError: The file is another user's, or its file system protects none.
    """
    Salvage(recording)
    mode = recording.stat().st_mode
    recording.chmod(mode & ~_WRITE if on else mode | stat.S_IWUSR)
    if pinned(recording) is not on:
        what = "its file system has no write protection; move it out of the folder to keep it"
        raise PermissionError(errno.EPERM, what, str(recording))


def pinned(recording: Path) -> bool:
    """Whether a recording is kept for good."""
    return not recording.stat().st_mode & _WRITE


def _files(folder: Path) -> Iterator[tuple[os.stat_result, Path]]:
    for path in (*folder.glob("*.mcap"), *folder.glob(_DAMAGED)):
        with suppress(OSError):  # it has just been deleted
            yield path.stat(), path


def _delete(path: Path) -> bool:
    try:
        with locked(path):
            finished = path.match(_DAMAGED) or complete(path, every_byte=False)
            if not (is_ours(path) and finished):
                return False
            path.unlink()
    except (LogError, OSError):
        return False
    return True
