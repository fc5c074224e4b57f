"""Where recordings lie, and what they are called."""

import shutil
from datetime import UTC, datetime
from pathlib import Path

from .errors import NoSpace, RecordingNotCreated

# A long run takes a few megabytes; the rest is left to the machine.
LEAST_FREE = 100_000_000  # [bytes]


def check_space(folder: Path) -> int:
    """Free space where recordings are to be made [bytes].

    Args:
        folder: Folder for recordings; it need not be there yet.

    Raises:
        NoSpace: There is less than a run may need.
    """
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    free = shutil.disk_usage(there).free
    if free < LEAST_FREE:
        raise NoSpace(folder, free, LEAST_FREE)
    return free


def recording_path(folder: Path, utc_ns: int, task: int | str) -> Path:
    """Where the recording of a task that starts now belongs; the folder is made if missing.

    Args:
        folder: Folder for recordings.
        utc_ns: UTC since 1970 [ns]; the name keeps whole milliseconds.
        task: The task's number, or what else is recorded.

    Returns:
        A path such as `recordings/20261121T103155.123Z-1.mcap`. It may exist already; a recorder
        then refuses it, and the next millisecond is to be tried.

    Raises:
        RecordingNotCreated: The folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise RecordingNotCreated(folder, cause) from cause
    seconds, rest_ns = divmod(utc_ns, 10**9)
    day = datetime.fromtimestamp(seconds, UTC).strftime("%Y%m%dT%H%M%S")
    return folder / f"{day}.{rest_ns // 10**6:03d}Z-{task}.mcap"
