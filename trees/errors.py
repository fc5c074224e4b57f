"""Errors of task files. The root is TreeError."""

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Self

from hardware import ArmtreeError
from hardware.loading.dataclass import dataclass
from hardware.printable import excerpt, in_one_line
from hardware.spelling import there_are, there_are_numbers

SHIPPED_ROBOT = "arduinobot"  # default robot; the examples are for it
EXAMPLES = Path(__file__).with_name("examples")  # folder with example tasks

_SHOWN = 20  # largest number of mistakes in a message
_BEGIN, _END = 600, 200  # characters that a cut message keeps at its start and at its end
_LINES = 8  # largest number of lines of a correction in a message


@dataclass(frozen=True, slots=True)
class Correction:
    """Corrected lines of a file.

    Attributes:
        text: The new lines.
        line: First line to replace, from 1.
        count: Number of lines to replace; 0 to insert the text before `line`.
    """

    text: str
    line: int
    count: int = 1

    def __str__(self) -> str:
        above, last = self.line - 1, self.line + self.count - 1
        where = f"add below line {above}" if above else "add at the top"
        if self.count:
            where = "write" if self.count == 1 else f"write instead of lines {self.line} to {last}"
        lines = self.text.split("\n")
        more = len(lines) - _LINES
        shown = lines if more <= 1 else [*lines[:_LINES], f"… and {more} more lines"]
        return f"  {where}:" + "".join(f"\n    {_cut(line)}" for line in shown)


@dataclass(frozen=True, slots=True)
class Place:
    """A place in a file.

    Attributes:
        path: The file.
        line: Line, from 1; 0 for the whole file.
        column: Column, from 1; 0 for the whole file.
        location: Path through the document, such as `tree.sequence[2].repeat.times`.
        lines: All lines of the file.
    """

    path: Path
    line: int = 0
    column: int = 0
    location: str = field(default="", compare=False)
    lines: Sequence[str] = field(default=(), compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.path}:{self.line}:{self.column}" if self.line else str(self.path)

    @property
    def file_line(self) -> str:
        """Name of the file, and the line."""
        return f"{self.path.name}:{self.line}"

    @property
    def argument(self) -> str:
        """First name in `location`: for a place in arguments, the name of the argument."""
        return re.split(r"[.[]", self.location)[0]

    @property
    def brackets(self) -> str:
        """Text from the opening to the closing bracket; empty if they are not in this line."""
        depth, line = 0, self.lines[self.line - 1] if 0 < self.line <= len(self.lines) else ""
        for column, sign in enumerate(line[self.column - 1 :], 1):
            depth += (sign in "{[") - (sign in "}]")
            if depth <= 0:
                return line[self.column - 1 : self.column - 1 + column] if column > 1 else ""
        return ""

    def replaced(self, old: str, new: str) -> Correction | None:
        """Return the line with `new` in place of `old`; None if `old` is not at this place.

        In the file, `old` may be in quotes. The result is None if `old` or `new` is empty.
        """
        line = self.lines[self.line - 1] if 0 < self.line <= len(self.lines) else ""
        before, after = line[: self.column - 1], line[self.column - 1 :]
        for written in (old, f'"{old}"', f"'{old}'") if old and new else ():
            if after.startswith(written):
                return Correction(before + new + after.removeprefix(written), self.line)
        return None

    @property
    def excerpt(self) -> str:
        """The line, with a caret below the column; empty if the text is unknown."""
        if not 0 < self.line <= len(self.lines):
            return ""
        shown = excerpt(self.lines[self.line - 1], self.column)[1:]
        return f"{shown} {_cut(self.location)}".rstrip()


@dataclass(frozen=True, slots=True)
class Mistake:
    """A mistake in a file.

    Attributes:
        place: Place of the mistake.
        message: What is wrong, and what to do.
        instead: The corrected lines; None if unknown.
    """

    place: Place
    message: str
    instead: Correction | None = None

    def __str__(self) -> str:
        text = _cut(f"{self.place}: {self.message}")
        if excerpt := self.place.excerpt:
            text += f"\n{excerpt}"
        return f"{text}\n{self.instead}" if self.instead else text


def _cut(words: str) -> str:
    """Return a message in printable characters. A long message loses its middle."""
    whole = len(words) <= _BEGIN + _END
    return in_one_line(words if whole else f"{words[:_BEGIN]} … {words[-_END:]}")


