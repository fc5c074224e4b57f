"""The folder of recordings: their list, and actions of clients on a recording."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence, Set
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, TypeVar

import logs
from executive.errors import NotFound, ServerRestarted, TooMuch
from executive.recording.archive import restore_robot
from executive.recording.recordings import is_server_recording
from executive.server.page.robot_shapes import RobotScene
from hardware import Clock, utc_ns
from hardware.loading.dataclass import dataclass
from logs.reading.file_state import being_written
from logs.reading.find import by_name
from logs.reading.indexed import IndexedRecording
from logs.writing.recovery import copy_valid
from logs.writing.retention import delete, pin, pinned, purge, restore

from .recorded_nodes import recorded_nodes
from .seek import Timeline

UNDO = 900.0  # time for which a deleted recording can be restored [s]
COPY_AGE = 30.0  # time after which an unfinished recording is copied again [s]
MAX_COPY = 1 << 30  # largest recording without an index that is copied [bytes]
VERIFY_TIMEOUT = 120.0  # longest time that a verification may take [s]
MAX_FILES = 100_000  # largest number of listed recordings of a folder
_OPEN = 4  # number of timelines and robots in memory
_GOAL = ("/goal",)
_MAX_TEXT = 1000  # largest text of a row [characters]
_NICE = 10  # low priority, because a verification must not delay the arm

Json = dict[str, Any]
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class RecordingFilter:
    """A filter for recordings. All conditions must hold.

    Attributes:
        search: Text in the name, title, outcome or message of a recording.
        task: Number of the task; None for any.
        state: State in which the goal ended; empty for any.
        since, until: Earliest and latest start of a run [ns since 1970].
        before: List only recordings with smaller names; empty for all.
        limit: Largest number of recordings.
    """

    search: str = ""
    task: int | None = None
    state: str = ""
    since: int = 0
    until: int = 2**63 - 1
    before: str = ""
    limit: int = 50

    def accepts(self, row: Json) -> bool:
        """Return True if the conditions hold for a row of the list."""
        text = " ".join(str(row[key]) for key in ("name", "title", "state", "message")).lower()
        return (
            self.since <= row["stamp_ns"] <= self.until
            and self.task in (None, row["task"])
            and self.state in ("", row["state"])
            and self.search.strip().lower() in text
        )


class RecordingFolder:
    """The recordings of goals in one folder, without servers' own recordings. Any thread may call.

    Args:
        folder: The folder. It need not exist.
        clock: Time source.
    """

    def __init__(self, folder: Path, clock: Clock) -> None:
        self._folder, self._clock = folder, clock
        self._verifying = threading.Lock()
        self._rows = _Cache[Json](MAX_FILES)
        self._indexed = _Cache[bool](MAX_FILES)
        self._timelines = _Cache[Timeline](_OPEN)
        self._nodes = _Cache[list[Json]](_OPEN)
        self._scenes = _Cache[RobotScene](_OPEN)
        self._copying = threading.Lock()

    def rows(self, query: RecordingFilter) -> list[Json]:
        """Return the rows of the recordings that a filter accepts, newest name first."""
        purge(self._folder, utc_ns(self._clock) / 1e9 - UNDO)
        found, names = list[Json](), sorted(self._names(), reverse=True)
        self._rows.keep(set(names))
        self._indexed.keep(set(names))
        for name in names:
            if query.before and name >= query.before:
                continue
            with suppress(FileNotFoundError):  # the file was just deleted
                row = self._row(self._folder / name)
                found += [row] if query.accepts(row) else []
            if len(found) == query.limit:
                break
        return found

    def path(self, name: str) -> Path:
        """Return the path of a recording.

        Raises:
            NotFound: The folder has no such file.
        """
        path = self._folder / name
        if Path(name).name != name or path.suffix != ".mcap" or path.is_symlink():
            raise NotFound(f"{name} is not the name of a recording")
        if not path.is_file():
            raise NotFound(f"no recording {name}", "list the recordings")
        return path

    def timeline(self, name: str) -> Timeline:
        """Return the events of a recording.

        Raises:
            NotFound: There is no such recording.
            LogError: The recording cannot be read.
        """
        written = being_written(self.path(name))
        return self._get(
            self._timelines, name, lambda path: Timeline(path, written=written), written
        )

    def scene(self, name: str) -> RobotScene:
        """Return the robot of a recording.

        Raises:
            NotFound: There is no such recording.
            LogError: The recording does not contain a valid robot.
        """
        make = lambda path: RobotScene(restore_robot(IndexedRecording(path)))  # noqa: E731
        return self._get(self._scenes, name, make)

    def nodes(self, name: str) -> list[Json]:
        """Return the nodes of a recorded task. See `recorded_nodes`.

        Raises:
            NotFound, LogError: `scene` failed.
        """

        def make(path: Path) -> list[Json]:
            recording = IndexedRecording(path)
            goal = recording.record_at(0, logs.Goal)
            if goal and goal.task != logs.MOVE:
                return recorded_nodes(recording, goal.task)
            return []

        return self._get(self._nodes, name, make)

    @property
    def timelines(self) -> list[Timeline]:
        """The timelines of the last used recordings."""
        return self._timelines.values()

    @property
    def scenes(self) -> list[RobotScene]:
        """The robots of the last used recordings."""
        return self._scenes.values()

    def verify(self, name: str) -> Json:
        """Verify a recording like `armtree replay --verify`, in a process of low priority.

        Raises:
            NotFound: There is no such recording.
            TooMuch: Another recording is being verified, or the time is over `VERIFY_TIMEOUT`.
        """
        words = ("replay", str(self.path(name).absolute()), "--verify", "--jobs", "1", "--json")
        if not self._verifying.acquire(blocking=False):
            raise TooMuch("a recording is being verified", "wait until it is done")
        try:
            answer: Json = json.loads(_printed(words).splitlines()[0])
        except subprocess.TimeoutExpired as cause:
            what = f"{name}: the verification takes more than {VERIFY_TIMEOUT:g} s"
            raise TooMuch(what, f"type: armtree replay {name} --verify") from cause
        finally:
            self._verifying.release()
        return {key: answer[key] for key in ("holds", "error", "code", "verdicts")}

    def pin(self, name: str, on: bool) -> Json:
        """Protect a recording from deletion, or allow deletion. Return its row.

        Raises:
            NotFound: There is no such recording.
            LogError: The file is not a recording, or it belongs to another user.
        """
        path = self.path(name)
        with _changing(path):
            pin(path, on)
        return self._row(path)

    def delete(self, name: str) -> None:
        """Delete a recording. It can be restored for the time `UNDO`.

        Raises:
            NotFound: There is no such recording.
            LogError: The recording is pinned, unfinished, of another program, or of another user.
        """
        with _changing(path := self.path(name)):
            delete(path)

    def restore(self, name: str) -> Json:
        """Restore a deleted recording. Return its row.

        Raises:
            LogError: The recording cannot be restored.
        """
        if Path(name).name != name or not name.endswith(".mcap"):
            raise NotFound(f"{name} is not the name of a recording")
        restore(self._folder / name)
        return self._row(self._folder / name)

    def _get(self, cache: "_Cache[T]", name: str, make: Callable[[Path], T], *more: Hashable) -> T:
        """Return a value that `make` computes from a recording. The value is cached.

        Raises:
            NotFound: There is no such recording.
            RecordingError: The recording cannot be read.
        """
        path = self.path(name)
        readable = self._readable(path)
        try:
            return cache.get((readable, *more), _version(readable), lambda: make(readable))
        except logs.RecordingError as error:
            raise logs.RecordingError(path, str(error).replace(f"{readable}: ", "")) from error

    def _readable(self, path: Path) -> Path:
        """Return a recording with an index: the file itself, or a copy of its valid part.

        Raises:
            RecordingError: The recording cannot be read.
        """
        if self._indexed.get(path.name, _version(path), lambda: _has_index(path)):
            return path
        if path.stat().st_size > MAX_COPY:
            raise logs.RecordingError(
                path, "is large and has no index; type armtree log recover FILE"
            )
        with self._copying, _changing(copy := self._copies / path.name):
            age = path.stat().st_mtime - copy.stat().st_mtime if copy.exists() else COPY_AGE
            if age >= COPY_AGE:
                logs.Recording(path)  # raises an error if the file is not a recording
                if not copy_valid(path, copy) or not IndexedRecording(copy).with_topic(_GOAL):
                    copy.unlink()
                    raise logs.RecordingError(path, "has no goal")
        return copy

    @cached_property
    def _copies(self) -> Path:
        # Made with the first copy, so that a killed server does not leave an empty folder.
        folder = Path(tempfile.mkdtemp(prefix="armtree-"))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        return folder

    def _names(self) -> list[str]:
        if not self._folder.is_dir():
            return []
        with os.scandir(self._folder) as entries:
            found = (each.name for each in entries if each.is_file(follow_symlinks=False))
            names = [name for name in found if name.endswith(".mcap")]
        return [name for name in names if not is_server_recording(Path(name))][:MAX_FILES]

    def _row(self, path: Path) -> Json:
        return self._rows.get(path.name, _version(path), lambda: _summary(path))


class _Cache(Generic[T]):
    """The newest values by key.

    Args:
        size: Largest number of values.
    """

    def __init__(self, size: int) -> None:
        self._size, self._lock = size, threading.RLock()
        self._values: OrderedDict[Hashable, tuple[Hashable, T]] = OrderedDict()

    def get(self, key: Hashable, version: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key and version. Only one thread at a time makes a value."""
        with self._lock:
            if key not in self._values or self._values[key][0] != version:
                self._values[key] = version, make()
            self._values.move_to_end(key)
            while len(self._values) > self._size:
                self._values.popitem(last=False)
            return self._values[key][1]

    def keep(self, keys: Set[Hashable]) -> None:
        """Remove the values of all other keys."""
        with self._lock:
            for key in self._values.keys() - keys:
                del self._values[key]

    def values(self) -> "list[T]":
        """Return all values."""
        with self._lock:
            return [value for _, value in self._values.values()]


