"""Finding task files: those that ship, and a user's own folder on top.

A task's file is named by its number and name, `1_pick.yaml`, so that one of many is found without
reading the others; any other `.yaml` file holds a subtree named like the file.
"""

import re
from importlib import resources
from pathlib import Path

from .document import read_text
from .errors import DuplicateTask, FileError, Mistake, Place, UnknownTask
from .grammar import SubtreeFile, TaskFile, choices, parse_subtree, parse_task

_TASK = re.compile(r"([0-9]+)_.+\.yaml")
_ALMOST_TASK = re.compile(r"[0-9].*\.ya?ml")


class Library:
    """The tasks there are.

    Args:
        folder: A user's own task files; None for only those that ship.

    Raises:
        FileError: The folder is not there or cannot be read, or a file in it is named wrongly.
        DuplicateTask: Two files claim one number.
    """

    def __init__(self, folder: Path | None = None) -> None:
        folders = [Path(str(resources.files(__package__)))]
        if folder is not None:
            if not folder.is_dir():
                raise _misnamed(folder, "there is no such folder")
            folders += [] if folder.samefile(folders[0]) else [folder]
        self._tasks: dict[int, Path] = {}
        self._subtrees: dict[str, Path] = {}
        for path in (path for folder in folders for path in _files(folder)):
            self._add(path)

    def _add(self, path: Path) -> None:
        if named := _TASK.fullmatch(path.name):
            self._add_task(int(named[1]), path)
        elif _ALMOST_TASK.fullmatch(path.name):
            raise _misnamed(path, "a task's file is named like 3_wave.yaml; rename this one")
        elif path.suffix == ".yaml":
            self._add_subtree(path.stem, path)

    def _add_task(self, number: int, path: Path) -> None:
        if number in self._tasks:
            raise DuplicateTask(number, self._tasks[number], path)
        self._tasks[number] = path

    def _add_subtree(self, name: str, path: Path) -> None:
        if name in self._subtrees:
            there = self._subtrees[name]
            raise _misnamed(path, f"subtree {name} is in {there} already; rename this one")
        self._subtrees[name] = path

    def numbers(self) -> list[int]:
        """The task numbers there are, ascending."""
        return sorted(self._tasks)

    def task(self, number: int) -> TaskFile:
        """Read a task.

        Raises:
            UnknownTask: No file has that number.
            FileError: The file is wrong.
        """
        if number not in self._tasks:
            raise UnknownTask(number, self.numbers())
        path = self._tasks[number]
        task = parse_task(path, read_text(path))
        if task.number != number:
            message = f"the file is named for task {number} but says task {task.number}"
            raise FileError([Mistake(Place(path, 1, 1), message)])
        return task

    def subtree(self, name: str, asked: Place) -> SubtreeFile:
        """Read a subtree.

        Args:
            name: Which.
            asked: Where it is asked for.

        Raises:
            FileError: There is none of that name, or its file is wrong.
        """
        if name not in self._subtrees:
            there = choices(name, self._subtrees)
            raise FileError([Mistake(asked, f"no subtree {name}; there are {there}")])
        path = self._subtrees[name]
        subtree = parse_subtree(path, read_text(path))
        if subtree.name != name:
            message = f"the file is named {path.name} but says subtree {subtree.name}"
            raise FileError([Mistake(Place(path, 1, 1), message)])
        return subtree


def _files(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise _misnamed(folder, f"this folder cannot be read: {error.strerror}") from error


def _misnamed(path: Path, message: str) -> FileError:
    return FileError([Mistake(Place(path, 0, 0), message)])
