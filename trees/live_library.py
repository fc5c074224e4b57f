"""The library of a server: each goal gets the latest valid version of the task files."""

import os
import threading
from collections import deque
from pathlib import Path
from typing import Any

from hardware import Robot

from .check import compile_task
from .declarations import UNITS, Declaration
from .errors import FileError, TreeError, UnknownTask
from .export.node_table import node_table
from .reading.document import read_text
from .reading.library import Library, shipped_folders, with_robot

KEPT = 16  # largest number of snapshots; older ones are dropped

_Stamp = tuple[int, int, int] | None


class _Snapshot:
    """The texts of all files at one moment.

    Args:
        own: The user's folder, or None.
        robot: Name of the robot.
        before: The previous snapshot, or None. Files that have not changed are not read again.

    Attributes:
        own: The user's folder, or None.
        nodes: The table of nodes of each task without mistakes, by number of the task.
    """

    def __init__(self, own: Path | None, robot: str, before: "_Snapshot | None" = None) -> None:
        self.own = own
        folders = [*shipped_folders(robot), *(with_robot(own, robot) if own else ())]
        self._stamps = {folder: _stamp(folder) for folder in folders}
        self._texts: dict[Path, str | FileError] = {}
        self._errors: dict[tuple[int, bool], TreeError | None] = {}
        self.nodes: dict[int, list[dict[str, Any]]] = {}
        for path in (path for folder in folders for path in sorted(folder.glob("*.y*ml"))):
            self._stamps[path] = _stamp(path)
            if before and path in before._texts and before._stamps[path] == self._stamps[path]:
                self._texts[path] = before._texts[path]
            else:
                self._texts[path] = _text(path)
        self._library: Library | FileError
        try:
            self._library = Library(own, robot, self._read)
        except FileError as error:
            self._library = error

    @property
    def library(self) -> Library:
        """The library of these files.

        Raises:
            FileError: The user's folder cannot be read.
        """
        if isinstance(self._library, FileError):
            # A kept traceback would grow with each raise.
            raise self._library.with_traceback(None)
        return self._library

    @property
    def is_current(self) -> bool:
        """True if no file has changed since the snapshot."""
        return all(_stamp(path) == stamp for path, stamp in self._stamps.items())

    def error(self, number: int, robot: Robot, validated: bool = True) -> TreeError | None:
        """Return the error of a task, or None.

        Args:
            number: Number of the task.
            robot: The robot.
            validated: True to let its skills validate their inputs, too.
        """
        if (number, validated) not in self._errors:
            try:
                tree = compile_task(robot, self.library, number, validated=validated)
                self.nodes[number] = node_table(tree)
                self._errors[number, validated] = None
            except UnknownTask as error:
                return error  # not kept, because a client may request any number
            except TreeError as error:
                self._errors[number, validated] = error
        return self._errors[number, validated]

    def _read(self, path: Path) -> str:
        text = self._texts[path] if path in self._texts else _text(path)
        if isinstance(text, FileError):
            raise text.with_traceback(None)
        return text