@contextmanager
def _changing(path: Path) -> Iterator[None]:
    """Convert errors of the operating system in this context to errors of a recording.

    Raises:
        RecordingError: The operating system reported an error.
    """
    try:
        yield
    except OSError as cause:
        raise logs.RecordingError(path, f"cannot be changed ({cause.strerror})") from cause


def _version(path: Path) -> Hashable:
    facts = path.stat()
    return facts.st_mtime_ns, facts.st_size, facts.st_mode


def _summary(path: Path) -> Json:
    """Return the row of a recording, from its first and last messages."""
    facts = path.stat()
    stamp_ns, task = by_name(path.name) or (facts.st_mtime_ns, None)
    row = {
        "name": path.name,
        "bytes": facts.st_size,
        "stamp_ns": stamp_ns,
        "task": task,
        "title": "" if task is None else logs.goal_title(task),
        "state": "",
        "code": "",
        "message": "",
        "duration_s": None,
        "pinned": pinned(path),
    }
    try:
        recording = IndexedRecording(path)
        goal = recording.record_at(0, logs.Goal)
        result = recording.record_at(-1, logs.Result)
    except logs.LogError as error:
        return row | {"state": "UNFINISHED", "code": error.code, "message": str(error)}
    if goal:
        row |= {"task": goal.task, "title": logs.goal_title(goal.task, goal.name)}
    if result:
        row |= {"state": result.state, "code": result.code, "message": result.message}
        row["duration_s"] = result.duration
    elif goal:
        lost = ServerRestarted()
        row |= {"state": "UNFINISHED", "code": lost.code, "message": str(lost)}
    return {k: v[:_MAX_TEXT] if isinstance(v, str) else v for k, v in row.items()}


def _has_index(path: Path) -> bool:
    """Return True if a recording can be read by its index."""
    try:
        IndexedRecording(path)
    except logs.LogError:
        return False
    return True


def _printed(words: Sequence[str]) -> str:
    """Run an armtree command, and return its output.

    Raises:
        TimeoutExpired: The command took more than `VERIFY_TIMEOUT`, and was killed.
    """
    command = [sys.executable, "-P", "-m", "armtree", *words]
    silent = subprocess.DEVNULL
    with subprocess.Popen(
        command, stdin=silent, stdout=subprocess.PIPE, stderr=silent, start_new_session=True
    ) as process:
        os.setpriority(os.PRIO_PROCESS, process.pid, _NICE)
        try:
            return process.communicate(timeout=VERIFY_TIMEOUT)[0].decode()
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # also ends the processes that it has started
            raise
