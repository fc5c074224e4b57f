"""The library of task files for a robot: shipped files, and files in the user's folder.

Files directly in one of these folders are for every robot. The exception is `poses.yaml`: it is for
the default robot, because a pose names joints. Files in a subfolder `NAME` are only for the robot
of that name.

The name of a file contains number and name of its task, such as `1_pick.yaml`. Therefore a task is
found without reading other files. `poses.yaml` contains poses. Any other `.yaml` file is a subtree.
"""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from itertools import count
from pathlib import Path
from typing import Protocol

from hardware import shipped_robots
from hardware.spelling import there_are
from trees.errors import (
    SHIPPED_ROBOT,
    Correction,
    DuplicateTask,
    FileError,
    Mistake,
    Place,
    UnknownTask,
)

from .document import read_text
from .grammar import (
    Draft,
    PosesFile,
    TaskFile,
    draft_poses,
    draft_subtree,
    draft_task,
    parse_head,
)

_TASK = re.compile(r"([0-9]+)_[\w.-]+\.yaml")
_SUBTREE = re.compile(r"(?!poses)[A-Za-z].*\.yaml")
_ALMOST_TASK = re.compile(r"([0-9]+)[\W_]*(.*)\.ya?ml")
AS_TEXT = re.compile(r"([0-9]+_.+\.yaml)\.txt")  # as some editors save it
_NAME = re.compile(r"^name: *([A-Za-z][\w-]*) *$", re.MULTILINE)
_HEAD = re.compile(r"^[\"']?(task|subtree)[\"']?: *(\w{0,99})", re.MULTILINE)
POSES = "poses.yaml"


@cache
def _kept(draft: Callable[[Path, str], Draft], path: Path, text: str) -> Draft:
    """Read a shipped file, and keep the result: nearly every tree uses some of these files."""
    return draft(path, text)


def with_robot(folder: Path, robot: str) -> tuple[Path, ...]:
    """Return a folder of task files, and its subfolder for a robot if that exists."""
    own = folder / robot
    return (folder, own) if own.parent == folder and os.path.isdir(own) else (folder,)


def shipped_folders(robot: str) -> tuple[Path, ...]:
    """Return the folders of the shipped files for a robot."""
    return with_robot(Path(__file__).parents[1] / "tasks", robot)


def pose_paths(folders: Iterable[Path], robot: str) -> list[Path]:
    """Return the files of poses for a robot in some folders."""
    named = [each for each in folders if robot in (SHIPPED_ROBOT, each.name)]
    return [each / POSES for each in named if os.path.lexists(each / POSES)]


def read_poses(
    paths: Iterable[Path], read: Callable[[Path], str] = read_text
) -> tuple[tuple[PosesFile, ...], list[Mistake]]:
    """Read files of poses. Return them and all mistakes.

    Raises:
        FileError: A file is not YAML.
    """
    files, mistakes = list[PosesFile](), list[Mistake]()
    for path in paths:
        file, wrong = draft_poses(path, read(path))
        mistakes += [*wrong, *_replaced_poses(file, poses_of(files))]
        files.append(file)
    return tuple(files), mistakes


class TaskLibrary(Protocol):
    """The task files of an executive. The files may change between two goals."""

    @property
    def latest(self) -> "Library":
        """The library of the current files.

        Raises:
            FileError: The user's folder cannot be read.
        """

    def for_task(self, number: int) -> "tuple[Library, str]":
        """Return the library for the next goal of a task, and a warning or "".

        Raises:
            UnknownTask: No task has that number.
            TreeError: The task has mistakes.
        """


