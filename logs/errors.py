"""Errors of recordings.

The root is LogError. Every error has a stable `code`, and its message says what to do.
"""

import errno
from pathlib import Path

from hardware import ArmtreeError, host_limit

# Numbers of the operating system's errors for a full disk, and for a full quota.
DISK_FULL = (errno.ENOSPC, errno.EDQUOT)


class LogError(ArmtreeError):
    """A recording cannot be written or read. Base class of the errors of the package `logs`.

    Attributes:
        path: The file or folder.
    """

    code = "log.error"
    exit_status = 10
    hint = "make room, or record to another folder"

    def __init__(self, path: Path, message: str) -> None:
        self.path = path
        super().__init__(f"{path}: {message}")


class RecordingExists(LogError, FileExistsError):
    """A recording of that name exists. Recordings are never overwritten."""

    code = "log.exists"
    hint = "record under another name"

    def __init__(self, path: Path) -> None:
        super().__init__(path, "exists and is not overwritten; use a name with a time 1 ms later")


class FileKept(LogError):
    """A file of that name exists with other content. It is not overwritten."""

    code = "log.file_kept"
    exit_status = 3
    hint = "write to another folder with `-o FOLDER`"

    def __init__(self, path: Path) -> None:
        super().__init__(path, f"exists with other content and is not overwritten; {self.hint}")


class RecordingNotCreated(LogError):
    """The operating system refused to create the folder or file of a recording."""

    code = "log.not_created"
    hint = "give another folder for recordings"

    def __init__(self, path: Path, cause: OSError) -> None:
        reason = cause.strerror or str(cause)
        super().__init__(path, f"cannot be created ({reason}); give another folder for recordings")


class NoSpace(LogError):
    """The disk is too full to begin a run.

    Args:
        path: Folder of recordings.
        free: Free space [bytes].
        least: Space that a run may need [bytes].
    """

    code = "log.no_space"
    hint = "remove old recordings"

    def __init__(self, path: Path, free: int, least: int) -> None:
        have, need = free / 1e6, least / 1e6
        super().__init__(
            path,
            f"only {have:.0f} MB are free and a run may need {need:.0f} MB; remove old recordings, "
            "or give another folder for recordings",
        )


class DiskFull(LogError):
    """The disk became full while a run was recorded.

    Args:
        path: The recording.
        whole: True if no record is missing from the recording.
    """

    code = "log.disk_full"
    hint = "remove old recordings"

    def __init__(self, path: Path, whole: bool = False) -> None:
        end = "; its end was still recorded, in reserved space" if whole else ""
        super().__init__(
            path,
            f"the disk is full, so the run was stopped{end}. Remove old recordings, or give "
            "another folder for recordings",
        )


class RecordingIncomplete(LogError):
    """The recording of a run is incomplete or unfinished.

    Attributes:
        lost: Number of records and attachments that are missing from the file; None if the run
            still records, so that the number may grow.
        cause: The first error.
    """

    code = "log.incomplete"
    hint = "repair the disk, then run again"

    def __init__(
        self, path: Path, lost: int | None, cause: Exception, finished: bool = True
    ) -> None:
        self.lost, self.cause = lost, cause
        counted = "" if lost is None else f", {lost} records lost"
        repair = "" if finished else "; `armtree log recover FILE` finishes it"
        way = "Make room or repair the cause"
        if limit := host_limit(cause):
            self.hint = limit.hint
            way = self.hint[0].upper() + self.hint[1:].removesuffix(", then run again")
        words = (
            f"recording incomplete{counted} ({cause}); what was written before is "
            f"kept and valid{repair}. {way}, then run the task again"
        )
        refused = isinstance(cause, OSError) and not isinstance(cause, FileNotFoundError)
        if not path.exists() and refused:
            words = f"nothing could be recorded ({cause}). {way}"
        elif not path.exists():
            words = (
                "was moved or deleted while it was written; if it was moved, "
                "`armtree log recover FILE` finishes it"
            )
        super().__init__(path, words)


class RecordingInUse(LogError):
    """A recording is still being written."""

    code = "log.in_use"
    hint = "wait for the end of the run"

    def __init__(self, path: Path) -> None:
        super().__init__(path, "is being written by another armtree; wait for the end of the run")


class RecordingError(LogError, ValueError):
    """A file cannot be read as a recording."""

    code = "log.unreadable"
    exit_status = 3
    hint = "give another file"


class RecordingEmpty(RecordingError):
    """A recording has no message yet, or was cut off before its first message."""

    hint = "if a run writes it, read it again later; if not, delete it"

    def __init__(self, path: Path) -> None:
        super().__init__(path, f"has no message yet; {self.hint}")


class RecordingKept(RecordingError):
    """A recording may not be deleted. The message says what to do instead."""

    hint = ""


class NoSuchRecording(RecordingError):
    """No recording has the given name, or several recordings match it."""

    code = "log.no_such"
    hint = "`armtree log ls` lists the recordings"

    def __init__(self, folder: Path, why: str) -> None:
        why += "" if why.endswith("?") else "."
        more = "`armtree log ls` lists the recordings; latest:TASK is the last run of a task"
        super().__init__(folder, f"{why} {more}")


class RecordingTruncated(RecordingError):
    """The end of a recording is missing or damaged.

    Attributes:
        messages: Number of valid messages before the damage.
    """

    code = "log.truncated"
    exit_status = 10
    hint = "`armtree log recover latest` makes a complete file"

    def __init__(self, path: Path, messages: int) -> None:
        self.messages = messages
        super().__init__(
            path,
            f"cut off or damaged after {messages} valid messages; "
            "`armtree log recover FILE` makes a complete file of these",
        )


class RecordingCut(RecordingError):
    """The recording was recovered after a crash. It lacks the end of the run."""

    code = "log.cut"
    exit_status = 10
    hint = "do nothing: the recorded part is kept"

    def __init__(self, path: Path) -> None:
        super().__init__(path, "was recovered after a crash; the end of the run is missing")
