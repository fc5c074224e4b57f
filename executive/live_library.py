"""Task files that may change while a server runs: a goal takes the last that were right."""

import logging
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from hardware import Robot
from trees import FileError, Library, TreeError, UnknownTask, read_text

from .building.check import outline_of

logger = logging.getLogger(__name__)

_Seen = tuple[int, int, int] | None


@dataclass(slots=True)
class _Texts:
    """Files, each read once, and how they looked then."""

    texts: dict[Path, str] = field(default_factory=dict)
    seen: dict[Path, _Seen] = field(default_factory=dict)

    def read(self, path: Path) -> str:
        """The text of a file, as it was when it was first asked for."""
        if path not in self.texts:
            self.seen[path] = _look(path)
            self.texts[path] = read_text(path)
        return self.texts[path]

    @property
    def unchanged(self) -> bool:
        """Whether all of them look as they did."""
        return all(_look(path) == seen for path, seen in self.seen.items())


class LiveLibrary(Library):
    """A library whose files are looked at anew for every goal, and never in the middle of one.

    A task whose files have become wrong is run as it was when they were right last.

    Args:
        folder: As of `Library`.
        robot: Whose tasks.

    Raises:
        FileError: As of `Library`.
        DuplicateTask: As of `Library`.
    """

    def __init__(self, folder: Path | None, robot: Robot) -> None:
        super().__init__(folder)
        self._robot = robot
        self._good: dict[int, tuple[Library, _Texts]] = {}
        self._list: tuple[list[dict[str, Any]], _Texts] | None = None

    def for_task(self, number: int) -> Library:
        """The files of a task: as they are now, or as they were when they were right last.

        Raises:
            UnknownTask: There is none of that number.
            TreeError: They are wrong, and never were right.
        """
        good = self._good.get(number)
        if good and good[1].unchanged:
            return good[0]
        try:
            self._good[number] = self._check(number)
        except UnknownTask:
            raise
        except TreeError as error:
            if not good:
                raise
            logger.warning(
                "Task %d runs as it was: its files were changed and are wrong now: %s",
                number,
                error,
            )
        return self._good[number][0]

    def listed(self) -> list[dict[str, Any]]:
        """The tasks there are now, in a few words each.

        Raises:
            TreeError: The folder cannot be made sense of.
        """
        if not (self._list and self._list[1].unchanged):
            library, texts = self._look()
            self._list = [_listed(library, number) for number in library.numbers()], texts
        return self._list[0]

    def _check(self, number: int) -> tuple[Library, _Texts]:
        library, texts = self._look()
        outline_of(self._robot, library, number)
        return library, texts

    def _look(self) -> tuple[Library, _Texts]:
        """The files as they are now, each read when it is needed and kept as it was then."""
        texts = _Texts()
        for folder in filter(None, (self.shipped, self.folder)):
            texts.seen[folder] = _look(folder)
        return _Frozen(self.folder, texts.read), texts


class _Frozen(Library):
    """A library whose files do not change, so each is parsed once."""

    def __init__(self, folder: Path | None, read: Callable[[Path], str]) -> None:
        super().__init__(folder, read)
        self.draft = cache(self.draft)  # type: ignore[method-assign]
        self.subtree = cache(self.subtree)  # type: ignore[method-assign]
        self.poses = cache(self.poses)  # type: ignore[method-assign]


def _listed(library: Library, number: int) -> dict[str, Any]:
    path = library.path(number)
    row: dict[str, Any] = {"task": number, "source": str(path), "wrong": ""}
    try:
        task = library.head(number)
    except FileError as error:
        return {**row, "name": "", "description": "", "parameters": {}, "wrong": str(error)}
    parameters = {name: declared.type for name, declared in task.parameters.items()}
    return {
        **row,
        "name": task.name,
        "description": task.description,
        "parameters": parameters,
        "source": "shipped" if path.parent == library.shipped else str(path),
    }


def _look(path: Path) -> _Seen:
    """What changes where a file or a folder does; None where there is none."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