class Library:
    """The tasks, subtrees and poses of a robot. A file is read when needed, and parsed once.

    Args:
        folder: Folder of the user's files; None for only the shipped ones.
        robot: Name of the robot. Default: arduinobot.
        read: Callback that returns the text of a file.

    Attributes:
        shipped: Folders of the shipped files.
        folder: Folder of the user's files, or None.
        folders: All folders.
        robot: Name of the robot.
        read: Callback that returns the text of a file.
        mistakes: Mistakes of file names, and of files with the same number or name. Only the tasks
            and subtrees of these files are unusable.
        notes: Notes about files that are ignored.

    Raises:
        FileError: The folder does not exist or cannot be read.
    """

    def __init__(
        self,
        folder: Path | None = None,
        robot: str = SHIPPED_ROBOT,
        read: Callable[[Path], str] = read_text,
    ) -> None:
        self.robot, self.read = robot, read
        self._drafted = cache(self._drafted)  # type: ignore[method-assign]
        self.draft_poses = cache(self.draft_poses)  # type: ignore[method-assign]
        self.shipped = shipped_folders(robot)
        if folder is not None:
            if not folder.is_dir():
                raise _no_folder(folder, "there is no such folder")
            if any(map(folder.samefile, self.shipped)):
                folder = None
        self.folder = folder
        self.folders = (*self.shipped, *(with_robot(folder, robot) if folder else ()))
        # The file of each task, by number, and of each subtree, by name.
        self._paths: dict[int | str, Path] = {}
        self._poses = pose_paths(self.folders, robot)
        # Error of a number or name that several files have.
        self._claimed: dict[int | str, FileError] = {}
        # Number or name of each file whose number or name an earlier file has.
        self._seconds: dict[Path, int | str] = {}
        # The shipped file, by the user's file that replaces it.
        self._replaced: dict[Path, Path] = {}
        self.mistakes: list[Mistake] = []
        self.notes: list[Mistake] = []
        for each in self.folders:
            for name in _files(each):
                try:
                    self._add(each, name)
                except FileError as error:
                    self.mistakes += error.mistakes

    def _add(self, folder: Path, name: str) -> None:
        if saved := AS_TEXT.fullmatch(name):
            why = f"is not read, because its name ends in .txt; rename it to {saved[1]}"
            self.notes.append(Mistake(Place(folder / name), why))
        if name.startswith(".") or not name.lower().endswith((".yaml", ".yml")):
            return
        path = folder / name
        if not name.endswith(".yaml") and not _ALMOST_TASK.fullmatch(name):
            self._leave(path)
        elif named := _TASK.fullmatch(name):
            self._claim(int(named[1]), path)
        elif almost := _ALMOST_TASK.fullmatch(name):
            text = self._text(path)
            place = _top(path, text, "task")
            like = self._free_file(almost[1], re.sub(r"\W+", "_", almost[2]) or "wave", text)
            wrong = f"a task's file is named like {like}; rename this file"
            raise FileError([Mistake(place, wrong)])
        elif name == POSES and path not in self._poses:
            where = f"the poses of the {self.robot} are in {folder / self.robot / POSES}"
            why = f"is not read: its poses are for the {SHIPPED_ROBOT}; {where}"
            self.notes.append(Mistake(Place(path), why))
        elif name != POSES:
            self._claim(path.stem, path)

    def _leave(self, path: Path) -> None:
        """Ignore a file that may belong to another program."""
        text = self._text(path)
        head = re.search(r"^(task|subtree|poses):", text, re.MULTILINE)
        message = "is not read: the name of a task file must end in .yaml"
        mistake = Mistake(_top(path, text, head[1] if head else ""), message)
        (self.mistakes if head else self.notes).append(mistake)

    def _claim(self, source: int | str, path: Path) -> None:
        """Add the file of a task or subtree. A user's file may replace a shipped one."""
        there = self._paths.setdefault(source, path)
        if there is path:
            return
        name = source if isinstance(source, str) else ""
        if not name and there.parent in self.shipped:
            name = _name(there)
        try:
            if name and self._draft(source, path)[0].replaces == name:
                self._paths[source], self._replaced[path] = path, there
                return
            self._seconds[path] = source
            place = _top(path, self._text(path), _what(source))
            if isinstance(source, int):
                free = self.free_number(source)
                raise DuplicateTask(source, there, place, free, name)
            why = f"subtree {name} is in {there} already; rename this file, or add the line "
            raise FileError([Mistake(place, f"{why}replaces: {name}")])
        except FileError as error:
            self._claimed[source] = error
            raise

    def _free_file(self, number: str, name: str, text: str) -> str:
        """Return a name for the file of a task, and the line of the key task if it must change.

        The name of the task is that in `text`, or else `name`.
        """
        name = named[1] if (named := _NAME.search(text)) else name
        free = self.free_number(int(number) if number.isdecimal() else 1)
        return f"{free}_{name}.yaml" + ("" if number == str(free) else f" and says task: {free}")

    def free_number(self, number: int) -> int:
        """Return the first number from `number` on that no task has."""
        names = (_TASK.fullmatch(name) for folder in self.folders for name in _files(folder))
        taken = {int(named[1]) for named in names if named}
        return next(n for n in count(number) if n not in taken)

    def _draft(self, source: int | str, path: Path) -> Draft:
        draft = draft_subtree if isinstance(source, str) else draft_task
        text = self._text_of(source, path)
        return _kept(draft, path, text) if path.parent in self.shipped else draft(path, text)

    def _text_of(self, source: int | str, path: Path) -> str:
        """Return the text of a task or subtree.

        Raises:
            FileError: The file cannot be read, or has the name of the other kind.
        """
        text = self.read(path)
        kinds = {head[1]: head[2] for head in _HEAD.finditer(text)}
        if kinds and _what(source) not in kinds:
            ((other, named),) = kinds.items()
            like = self._free_file(named, path.stem, text) if other == "task" else f"{named}.yaml"
            why = f"this is a {other}; its file needs a name like {like}: rename it"
            raise FileError([Mistake(_top(path, text, other), why)])
        return text

    def _text(self, path: Path) -> str:
        """Return the text of a file for messages; empty if it cannot be read."""
        try:
            return self.read(path)
        except FileError:
            return ""

    @property
    def latest(self) -> "Library":
        """This library: its files do not change."""
        return self

    def for_task(self, number: int) -> "tuple[Library, str]":
        """Return this library and no warning."""
        return self, ""

    def numbers(self) -> list[int]:
        """Return all task numbers, ascending."""
        return sorted(number for number in self._paths if isinstance(number, int))

    def names(self) -> dict[str, int]:
        """Return the numbers of the tasks by their names, in the order of the numbers."""
        return {_name(self._paths[number]): number for number in self.numbers()}

    def number(self, task: int | str) -> int:
        """Return the number of a task from its number or name.

        Raises:
            UnknownTask: No task has that number or name.
            TypeError: The argument is not a number and not a name.
        """
        if isinstance(task, bool) or not isinstance(task, int | str):
            raise TypeError(f"a task is a number or a name, not {task!r}")
        if isinstance(task, int):
            with suppress(FileError):  # the goal reports the mistakes of the file
                self.path(task)
            return task
        names = self.names()
        if task not in names:
            raise UnknownTask(task, names, self.robot, self._instead(task))
        return names[task]

    def subtrees(self) -> list[str]:
        """Return the names of all subtrees, in order."""
        return sorted(name for name in self._paths if isinstance(name, str))

    def path(self, source: int | str) -> Path:
        """Return the file of a task, by number, or of a subtree, by name.

        Raises:
            UnknownTask: No file has that number.
            FileError: Several files have that number or name, or the file has a wrong name.
            KeyError: No subtree has that name.
        """
        if source in self._claimed:
            raise self._claimed[source].with_traceback(None)
        if isinstance(source, int) and source not in self._paths:
            called = re.compile(rf"0*{source}(?![0-9])")
            if meant := [m for m in self.mistakes if called.match(m.place.path.name)]:
                raise FileError(meant)
            raise UnknownTask(source, self.numbers(), self.robot, self._instead(source))
        return self._paths[source]

    def _instead(self, task: int | str) -> str:
        """Return a message if an unknown task is a pose, subtree or task of another robot; or "".

        Raises:
            FileError: The task is in a file with the name of a subtree.
        """
        with suppress(FileError):  # `check` reports the mistakes of the poses
            if task in self.poses()[0]:
                return f"{task} is a pose, not a task: run `armtree move {task}`"
        for name in self.subtrees():
            if name == task or re.search(
                rf"^task: *{re.escape(str(task))}\b", self._text(self._paths[name]), re.M
            ):
                self._text_of(name, self._paths[name])
        for path in sorted(self.folder.glob("*/*_*.yaml")) if self.folder else ():
            named, robot = _TASK.fullmatch(path.name), path.parent.name
            if named and task in (int(named[1]), _name(path)):
                file = f"{robot}.toml"
                known = file if Path(file).is_file() else robot if robot in shipped_robots() else ""
                way = f"add --robot {known}" if known else "give its robot file with --robot"
                return f"{task} is a task of {robot}: {way}"
        why = f"{task} is a subtree, not a task: `subtree: {task}` in a task runs it"
        return why if task in self._paths else ""

    def task(self, number: int) -> TaskFile:
        """Read a task.

        Raises:
            UnknownTask: No file has that number.
            FileError: The file has mistakes.
        """
        task, mistakes = self.draft(number)
        if mistakes:
            raise FileError(mistakes)
        return task

    def head(self, number: int) -> TaskFile:
        """Read a task without its tree, for lists.

        Raises:
            UnknownTask: No file has that number.
            FileError: The part before the tree has mistakes.
        """
        path = self.path(number)
        task = parse_head(path, self._text_of(number, path))
        if wrong := _misnaming(task):
            raise FileError(wrong)
        return task

    def files(self) -> Iterator[tuple[Path, int | str | None]]:
        """Yield each file with its number or name; None for poses.

        Several files may have the same number or name.
        """
        yield from ((path, None) for path in self._poses)
        yield from ((self._paths[name], name) for name in self.subtrees())
        yield from ((self._paths[number], number) for number in self.numbers())
        yield from self._seconds.items()

    def draft(self, source: int | str, path: Path | None = None) -> Draft:
        """Read a task or subtree. Return the file and all mistakes.

        Args:
            source: Number of the task, or name of the subtree.
            path: Its file, if several files have the number or name.

        Raises:
            UnknownTask: No file has that number.
            FileError: The file is not YAML.
            KeyError: No subtree has that name.
        """
        return self._drafted(source, path or self.path(source))

    def _drafted(self, source: int | str, path: Path) -> Draft:
        file, mistakes = self._draft(source, path)
        reported = {mistake.place.location for mistake in mistakes}
        named = [m for m in _misnaming(file) if not {"", m.place.location} & reported]
        return file, [*mistakes, *named, *self._replacing(file, source)]

    def _replacing(self, file: TaskFile, source: int | str) -> list[Mistake]:
        """Return a list with one mistake if `replaces` names no shipped file; else []."""
        if not file.replaces or file.path in self._replaced:
            return []
        names = _SUBTREE if isinstance(source, str) else _TASK
        shipped = (Path(name) for folder in self.shipped for name in _files(folder))
        there = there_are(
            file.replaces, [each.stem for each in shipped if names.fullmatch(each.name)]
        )
        message = f"replaces: {_what(source)} {source} is not shipped; {there}"
        return [Mistake(_top(file.path, file.text, "replaces"), message)]

    def poses(self) -> tuple[Mapping[str, Mapping[str, float]], Mapping[str, str]]:
        """Read the poses.

        Returns:
            Joint positions [rad] by joint name, by name of the pose; and the texts of the files, by
            name.

        Raises:
            FileError: A file has mistakes, or has a shipped pose without `replaces`.
        """
        files, mistakes = self.draft_poses()
        if mistakes:
            raise FileError(mistakes)
        return poses_of(files), {self._shown(file): file.text for file in files}

    def draft_poses(self) -> tuple[tuple[PosesFile, ...], list[Mistake]]:
        """Read the poses. See `read_poses`."""
        return read_poses(self._poses, self.read)

    def _shown(self, file: PosesFile) -> str:
        """Return the name of a file of poses in a recording."""
        first = file.path == self._poses[0]
        return file.path.name if first else f"{file.path.parent.name}_{POSES}"