class LiveLibrary:
    """The task files of a server. Each goal gets a library of the latest valid files.

    A snapshot has the texts of all files. If the changed files of a task are invalid, the task runs
    from the latest snapshot in which it was valid. A new snapshot is made at the start, and before
    a goal if a file has changed.

    Args:
        folder: The user's task files; None for only the shipped ones.
        robot: The robot. Tasks are checked for it.
        default: Folder to use if `folder` is None, as soon as this folder exists, or None.

    Raises:
        FileError: The folder does not exist or cannot be read.
    """

    def __init__(self, folder: Path | None, robot: Robot, default: Path | None = None) -> None:
        self._robot, self._lock = robot, threading.Lock()
        self._folder, self._default = folder, default if folder is None else None
        first = _Snapshot(self.folder, robot.name)
        if folder:
            self._folder = first.own = first.library.folder  # None for the shipped folder
        self._snapshots = deque([first], KEPT)  # newest first
        self._rows: tuple[_Snapshot, list[dict[str, Any]]] | None = None

    @property
    def folder(self) -> Path | None:
        """The user's folder, or None."""
        if self._folder is None and self._default and self._default.is_dir():
            self._folder = self._default
        return self._folder

    def for_task(self, number: int) -> tuple[Library, str]:
        """Return the library for the next goal of a task, and a warning.

        The library has the latest files in which the task is valid. The warning is empty if these
        are the current files.

        Raises:
            UnknownTask: No current task has that number.
            TreeError: The task is valid in no snapshot. A skill's refusal of an input alone does
                not raise: the goal then fails with the error of the skill.
        """
        with self._lock:
            snapshot, warning = self._valid(number)
            return snapshot.library, warning

    def nodes(self, number: int) -> list[dict[str, Any]]:
        """Return the table of nodes of a task, as the next goal runs it. See `node_table`.

        Raises:
            UnknownTask: No current task has that number.
            TreeError: As for `for_task`.
        """
        with self._lock:
            return self._valid(number)[0].nodes[number]

    def _valid(self, number: int) -> tuple[_Snapshot, str]:
        """Return the snapshot from which a task runs, and a warning if it is not the latest one."""
        now, *before = self._updated()
        error = now.error(number, self._robot)
        if error is None:
            return now, ""
        valid = (each for each in before if each.error(number, self._robot) is None)
        if isinstance(error, UnknownTask) or not (last := next(valid, None)):
            if now.error(number, self._robot, validated=False) is None:
                return now, ""  # the goal then fails with the error of the skill
            # A kept traceback would grow with each raise.
            raise error.with_traceback(None)
        warning = f"Task {number} runs in its last valid version, "
        warning += "because its changed files are wrong: "
        return last, f"{warning}{error}"

    @property
    def latest(self) -> Library:
        """The library of the current files.

        Raises:
            FileError: The folder cannot be read.
        """
        with self._lock:
            return self._updated()[0].library

    def listed(self) -> list[dict[str, Any]]:
        """Return the current tasks as JSON objects.

        Raises:
            FileError: The folder cannot be read.
        """
        with self._lock:
            now = self._updated()[0]
            if not self._rows or self._rows[0] is not now:
                library = now.library
                self._rows = now, [_row(library, number) for number in library.numbers()]
            return self._rows[1]

    def _updated(self) -> deque[_Snapshot]:
        """Return the snapshots, newest first. Makes a new one if a file has changed."""
        folder, last = self.folder, self._snapshots[0]
        if folder != last.own or not last.is_current:
            now = _Snapshot(folder, self._robot.name, last)
            self._snapshots.appendleft(now)
        return self._snapshots


def _row(library: Library, number: int) -> dict[str, Any]:
    row: dict[str, Any] = {"task": number, "wrong": ""}
    try:
        path = library.path(number)
        task = library.head(number)
    except FileError as error:
        source = str(error.mistakes[0].place.path)
        row |= {"source": source, "name": "", "description": "", "wrong": str(error)}
        return {**row, "parameters": {}, "inputs": {}, "retry_safe": False}
    return {
        **row,
        "name": task.name,
        "description": task.description,
        "parameters": {name: declared.type for name, declared in task.parameters.items()},
        "inputs": {name: _input(declared) for name, declared in task.parameters.items()},
        "retry_safe": task.retry_safe,
        "source": "shipped" if path.parent in library.shipped else str(path),
    }


def _input(declared: Declaration) -> dict[str, Any]:
    """Return the properties of a parameter for a form."""
    default = declared.default
    is_text = default is not None and isinstance(default.value, str)
    return {
        "type": declared.type,
        "unit": declared.unit,
        "units": dict(UNITS.get(declared.type, {})),
        "needed": declared.needed,
        "default": "" if default is None else str(default.value if is_text else default),
        "least": declared.least,
        "most": declared.most,
        "choices": list(declared.choices),
        "description": declared.description,
    }


def _text(path: Path) -> str | FileError:
    try:
        return read_text(path)
    except FileError as error:
        return error


def _stamp(path: Path) -> _Stamp:
    """Return time, size and inode of a file or folder; None if it does not exist."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
