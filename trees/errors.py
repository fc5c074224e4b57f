"""Errors of task files.

TreeError
├── FileError           a file has mistakes; it holds all of them
│   ├── DuplicateTask   two files have the same number
│   └── BadArguments    the arguments of a task are wrong
└── UnknownTask         no task has that number or name
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from hardware.suggestions import there_are

SHIPPED_ROBOT = "arduinobot"  # name of the robot that the shipped tasks and examples are for
EXAMPLES = Path(__file__).with_name("examples")  # folder with example tasks

_SHOWN = 20  # mistakes in a message
_BEFORE, _WIDTH = 40, 76  # characters of a line in an excerpt
_BEGIN, _END = 600, 200  # characters of a message, if it is cut


@dataclass(frozen=True, slots=True)
class Place:
    """A place in a file.

    Attributes:
        path: The file.
        line: Line, from 1; 0 for the whole file.
        column: Column, from 1; 0 for the whole file.
        location: Path through the document, such as `tree.sequence[2].Wait.duration`.
        lines: All lines of the file.
    """

    path: Path
    line: int
    column: int
    location: str = field(default="", compare=False)
    lines: Sequence[str] = field(default=(), compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.path}:{self.line}:{self.column}" if self.line else str(self.path)

    @property
    def brackets(self) -> str:
        """The text from the bracket here to the one that closes it; empty if that is not here."""
        depth, line = 0, self.lines[self.line - 1] if 0 < self.line <= len(self.lines) else ""
        for column, sign in enumerate(line[self.column - 1 :], 1):
            depth += (sign in "{[") - (sign in "}]")
            if depth <= 0:
                return line[self.column - 1 : self.column - 1 + column] if column > 1 else ""
        return ""

    def replaced(self, old: str, new: str) -> str:
        """Return the line with a new text in place of the old one; empty if that is not here."""
        line = self.lines[self.line - 1] if 0 < self.line <= len(self.lines) else ""
        before, after = line[: self.column - 1], line[self.column - 1 :]
        return before + new + after.removeprefix(old) if old and after.startswith(old) else ""

    @property
    def excerpt(self) -> str:
        """The line, with a caret below the column; empty if the text is not known."""
        if not 0 < self.line <= len(self.lines):
            return ""
        begin = max(0, self.column - 1 - _BEFORE)
        shown = self.lines[self.line - 1][begin : begin + _WIDTH].replace("\t", " ")
        pointer = f"{' ' * (self.column - 1 - begin)}^ {self.location}".rstrip()
        return f"    {_printable(shown)}\n    {_cut(pointer)}"


@dataclass(frozen=True, slots=True)
class Mistake:
    """A mistake in a file.

    Attributes:
        place: Where it is.
        message: What is wrong, and what to do.
        instead: The line as it should be, or several lines; empty if that is not known.
    """

    place: Place
    message: str
    instead: str = ""

    def __str__(self) -> str:
        text = _cut(f"{self.place}: {self.message}")
        if excerpt := self.place.excerpt:
            text += f"\n{excerpt}"
        if self.instead:
            text += "\n  write:" + "".join(
                f"\n    {_cut(line)}" for line in self.instead.split("\n")
            )
        return text


def _cut(words: str) -> str:
    """Return a message without its middle if it is long."""
    whole = len(words) <= _BEGIN + _END
    return _printable(words if whole else f"{words[:_BEGIN]} … {words[-_END:]}")


def _printable(words: str) -> str:
    """Replace control characters, because a message may quote text of a client."""
    return "".join(c if c.isprintable() else "?" for c in words)


class Mistakes:
    """Collects mistakes, at most one per place.

    Args:
        known: Mistakes that are known already. A mapping and its first key begin at the same place;
            their locations in the document differ.
    """

    def __init__(self, known: Iterable[Mistake] = ()) -> None:
        self.found = list(known)
        self._reported = {_where(mistake.place) for mistake in self.found}

    def add(self, place: Place, message: str, instead: str = "") -> None:
        """Add a mistake, unless its place has one."""
        if _where(place) not in self._reported:
            self.found.append(Mistake(place, message, instead))

    def add_also(self, place: Place, message: str) -> None:
        """Add a mistake of a node, although its place may have others."""
        self.found.append(Mistake(place, message))

    def add_last(self, place: Place, message: str, instead: str = "") -> None:
        """Add a mistake; later ones at the same place are dropped."""
        self.add(place, message, instead)
        self._reported.add(_where(place))

    def take(self, mistakes: Iterable[Mistake]) -> None:
        """Add several mistakes; later ones at the same places are dropped."""
        taken = list(mistakes)
        self.found += [m for m in taken if _where(m.place) not in self._reported]
        self._reported |= {_where(mistake.place) for mistake in taken}


def _where(place: Place) -> tuple[Place, str]:
    return place, place.location


class TreeError(Exception):
    """A folder or file of tasks cannot be read. Root of the errors of task files."""

    code = "file.error"
    exit_status = 3
    hint = "correct it at the line that the message names"


class FileError(TreeError):
    """A task file is wrong; the message lists every mistake with its line.

    Attributes:
        mistakes: All mistakes, without duplicates, ordered by file and line.
    """

    code = "file.task"
    hint = "correct it, then `armtree check`"

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(sorted(set(mistakes), key=_order))
        lines = [str(mistake) for mistake in self.mistakes[:_SHOWN]]
        if len(self.mistakes) > _SHOWN:
            lines.append(f"and {len(self.mistakes) - _SHOWN} more mistakes")
        super().__init__("\n".join(lines))


def _order(mistake: Mistake) -> tuple[str, int, int, str]:
    place = mistake.place
    return str(place.path), place.line, place.column, mistake.message


class DuplicateTask(FileError):
    """Two files have the same task number.

    Args:
        number: The number.
        first: The first file.
        second: Place of the number in the second file.
        replaces: Name of the first task, if the second may replace it; else empty.
    """

    code = "file.duplicate_task"
    hint = "rename one of them"

    def __init__(self, number: int, first: Path, second: Place, replaces: str) -> None:
        what = f"task {number} is in two files, {first} and {second.path}"
        advice = f"rename this one, or add the line replaces: {replaces}" if replaces else self.hint
        super().__init__([Mistake(second, f"{what}: {advice}")])


class BadArguments(FileError):
    """The arguments of a task are wrong; its file is not."""

    code = "goal.bad_arguments"
    exit_status = 4
    hint = "`armtree tasks` shows what each task takes"

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        super().__init__(map(_without_line, mistakes))


def _without_line(mistake: Mistake) -> Mistake:
    """Return a mistake whose place has no line and column if its text has only one line."""
    place = mistake.place
    return mistake if len(place.lines) > 1 else replace(mistake, place=Place(place.path, 0, 0))


class UnknownTask(TreeError):
    """No task has that number or name.

    Attributes:
        task: Number or name.
        known: The numbers or names of all tasks.
        robot: Name of the robot that they are for.
    """

    code = "goal.unknown_task"
    exit_status = 4
    hint = "`armtree tasks` lists them"

    def __init__(
        self, task: int | str, known: Iterable[int | str], robot: str = SHIPPED_ROBOT
    ) -> None:
        self.task, self.known, self.robot = task, tuple(known), robot
        if isinstance(task, str):
            words = f"Invalid task name {task}; {there_are(task, map(str, self.known))}"
        else:
            there = ", ".join(map(str, self.known)) or "none"
            words = f"Invalid task number {task}; there are {there}"
        if not self.known:
            words += f". No task is for the robot {robot}; `armtree new` writes one, and "
            words += "`armtree move` moves it without a task"
        elif any(str(task) in path.stem.split("_", 1) for path in EXAMPLES.glob("*.yaml")):
            words += f". {task} is an example: give {EXAMPLES} as the folder of tasks"
        super().__init__(words)