def poses_of(files: Iterable[PosesFile]) -> dict[str, Mapping[str, float]]:
    """Return joint positions [rad] by name of the pose. Later files replace earlier poses."""
    return {name: pose for file in files for name, pose in file.poses.items()}


def _replaced_poses(file: PosesFile, shipped: Mapping[str, object]) -> list[Mistake]:
    """Return the mistakes of a file of poses that concern the key `replaces`."""
    ships = [name for name in file.poses if name in shipped and name not in file.replaces]
    line = f"replaces: [{', '.join(ships)}]"
    right = None if file.replaces else Correction(line, file.text.count("\n") + 1, 0)
    why = "is shipped; to replace it, add it to replaces"
    mistakes = [Mistake(file.labels[name].label, f"pose {name} {why}", right) for name in ships]
    place = _top(file.path, file.text, "replaces")
    mistakes += [
        Mistake(place, f"replaces: pose {name} is not shipped; {there_are(name, shipped)}")
        for name in file.replaces
        if name and name not in shipped
    ]
    mistakes += [
        Mistake(place, f"replaces: this file has no pose {name}; {there_are(name, file.poses)}")
        for name in file.replaces
        if name in shipped and name not in file.poses
    ]
    return mistakes


def _what(source: int | str) -> str:
    return "subtree" if isinstance(source, str) else "task"


