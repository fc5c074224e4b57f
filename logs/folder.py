"""The folder of recordings: its free space, and the names of files."""

import shutil
from datetime import UTC, datetime
from pathlib import Path

from .errors import NoSpace, RecordingNotCreated

# A long run takes a few megabytes; the rest stays free for other programs.
LEAST_FREE = 100_000_000  # [bytes]


def check_space(folder: Path) -> int:
    """Return the free space for recordings [bytes].

    Args:
        folder: Folder for recordings. It may be missing; its nearest existing parent then counts.

    Raises:
        NoSpace: A run may need more space than is free.
    """
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    free = shutil.disk_usage(there).free
    if free < LEAST_FREE:
        raise NoSpace(folder, free, LEAST_FREE)
    return free


def recording_path(folder: Path, utc_ns: int, task: int | str) -> Path:
    """Return the path of a new recording. Create the folder if necessary.

    Args:
        folder: Folder for recordings.
        utc_ns: Time of the start, UTC since 1970 [ns]. The name has whole milliseconds.
        task: Number of the task, or another name for the recording.

    Returns:
        A path such as `recordings/20261121T103155.123Z-1.mcap`. If a file with this path exists,
        the recorder rejects the path. The caller then tries a time 1 ms later.

    Raises:
        RecordingNotCreated: The folder cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise RecordingNotCreated(folder, cause) from cause
    seconds, rest_ns = divmod(utc_ns, 10**9)
    day = datetime.fromtimestamp(seconds, UTC).strftime("%Y%m%dT%H%M%S")
    return folder / f"{day}.{rest_ns // 10**6:03d}Z-{task}.mcap"
