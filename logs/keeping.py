"""Which recordings are kept, and which make room."""

import errno
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .compaction import locked
from .errors import LogError
from .recovery import complete

_DAY = 86400.0  # [s]


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

    Never one that is pinned, unfinished, being written, or no recording of ours.

    Args:
        folder: Where recordings are.
        rule: What may go.
        utc: Now, since 1970 [s].

    Yields:
        What was deleted.
    """
    files = [(path.stat(), path) for path in folder.glob("*.mcap")]
    left = sum(facts.st_size for facts, _ in files)
    for facts, path in sorted(files, key=lambda file: file[0].st_mtime):
        old = rule.days is not None and utc - facts.st_mtime > rule.days * _DAY
        much = rule.megabytes is not None and left > rule.megabytes * 1e6
        if (old or much) and not pinned(path) and _delete(path):
            left -= facts.st_size
            yield path


def pin(recording: Path, on: bool) -> None:
    """Keeps a recording for good: it is write-protected, as `chmod -w` does it.

    Raises:
        OSError: The file is not there, or another user's, or its file system protects none.
    """
    mode = recording.stat().st_mode
    recording.chmod(mode & ~0o222 if on else mode | stat.S_IWUSR)
    if pinned(recording) is not on:
        what = "its file system has no write protection; move it out of the folder to keep it"
        raise PermissionError(errno.EPERM, what, str(recording))


def pinned(recording: Path) -> bool:
    """Whether a recording is kept for good."""
    return not recording.stat().st_mode & 0o222


def _delete(path: Path) -> bool:
    try:
        with locked(path):
            if not complete(path, every_byte=False):
                return False
            path.unlink()
    except (LogError, OSError):
        return False
    return True