def _name(path: Path) -> str:
    """Return the name of a task from the name of its file."""
    return path.stem.partition("_")[2]


def _misnaming(file: TaskFile) -> list[Mistake]:
    """Return the mistakes of keys that contradict the name of the file."""
    key, name, wrong = "subtree", file.path.stem, list[Mistake]()
    if file.number is not None:
        key, name, number = "name", _name(file.path), int(name.partition("_")[0])
        if file.number != number:
            why = f"the file is named for task {number} but says task {file.number}"
            wrong.append(_renaming(file, why, "task", file.number, number))
    if file.name != name:
        why = f"the file is named {file.path.name} but says {key} {file.name}"
        wrong.append(_renaming(file, why, key, file.name, name))
    return wrong


def _renaming(file: TaskFile, why: str, key: str, old: object, new: object) -> Mistake:
    place = _top(file.path, file.text, key)
    right = place.replaced(f"{key}: {old}", f"{key}: {new}")
    return Mistake(place, f"{why}; rename the file, or change the line", right)


def _top(path: Path, text: str, key: str) -> Place:
    """Return the place of a top-level key."""
    lines = text.splitlines()
    line = next((n for n, each in enumerate(lines, 1) if each.startswith(f"{key}:")), 1)
    return Place(path, line, 1, key, lines)


def _files(folder: Path) -> list[str]:
    try:
        return sorted(os.listdir(folder))
    except OSError as error:
        raise _no_folder(folder, f"this folder cannot be read: {error.strerror}") from error


def _no_folder(path: Path, message: str) -> FileError:
    error = FileError.at(path, message)
    error.hint = "check the path of the folder"
    return error
