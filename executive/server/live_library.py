"""Task files that may change while a server runs: a goal takes the last that were right."""

import os
import threading
from collections import deque
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from executive.errors import NoSuchNode
from hardware import Robot
from hardware.suggestions import suggestion
from trees import FileError, Library, TreeError, UnknownTask, read_text
from trees.check import check_task, compile_task
from trees.compile.paths import paths

KEPT = 16  # states of the folders; the oldest are forgotten
_SHOWN = 20  # nodes in a message

_Seen = tuple[int, int, int] | None


class _Look:
    """All files as they were at one moment.

    Args:
        folders: Folders of the files.
        own: The user's folder, one of them; None if there is none.
        before: An earlier look, from which files are taken that have not changed.
    """

    def __init__(self, folders: list[Path], own: Path | None, before: "_Look | None") -> None:
        self._seen = {folder: _look(folder) for folder in folders}
        self._texts: dict[Path, str | FileError] = {}
        self._wrong: dict[tuple[int, bool], TreeError | None] = {}
        for path in (path for folder in folders for path in sorted(folder.glob("*.y*ml"))):
            self._seen[path] = _look(path)
            if before and path in before._texts and before._seen[path] == self._seen[path]:
                self._texts[path] = before._texts[path]
            else:
                self._texts[path] = _text(path)
        self._library: Library | FileError
        try:
            self._library = _Frozen(own, self._read)
        except FileError as error:
            self._library = error

    @property
    def library(self) -> Library:
        """What is in them.

        Raises:
            FileError: The user's folder cannot be read.
        """
        if isinstance(self._library, FileError):
            raise self._library
        return self._library

    @property
    def unchanged(self) -> bool:
        """Whether all files look as they did."""
        return all(_look(path) == seen for path, seen in self._seen.items())

    def wrong(self, number: int, robot: Robot, refused: bool = True) -> TreeError | None:
        """What was wrong with a task, by default with what its skills refuse of it."""
        if (number, refused) not in self._wrong:
            try:
                (check_task if refused else compile_task)(robot, self.library, number)
                self._wrong[number, refused] = None
            except TreeError as error:
                self._wrong[number, refused] = error
        return self._wrong[number, refused]

    def _read(self, path: Path) -> str:
        text = self._texts[path] if path in self._texts else _text(path)
        if isinstance(text, FileError):
            raise text
        return text


class LiveLibrary(Library):
    """A library whose files are looked at anew for every goal, and never in the middle of one.

    A task whose files have become wrong is run as it was when they were right last, in any of the
    states that the folders had at the start and at goals since.

    Args:
        folder: As of `Library`.
        robot: Whose tasks.

    Raises:
        FileError: As of `Library`.
    """

    def __init__(self, folder: Path | None, robot: Robot) -> None:
        super().__init__(folder)
        self._robot, self._lock = robot, threading.Lock()
        self._folders = [*self.shipped, *filter(None, (self.folder,))]
        self._looks = deque([_Look(self._folders, self.folder, None)], KEPT)  # the newest first
        self._rows: tuple[_Look, list[dict[str, Any]]] | None = None

    def for_task(self, number: int) -> tuple[Library, str]:
        """The files of a task: as they are now, or as they were when they were right last.

        Raises:
            UnknownTask: There is none of that number.
            TreeError: They are wrong, and never were right.
        """
        with self._lock:
            now, *before = self._now()
            error = now.wrong(number, self._robot)
            if error is None:
                return now.library, ""
            good = (look for look in before if look.wrong(number, self._robot) is None)
            if isinstance(error, UnknownTask) or not (last := next(good, None)):
                if now.wrong(number, self._robot, refused=False) is None:
                    return now.library, ""  # its goal ends with what the skill says
                raise error
            warning = f"Task {number} runs as it was: its files were changed and are wrong now: "
            return last.library, f"{warning}{error}"

    def listed(self) -> list[dict[str, Any]]:
        """The tasks there are now, in a few words each.

        Raises:
            FileError: The folder cannot be read.
        """
        with self._lock:
            now = self._now()[0]
            if not self._rows or self._rows[0] is not now:
                library = now.library
                self._rows = now, [_listed(library, number) for number in library.numbers()]
            return self._rows[1]

    def check_node(self, path: str) -> None:
        """See that some task has a node of that path.

        Raises:
            NoSuchNode: None has.
            FileError: The folder cannot be read.
        """
        tasks = {row["name"]: row["task"] for row in self.listed() if not row["wrong"]}
        name = path.partition("/")[0]
        if name not in tasks:
            likely = (
                suggestion(name, [*tasks]) or f"; it begins with a task's name: {', '.join(tasks)}"
            )
            raise NoSuchNode(f"no task is called {name}{likely}")
        library, _ = self.for_task(tasks[name])
        root = compile_task(self._robot, library, tasks[name]).root
        nodes = [each for _, each in paths(root)]
        if path not in nodes:
            there = ", ".join(nodes[:_SHOWN]) + suggestion(path, nodes)
            raise NoSuchNode(f"{name} has no node {path}; there are {there}")

    def _now(self) -> deque[_Look]:
        """The looks so far, the first of them as things are now."""
        if not self._looks[0].unchanged:
            self._looks.appendleft(_Look(self._folders, self.folder, self._looks[0]))
        return self._looks


class _Frozen(Library):
    """A library whose files do not change, so each is parsed once."""

    def __init__(self, folder: Path | None, read: Callable[[Path], str]) -> None:
        super().__init__(folder, read)
        self.draft = cache(self.draft)  # type: ignore[method-assign]
        self.subtree = cache(self.subtree)  # type: ignore[method-assign]
        self.poses = cache(self.poses)  # type: ignore[method-assign]


def _listed(library: Library, number: int) -> dict[str, Any]:
    row: dict[str, Any] = {"task": number, "wrong": ""}
    try:
        path = library.path(number)
        task = library.head(number)
    except FileError as error:
        source = str(error.mistakes[0].place.path)
        return {**row, "source": source, "name": "", "description": "", "parameters": {}} | {
            "wrong": str(error)
        }
    return {
        **row,
        "name": task.name,
        "description": task.description,
        "parameters": {name: declared.type for name, declared in task.parameters.items()},
        "source": "shipped" if path.parent in library.shipped else str(path),
    }


def _text(path: Path) -> str | FileError:
    try:
        return read_text(path)
    except FileError as error:
        return error


def _look(path: Path) -> _Seen:
    """What changes where a file or a folder does; None where there is none."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
