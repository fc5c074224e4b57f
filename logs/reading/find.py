"""Finds recordings by name: `latest`, `latest:TASK`, or the beginning of a file's name."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from hardware.spelling import suggestion
from logs.errors import LogError, NoSuchRecording
from logs.records.records import MOVE, goal_title

from .reader import read

LATEST = "latest"
_SHOWN = 5  # largest number of recordings in a message
_RUN = re.compile(r"(\d{8}T\d{6}\.\d{3}Z)-(\d+|move)\.mcap")  # names from `recording_path`


def runs(folder: Path) -> list[tuple[str, int, Path]]:
    """Return the recordings of goals in a folder, newest first.

    The list does not contain a server's own recordings, and no renamed recordings.

    Returns:
        For each recording: its start time as in its name, such as `20261121T103155.123Z`; the
        number of its task, or `MOVE`; and its path.
    """
    paths = folder.iterdir() if folder.is_dir() else ()
    found = ((_RUN.fullmatch(path.name), path) for path in paths)
    tasks = ((m[1], _task(m[2]), path) for m, path in found if m)
    return sorted(tasks, reverse=True)


def _task(text: str) -> int:
    return MOVE if text == "move" else int(text)


def by_name(name: str) -> tuple[int, int] | None:
    """Return the start time of a recording, and its task number or `MOVE`, from its file name.

    The time is UTC [ns since 1970]. Returns None if the name does not have armtree's form.
    """
    found = _RUN.fullmatch(name)
    if not found:
        return None
    day, _, rest = found[1].partition(".")
    try:
        began = datetime.strptime(day, "%Y%m%dT%H%M%S").replace(tzinfo=UTC)
    except ValueError:  # no such day
        return None
    stamp_ns = (int(began.timestamp()) * 1000 + int(rest[:3])) * 10**6
    return stamp_ns, _task(found[2])


def is_recording_name(text: str) -> bool:
    """Return True if a text on the command line names a recording, and False for a task."""
    begins = text[:1].isdecimal() and not text.isdecimal()
    named = text.partition(":")[0] == LATEST or Path(text).suffix == ".mcap"
    return begins or named or "/" in text or Path(text).is_file()


def find_recording(given: str, folder: Path) -> Path:
    """Return the recording that a text names.

    Args:
        given: A path; `latest`; `latest:TASK` with the number or name of a task; `latest:move`; or
            the beginning of a file's name that only one recording has. The text may start with a
            folder, as in `runs/latest`.
        folder: Folder of recordings. It is used if the text contains no folder.

    Returns:
        The path of the recording. A given path that ends in `.mcap` may be missing on the disk.

    Raises:
        NoSuchRecording: No recording has this name, or several names begin with it.
    """
    path = Path(given)
    if path.exists():
        return path
    folder, begin = (path.parent if "/" in given else folder), path.name
    latest, _, task = begin.partition(":")
    if latest == LATEST:
        return _latest(folder, task)
    if path.suffix == ".mcap":
        return here if (here := folder / begin).exists() else path
    there = sorted(each.name for each in folder.glob("*.mcap"))
    match [name for name in there if name.startswith(begin)]:
        case [name]:
            return folder / name
        case []:
            near = suggestion(begin, [LATEST, *there]) if len(begin) > 1 else ""
            why = (
                f"no recording here begins with {begin}{near}" if there else "no recording is here"
            )
            why += f"; the newest: {_newest(there)}" if there and not near else ""
        case names:
            why = f"{len(names)} recordings here begin with {begin}; the newest: {_newest(names)}"
    raise NoSuchRecording(folder, why)


def _newest(names: Sequence[str]) -> str:
    """Return the names of the newest recordings. A renamed recording counts as old."""
    by_time = sorted(names, key=lambda name: (name[:1].isdecimal(), name), reverse=True)
    shown, more = by_time[:_SHOWN], len(names) - _SHOWN
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def _latest(folder: Path, task: str) -> Path:
    found = runs(folder)
    for _, number, path in found:
        if task in ("", goal_title(number)) or _is_task(task, number, path):
            return path
    if not found:
        raise NoSuchRecording(folder, "no recording of a run is here")
    newest: dict[int, Path] = {}
    for _, number, path in found:
        newest.setdefault(number, path)
    titles = (_name(path) or goal_title(number) for number, path in sorted(newest.items()))
    there = ", ".join(dict.fromkeys(titles))
    raise NoSuchRecording(folder, f"no run of {task} is recorded here; there are runs of {there}")


def _is_task(task: str, number: int, path: Path) -> bool:
    """Return True if a recorded goal is the task with this number or name.

    Returns False if the name is needed and the file is unreadable.
    """
    if task.isdecimal() or number == MOVE:
        return task == str(number)
    return _name(path) == task


def _name(path: Path) -> str:
    """Return the name of a run's task; empty for a move, or if the file is unreadable."""
    try:
        for message in read(path, ["/goal"]):
            fields = message.fields()
            return "" if fields.get("task") == MOVE else str(fields.get("name", ""))
    except (LogError, OSError):
        pass  # a file of another program, or a deleted file
    return ""
