"""Where recordings lie, and what they are called."""

from datetime import UTC, datetime
from pathlib import Path

from .errors import RecordingNotCreated


def recording_path(folder: Path, utc_ns: int, task: int) -> Path:
    """Where the recording of a task that starts now belongs; the folder is made if missing.

    Args:
        folder: Folder for recordings.
        utc_ns: UTC since 1970 [ns]; the name keeps whole milliseconds.
        task: The task's number.

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
