"""Repairs: small edits that correct the layout of a task file.

A YAML parser fails after the mistake, with technical words. Therefore this module corrects common
mistakes near that place, one by one. The edits that leave the fewest mistakes become the
correction.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from pathlib import Path
from typing import TypeVar

from hardware.loading.dataclass import dataclass
from trees.errors import Correction, FileError, Mistake, Place

from .document import NotYaml, split_lines
from .slips import Edit, Spot, content_of, edits_near, line_before

_MAX_EDITS = 4
_KEPT = 10  # number of best texts that are edited further
# Largest number of characters that a search reads, in about 0.25 s. Each text and each of its
# mistakes count as more characters, because they also cost a fixed time.
_MAX_READ, _PER_TEXT, _PER_MISTAKE = 125_000, 1_000, 300
_MAX_TEXT = 25_000  # largest text for a search [characters]
_MAX_LEFT = 2  # largest number of mistakes in the edited lines of a repaired text

Drafted = TypeVar("Drafted")
Draft = Callable[[Path, str], tuple[Drafted, list[Mistake]]]


@dataclass(frozen=True, slots=True)
class _Version:
    """A text after some edits.

    Attributes:
        lines: Its lines.
        edits: The edits.
        rank: Rank; a lower rank is better.
        spots: Places of its mistakes.
        left: Number of its mistakes; None if it is not YAML.
        near: Number of its mistakes in the edited lines.
    """

    lines: tuple[str, ...]
    edits: tuple[Edit, ...]
    rank: tuple[int, int, int]
    spots: Sequence[Spot]
    left: int | None = None
    near: int = 0


def repairing(draft: Draft[Drafted]) -> Draft[Drafted]:
    """Return a function that reads files like `draft`, and also corrects their layout.

    Edits are used if they make a file valid, or make YAML of a file that is not YAML. Each kind of
    edit is then a mistake of the file, and the function reads the edited text.

    Args:
        draft: Function that reads a text and continues after mistakes.
    """

    @wraps(draft)
    def read(path: Path, text: str) -> tuple[Drafted, list[Mistake]]:
        broken, before = None, set[tuple[int, str]]()
        try:
            drafted, mistakes = draft(path, text)
            if all(mistake.instead for mistake in mistakes):
                return drafted, mistakes
            before = {(mistake.place.line, mistake.message) for mistake in mistakes}
        except NotYaml as error:
            broken = error
        found = _Search(draft, path, text).repaired()
        if found:
            repaired, left = draft(path, "\n".join(found.lines))
            still = {(mistake.place.line, mistake.message) for mistake in left}
            quoted = any(edit.kind in ("sign", "end") for edit in found.edits)
            if broken or not still or (before >= still and not quoted):
                return repaired, [*_mistakes(path, text, found.edits), *left]
        if broken:
            raise broken
        return drafted, mistakes

    return read


def _mistakes(path: Path, text: str, edits: Sequence[Edit]) -> list[Mistake]:
    """Return one mistake for each kind of slip, at its first place."""
    lines = split_lines(text)
    first, changed, before = dict[str, Edit](), dict[str, set[int]](), tuple(lines)
    moved = dict[str, set[int]]()
    for edit in edits:
        rows = {
            n for n, pair in enumerate(zip(before, edit.lines, strict=True)) if pair[0] != pair[1]
        }
        moved.setdefault(edit.kind, set()).update(rows)
        if edit.kind == "indent":  # the edit also moves other lines
            rows = {edit.spot[0]}
        if edit.kind == "dash":
            rows = {n for n in rows if edits[-1].lines[n].lstrip().startswith("- ")}
        if not any(edit.spot[0] in known for known in changed.values()):
            first.setdefault(edit.kind, edit)
        changed.setdefault(edit.kind, set()).update(rows)
        before = edit.lines
    found = []
    for edit in first.values():
        row, column = edit.spot
        same = sorted(n + 1 for n in changed[edit.kind] if n != row)
        also = f"; the same mistake is in line {', '.join(map(str, same))}" if same else ""
        place = Place(path, row + 1, column + 1, "", lines)
        rows = {row, *(n - 1 for n in same), *moved.get(edit.kind, ())}
        begin, end = min(rows), max(rows) + 1
        right = Correction("\n".join(edits[-1].lines[begin:end]), begin + 1, end - begin)
        found.append(Mistake(place, edit.why + also, right))
    return found


class _Search:
    """Searches for the edits that leave the fewest mistakes, breadth first."""

    def __init__(self, draft: Draft[Drafted], path: Path, text: str) -> None:
        self._draft, self._path = draft, path
        self._lines = tuple(split_lines(text.removeprefix("\ufeff")))
        self._read = 0

    def repaired(self) -> _Version | None:
        """Return the best text; None if no edits improve the text."""
        if sum(map(len, self._lines)) > _MAX_TEXT:
            return None
        start = self._version(self._lines, ())
        seen, best, now = {self._lines}, list[_Version](), [start]
        for _ in range(_MAX_EDITS):
            versions = []
            for version in now:
                for edit in edits_near(version.lines, version.spots, version.left is not None):
                    if edit.lines in seen or self._read > _MAX_READ:
                        continue
                    seen.add(edit.lines)
                    made = self._version(edit.lines, (*version.edits, edit))
                    if made.rank < version.rank:
                        versions.append(made)
            now = sorted(versions, key=lambda version: version.rank)[:_KEPT]
            best += [version for version in now if version.left is not None]
            if any(version.left == 0 for version in now):
                break
        found = min(best, key=lambda version: version.rank, default=None)
        return found if found and found.near <= _MAX_LEFT else None

    def _version(self, lines: tuple[str, ...], edits: tuple[Edit, ...]) -> _Version:
        text = "\n".join(lines)
        self._read += len(text) + _PER_TEXT
        try:
            _, mistakes = self._draft(self._path, text)
        except NotYaml as error:
            opened = [_spot(error.opened, lines)] if error.opened else []
            rank = (1, -error.place.line, -error.place.column)
            spots = [*_spots(error.mistakes, lines), *opened]
            return _Version(lines, edits, rank, spots)
        except FileError as error:
            mistakes = [*error.mistakes]
        self._read += _PER_MISTAKE * len(mistakes)
        rank, spots = (0, len(mistakes), len(edits)), _spots(mistakes, lines)
        edited = {edit.spot[0] + 1 for edit in edits}
        near = sum(mistake.place.line in edited for mistake in mistakes)
        return _Version(lines, edits, rank, spots, len(mistakes), near)


def _spots(mistakes: Iterable[Mistake], lines: Sequence[str]) -> list[Spot]:
    """Return the places of mistakes, without duplicates: the first four."""
    return [*dict.fromkeys(_spot(mistake.place, lines) for mistake in mistakes)][:4]


def _spot(place: Place, lines: Sequence[str]) -> Spot:
    """Return the spot of a place; in a line without content, the end of the content before it."""
    row = min(place.line, len(lines)) - 1
    if row == place.line - 1 and content_of(lines[row]):
        return row, min(place.column - 1, len(lines[row]))
    row = line_before(row, lines)
    return row, len(lines[row])
