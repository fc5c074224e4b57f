"""Finding task files: those that ship, and a user's own folder on top.

A task's file is named by its number and name, `1_pick.yaml`, so that one of many is found without
reading the others; any other `.yaml` file holds a subtree named like the file.
"""

import re
from importlib import resources
from pathlib import Path

from .errors import DuplicateTask, FileError, Mistake, Place, UnknownTask
from .grammar import SubtreeFile, TaskFile, parse_subtree, parse_task

_TASK = re.compile(r"(\d+)_.+\.yaml")


class Library:
    """The tasks there are.

    Args:
        folder: A user's own task files; None for only those that ship.

    Raises:
        FileError: The folder is not there.
        DuplicateTask: Two files claim one number.
    """

    def __init__(self, folder: Path | None = None) -> None:
        folders = [Path(str(resources.files(__package__)))]
        if folder is not None and folder.resolve() != folders[0].resolve():
            if not folder.is_dir():
                raise FileError([Mistake(Place(folder, 0, 0), "there is no such folder")])
            folders.append(folder)
        self._tasks: dict[int, Path] = {}
        self._subtrees: dict[str, Path] = {}
        for path in (path for folder in folders for path in sorted(folder.glob("*.yaml"))):
            self._add(path)

    def _add(self, path: Path) -> None:
        named = _TASK.fullmatch(path.name)
        if named is None:
            self._subtrees[path.stem] = path
            return
        number = int(named[1])
        if number in self._tasks:
            raise DuplicateTask(number, self._tasks[number], path)
        self._tasks[number] = path

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
        task = parse_task(path, _read(path))
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
            there = ", ".join(sorted(self._subtrees)) or "none"
            raise FileError([Mistake(asked, f"no subtree {name}; there are {there}")])
        path = self._subtrees[name]
        subtree = parse_subtree(path, _read(path))
        if subtree.name != name:
            message = f"the file is named {path.name} but says subtree {subtree.name}"
            raise FileError([Mistake(Place(path, 1, 1), message)])
        return subtree


def _read(path: Path) -> str:
    start = Place(path, 1, 1)
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileError([Mistake(start, f"cannot be read: {error.strerror}")]) from error
    except UnicodeDecodeError as error:
        raise FileError([Mistake(start, f"is not UTF-8 text: {error.reason}")]) from error