class Mistakes:
    """Collects mistakes. Some methods close a place; `add` drops further mistakes at this place.

    A mapping and its first key begin at the same line and column. They are two places, because
    their locations in the document differ.

    Args:
        known: Earlier mistakes. Their places are closed.

    Attributes:
        found: The mistakes.
        notes: Warnings.
    """

    def __init__(self, known: Iterable[Mistake] = ()) -> None:
        self.found, self.notes = list(known), list[Mistake]()
        self._reported = {_where(mistake.place) for mistake in self.found}

    def add(self, place: Place, message: str, instead: Correction | None = None) -> None:
        """Add a mistake, unless its place is closed."""
        if _where(place) not in self._reported:
            self.found.append(Mistake(place, message, instead))

    def add_last(self, place: Place, message: str, instead: Correction | None = None) -> None:
        """Add a mistake, unless its place is closed. Close its place."""
        self.add(place, message, instead)
        self._reported.add(_where(place))

    def extend(self, place: Place, words: str) -> bool:
        """Append words to a mistake without a correction at a place. Return True if it exists."""
        for row, each in enumerate(self.found):
            if _where(each.place) == _where(place) and each.instead is None:
                self.found[row] = replace(each, message=f"{each.message}; {words}")
                return True
        return False

    def withdraw(self, place: Place) -> None:
        """Drop all mistakes at a place, and open the place for a better mistake."""
        self.found = [each for each in self.found if _where(each.place) != _where(place)]
        self._reported.discard(_where(place))

    def take(self, mistakes: Iterable[Mistake]) -> None:
        """Add mistakes, except at closed places. Close their places."""
        taken = list(mistakes)
        self.found += [m for m in taken if _where(m.place) not in self._reported]
        self._reported |= {_where(mistake.place) for mistake in taken}


def _where(place: Place) -> tuple[Place, str]:
    return place, place.location


class TreeError(ArmtreeError):
    """A folder or file of tasks cannot be read. Root of the errors of task files."""

    code = "file.error"
    exit_status = 3
    http_status = 422
    hint = "correct the file at the line in the message"


class FileError(TreeError):
    """A task file is wrong. The message lists up to 20 mistakes with their lines.

    Attributes:
        mistakes: All mistakes, without duplicates, ordered by file and line.
    """

    code = "file.task"
    hint = "correct the file, then run `armtree check`"

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(sorted(_combined(set(mistakes)), key=_order))
        lines = [str(mistake) for mistake in self.mistakes[:_SHOWN]]
        if len(self.mistakes) > _SHOWN:
            lines.append(f"and {len(self.mistakes) - _SHOWN} more mistakes")
        super().__init__("\n".join(lines))

    @classmethod
    def at(cls, path: Path, message: str) -> Self:
        """Return an error about a whole file or folder."""
        return cls([Mistake(Place(path), message)])


class PoseUnknown(FileError):
    """No pose of the user has that name."""

    code = "file.no_pose"
    http_status = 404
    hint = "`armtree pose ls` lists the poses"


def _combined(mistakes: Collection[Mistake]) -> list[Mistake]:
    """Merge mistakes that correct the same lines.

    All corrections of one line become one line with all changes. If two mistakes can only be
    corrected together, the later one is merged into the earlier one. A mistake of the layout comes
    before those of nodes, and a mistake of a node before those of its contents.
    """
    rows, combined = dict[tuple[Path, int, str], list[Mistake]](), list[Mistake]()
    for mistake in mistakes:
        if mistake.instead and mistake.instead.count == 1:
            line = mistake.instead.line
            key = (mistake.place.path, line, mistake.place.lines[line - 1])
            rows.setdefault(key, []).append(mistake)
    rights = dict[Mistake, Correction]()
    for (_, line, before), found in rows.items():
        text = _with_all(before, [m.instead.text for m in found if m.instead])
        rights |= {m: Correction(text, line) for m in found if text}
    corrected = _folded(replace(each, instead=rights.get(each, each.instead)) for each in mistakes)
    for mistake in sorted(corrected, key=lambda each: (each.place.location != "", *_order(each))):
        first = next((other for other in combined if _comes_first(other, mistake)), None)
        if first:
            words = f"{first.message}; {mistake.message}"
            combined[combined.index(first)] = Mistake(first.place, words, mistake.instead)
        else:
            combined.append(mistake)
    return combined


_VALUES = re.compile(r"; did you mean .*|'[^']*'|(?<![\w.])-?[\d.]+(?![\w.])")


def _folded(mistakes: Iterable[Mistake]) -> Iterator[Mistake]:
    """Merge mistakes of one list or mapping if their messages differ only in a value.

    They must be in one line, or have corrections of adjacent lines.
    """
    alike = dict[tuple[Path, str, str, int], list[Mistake]]()
    for each in sorted(mistakes, key=_order):
        place, line = each.place, 0 if each.instead else each.place.line
        parent = re.sub(r"(\.[^.\[]*|\[\d+\])$", "", place.location) or str(place)
        key = (place.path, parent, _VALUES.sub("", each.message), line)
        alike.setdefault(key, []).append(each)
    for first, *more in alike.values():
        rights = [each.instead for each in (first, *more) if each.instead]
        texts = {right.line: right.text for right in rights}
        adjacent = [*texts] == [*range(min(texts, default=0), max(texts, default=-1) + 1)]
        if more and adjacent and all(right.count == 1 for right in rights):
            text = "\n".join(texts.values())
            right = Correction(text, min(texts), len(texts)) if texts else None
            yield replace(first, instead=right)
        else:
            yield from (first, *more)


def _comes_first(first: Mistake, then: Mistake) -> bool:
    """Return True if the mistake `then` can only be corrected together with `first`."""
    old, new = first.instead, then.instead
    if not old or not new or first.place.path != then.place.path or not old.count:
        return False
    if not new.line <= old.line <= old.line + old.count <= new.line + new.count:
        return False
    place = first.place
    if place.lines != then.place.lines:
        return not place.location  # the layout
    inside = re.sub(r"^(\[\d+\])?\.", "", then.place.location.removeprefix(place.location))
    first_key = place.lines[place.line - 1][place.column - 1 :].lstrip("[{- ")
    return bool(inside and first_key.startswith(f"{inside}:") and new.count == 1)


def _with_all(before: str, after: Sequence[str]) -> str:
    """Return a line with several changes; empty if two changes overlap.

    A change that adds lines also overlaps with an insertion at its end, because the added lines may
    contain the inserted text.
    """
    text, end, last = before, len(before), -1
    for begin, stop, new in sorted((_change(before, each) for each in after), reverse=True):
        if stop > end or ("\n" in new and begin < stop == end == last):
            return ""
        text, end, last = text[:begin] + new + text[stop:], begin, stop
    return text


def _change(before: str, after: str) -> tuple[int, int, str]:
    """Return start and end of the part of `before` that `after` replaces, and the new text."""
    begin = _common(before, after)
    end = _common(before[begin:][::-1], after[begin:][::-1])
    return begin, len(before) - end, after[begin : len(after) - end]


def _common(one: str, other: str) -> int:
    """Return the number of equal characters at the start of both texts."""
    pairs = enumerate(zip(one, other, strict=False))
    return next((n for n, (a, b) in pairs if a != b), min(len(one), len(other)))


def _order(mistake: Mistake) -> tuple[str, int, int, str, str]:
    place = mistake.place
    return str(place.path), place.line, place.column, place.location, mistake.message


class DuplicateTask(FileError):
    """Two files have the same task number.

    Args:
        number: The number.
        first: The first file.
        second: Place of the number in the second file.
        free: A number that no task has.
        replaces: Name of the first task if the second task may replace it; else empty.
    """

    code = "file.duplicate_task"
    hint = "give one of the two tasks another number, in its file name and at its key task"

    def __init__(self, number: int, first: Path, second: Place, free: int, replaces: str) -> None:
        what = f"task {number} is in two files, {first} and {second.path}"
        this = f"add the line replaces: {replaces}, or " if replaces else ""
        which = f"{'this task' if replaces else 'one of them'} another number, such as {free}"
        advice = f"{this}give {which}, in its file name and at its key task"
        super().__init__([Mistake(second, f"{what}: {advice}")])


class BadArguments(FileError):
    """The arguments of a task are wrong; its file is valid.

    Attributes:
        argument: Name of the first wrong argument; empty if unknown or longer than 100 characters.
    """

    code = "goal.bad_arguments"
    exit_status = 4
    http_status = 409  # well-formed, but not what the task accepts now
    hint = "`armtree tasks` shows the parameters of each task"

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        super().__init__(map(_without_line, mistakes))
        name = self.mistakes[0].place.argument
        self.argument = name if len(name) <= 100 else ""  # a client may send any name


def _without_line(mistake: Mistake) -> Mistake:
    """Remove line, column and correction from a mistake in an argument of one line."""
    place = mistake.place
    if len(place.lines) > 1:
        return mistake
    return replace(mistake, place=Place(place.path, location=place.location), instead=None)


class UnknownTask(TreeError):
    """No task has that number or name.

    Attributes:
        task: Number or name.
        known: The numbers or names of all tasks.
        robot: Name of the robot of these tasks.
        instead: Message about the likely meaning, such as a pose; empty for the usual message.
    """

    code = "goal.unknown_task"
    exit_status = 4
    http_status = 404
    hint = "`armtree tasks` lists the tasks; --trees FOLDER adds the tasks of a folder"

    def __init__(
        self,
        task: int | str,
        known: Iterable[int | str],
        robot: str = SHIPPED_ROBOT,
        instead: str = "",
    ) -> None:
        self.task, self.known, self.robot, self.instead = task, tuple(known), robot, instead
        if isinstance(task, str):
            words = f"Invalid task name {task}; {there_are(task, map(str, self.known))}"
        else:
            there = there_are_numbers(task, (each for each in self.known if isinstance(each, int)))
            words = f"Invalid task number {task}; {there}"
        if instead:
            words = instead
        elif not self.known:
            words += f". No task is for the robot {robot}; `armtree new` writes one, and "
            words += "`armtree move` moves the robot without a task"
        elif any(str(task) in path.stem.split("_", 1) for path in EXAMPLES.glob("*.yaml")):
            words += f". {task} is an example: add --trees {EXAMPLES} (in Python, trees=)"
        elif isinstance(task, str) and not words.endswith("?"):
            words += ". If it is in another folder, give this folder: --trees (in Python, trees=)"
        super().__init__(words)
