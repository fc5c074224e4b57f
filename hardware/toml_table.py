"""A strict reader of TOML files. Every error names the line, the key and the valid choices.

Slips (small errors of the syntax) are reported together, each with the corrected line.
"""

import math
import re
import reprlib
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from .errors import DescriptionError
from .files import read_file
from .printable import excerpt
from .spelling import closest, did_you_mean, suggested, suggestion, there_are

_HEADER = re.compile(r"\s*\[([\w.\-]+)\]\s*(?:#.*)?$")
_MAX_BYTES = 256 * 1024
# A word, or a number, which may be in quotes and have zeros as decimals.
_WRITTEN = r"(?<![\w-])(?<!\d\.)([\"']?){}(?:\.0+)?\1(?![\w.-])"
_KEY = re.compile(r"\s*([\w.\-]+)\s*=")

_KINDS = {
    str: "a text",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    list: "a list",
    dict: "a table",
}


class TomlTable:
    """One table of a TOML file.

    Each method reads a key and checks its value. `done` rejects all keys that no method has read.

    Raises:
        DescriptionError: A key or value is wrong. The message names file, line and key. Every
            method may raise it.
    """

    def __init__(
        self,
        path: Path,
        text: Sequence[tuple[str, str]],
        lines: dict[str, int],
        name: str,
        values: dict[str, Any],
    ):
        self._path, self._text, self._lines = path, text, lines
        self._name, self._values = name, values
        self._known: set[str] = set()  # keys that a method has read
        # Mistakes that `later` keeps, and slips, of all tables.
        self.mistakes: list[DescriptionError] = []
        self._slips: list[DescriptionError] = []

    @classmethod
    def read(cls, path: Path, patient: bool = False) -> "TomlTable":
        """Return the root table of a file.

        Args:
            path: The file.
            patient: True to correct slips, and to raise them in `raise_mistakes` together with the
                wrong values. False to raise them now.
        """
        try:
            text = read_file(path, _MAX_BYTES).decode("utf-8")
            values, corrected, slips = _parsed(path, text)
        except OSError as error:
            raise DescriptionError(path, 0, f"cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise DescriptionError(path, 0, f"is not UTF-8 text: {error.reason}") from error
        except RecursionError as error:
            raise DescriptionError(path, 0, "its lists or tables are nested too deep") from error
        table = cls(
            path,
            [*zip(text.split("\n"), corrected.split("\n"), strict=True)],
            _key_lines(corrected),
            "",
            values,
        )
        table._slips = slips
        if not patient:
            table.raise_mistakes()
        return table

    def fail(self, key: str, message: str, old: str = "", new: str = "") -> NoReturn:
        """Reject the value of a key.

        Args:
            key: The key.
            message: The mistake.
            old: Wrong text in the file. Default: the key.
            new: Text that should replace `old`. Default: the name that the message suggests.
        """
        line, shown = self.line(key), ""
        end = min((n for n in self._lines.values() if n > line), default=len(self._text) + 1)
        near = suggested(message)
        for row, word in (*((row, old) for row in range(line, end) if old), (line, key)):
            before, after = self._text[row - 1] if row else ("", "")
            written = re.compile(_WRITTEN.format(re.escape(word)))
            if found := written.search(before):
                right = written.sub(lambda each: new or f"{each[1]}{near}{each[1]}", after, count=1)
                known = (new or near) and word == (old or key)
                line, shown = row, excerpt(before, found.start() + 1, right if known else "")
                break
        else:
            shown = excerpt(self._text[line - 1][0], 1) if line else ""
        raise DescriptionError(self._path, line, f"{self._full(key)}: {message}{shown}")

    @contextmanager
    def later(self) -> Iterator[None]:
        """Skip the rest of the block after a mistake, and keep the mistake for `raise_mistakes`."""
        try:
            yield
        except DescriptionError as error:
            self.mistakes.append(error)

    def raise_mistakes(self) -> None:
        """Raise the slips, and the mistakes that `later` kept, as one error, if there are any."""
        lines = {mistake.line for mistake in self.mistakes}
        found = [*(slip for slip in self._slips if slip.line not in lines), *self.mistakes]
        if found:
            raise _joined(self._path, sorted(found, key=lambda mistake: mistake.line))

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text, or the default if the key is absent."""
        return str(self._value(key, str, default))

    def number(
        self,
        key: str,
        above: float = -math.inf,
        least: float = -math.inf,
        most: float = math.inf,
        default: float | None = None,
    ) -> float:
        """Return a finite number above `above`, of at least `least` and at most `most`.

        If the key is absent, returns the default without these checks.
        """
        if default is not None and key not in self:
            return default
        try:
            value = float(self._value(key, float))
        except OverflowError:
            value = math.inf
        if not (math.isfinite(value) and value > above and least <= value <= most):
            bounds = [f"greater than {above:g}"] if math.isfinite(above) else []
            bounds += [f"at least {least:g}"] if math.isfinite(least) else []
            bounds += [f"at most {most:g}"] if math.isfinite(most) else []
            wanted = " and ".join([*bounds, "finite"])
            self.fail(key, f"{value:g} is not allowed; it must be {wanted}")
        return value

    def vector(
        self, key: str, default: tuple[float, float, float] | None = None
    ) -> tuple[float, float, float]:
        """Return three finite numbers, or the default if the key is absent."""
        if isinstance(text := self._values.get(key), str):  # such as 0 1 0, as in a URDF
            parts = text.replace(",", " ").split()
            whole = len(parts) == 3 and all(re.fullmatch(r"[-+]?[\d.]+", each) for each in parts)
            new = f"[{', '.join(parts)}]" if whole else ""
            why = f"{text!r} is not three finite numbers" + (f"; write {new}" if new else "")
            self.fail(key, why, text, new)
        values = self._value(key, list, None if default is None else list(default))
        most = sys.float_info.max
        numbers = [v for v in values if type(v) in (int, float) and -most <= v <= most]
        if len(values) != 3 or numbers != values:
            self.fail(key, f"{reprlib.repr(values)} is not three finite numbers")
        x, y, z = map(float, values)
        return x, y, z

    def integer(self, key: str, choices: Sequence[int]) -> int:
        """Return a whole number from the choices: a range, or a few numbers."""
        value = int(self._value(key, int))
        if isinstance(choices, range) and value not in choices:
            shown = reprlib.repr(value)
            self.fail(key, f"{shown} is not from {choices[0]} to {choices[-1]}")
        if value not in choices:
            self.fail(key, f"{value} is not one of {', '.join(map(str, choices))}")
        return value

    def boolean(self, key: str, default: bool | None = None) -> bool:
        """Return a boolean, or the default if the key is absent."""
        return bool(self._value(key, bool, default))

    def choice(self, key: str, choices: Iterable[str], default: str | None = None) -> str:
        """Return a text from the choices, or the default if the key is absent."""
        value, names = self.text(key, default), list(choices)
        if value not in names:
            why = f"{value!r} is not one of {', '.join(names)}{suggestion(value, names)}"
            self.fail(key, why, value)
        return value

    def names(
        self, key: str, choices: Iterable[str], default: list[str] | None = None
    ) -> tuple[str, ...]:
        """Return distinct texts from the choices, or the default if the key is absent."""
        values = self._value(key, list, default)
        return self._checked_names(key, values, list(choices))

    def pairs(self, key: str, choices: Iterable[str]) -> frozenset[frozenset[str]]:
        """Return a list of pairs of distinct texts from the choices."""
        names, values = list(choices), self._value(key, list)
        for pair in values:
            if not isinstance(pair, list) or len(pair) != 2:
                self.fail(key, f"{pair!r} is not a pair of names")
        return frozenset(frozenset(self._checked_names(key, pair, names)) for pair in values)

    def table(self, key: str) -> "TomlTable":
        """Return the table that is the value of a key."""
        values = self._value(key, dict)
        table = TomlTable(self._path, self._text, self._lines, self._full(key), values)
        table.mistakes = self.mistakes
        return table

    def is_table(self, key: str) -> bool:
        """Return True if the value of a key is a table."""
        return isinstance(self._values.get(key), dict)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __contains__(self, key: str) -> bool:
        self._known.add(key)  # `done` then accepts the optional key
        return key in self._values

    def done(self) -> None:
        """Reject all keys that no method has read."""
        unknown = [key for key in self._values if key not in self._known]
        for key in unknown[:-1]:
            with self.later():
                self._unknown(key)
        for key in unknown[-1:]:
            self._unknown(key)

    def _unknown(self, key: str) -> NoReturn:
        there = there_are(key, self._known)
        self.fail(key, f"unknown key; {there}{'' if suggested(there) else '; leave it out'}")

    def _checked_names(self, key: str, values: list[Any], choices: list[str]) -> tuple[str, ...]:
        for value in values:
            if value not in choices:
                near = suggestion(str(value), choices)
                self.fail(key, f"{value!r} is not one of {', '.join(choices)}{near}", str(value))
        if len(set(values)) != len(values):
            self.fail(key, f"{values!r} contains a name twice")
        return tuple(values)

    def _value(self, key: str, kind: type, default: Any = None) -> Any:
        self._known.add(key)
        value = self._values.get(key, default)
        if value is None:
            self._miss(key, kind)
        right = isinstance(value, (int, float) if kind is float else kind)
        if not right or (isinstance(value, bool) and kind is not bool):
            advice, new = _instead(value, kind, key)
            shown = str(value) if isinstance(value, str | int | float) else ""
            self.fail(key, f"{value!r} is not {_KINDS[kind]}{advice}", shown, new)
        return value

    def _miss(self, key: str, kind: type) -> NoReturn:
        """Reject a missing key. If an unknown key may be its misspelling, reject that key."""
        left = [given for given in self._values if given not in self._known]
        misspelt = closest(key, left) or next((each for each in left if closest(each, [key])), "")
        if misspelt:
            self._known.add(misspelt)  # `done` need not report it again
            self.fail(misspelt, "unknown key" + did_you_mean(key))
        self.fail(key, f"is missing; give {_KINDS[kind]}")

    def _full(self, key: str) -> str:
        return f"{self._name}.{key}" if self._name else key

    def line(self, key: str) -> int:
        """Return the line number of a key, or else of the table that has it; 0 if unknown."""
        full = self._full(key)
        while full not in self._lines and "." in full:
            full = full.rpartition(".")[0]
        return self._lines.get(full, 0)


# Slips: pattern, replacement, message. In a pattern, \0 is the place where the reader fails.
_SLIPS = (
    (r"\s*\0\s*:\s*", " = ", "`=` separates a key from its value, not a colon"),
    (r"\0True\b", "true", "true has no capital letter"),
    (r"\0False\b", "false", "false has no capital letter"),
    (r"(\d)\0,(?=\d)", r"\1.", "a point begins the decimals, not a comma"),
    (r"(\d)\0\.(?!\d)", r"\1.0", "a digit follows the point"),
    (r"\0\.(?=\d)", "0.", "a digit precedes the point"),
    (r"\s*\0;", "", "a line does not end with `;`"),
    (r",\s*\0(?=})", " ", "a comma may not precede the }"),
    (r"([-+]?[\d.]+)\s*\0([A-Za-z%°][\w/²^*]*)", r'"\1 \2"', "a number has no unit"),
    (r"\0([^\s\"'\[\]{},#=][^\"'\[\]{},#=]*?)(?=\s*(?:[\]},#]|$))", r'"\1"',
     "a text needs quotes"),
    (r"([\"'])([^\"']*)\0$", r"\1\2\1", "the quote is not closed"),
    (r"^(\s*\[[\w.-]+)\0", r"\1]", "the [ is not closed"),
    (r"(?<=[\"'\]}\w])\0(?=\s*(?:#|$))", ",", "a comma is missing"),
    (r"(?<=[\"'\]}\w,])\0(?=\s*(?:#|$))", "]", "the [ is not closed"),
    (r"(?<=[\"'\]}\w])\0(?=\s*(?:#|$))", " }", "the { is not closed"),
    (r"\s+\0(?=[\"'\[{\w])", ", ", "a comma is missing"),
    (r"\s+\0([A-Za-z/][^\"'\[\]{},#=]*?)(?=\s*(?:[\]},#]|$))", r' = "\1"',
     "a `=` is missing after the key, and a text needs quotes"),
    (r"\s+\0", " = ", "a `=` is missing after the key"),
)  # fmt: skip
_MOST_SLIPS, _MOST_TEXT = 10, 10_000  # bounds of the time of a search [slips, characters]
# Messages that replace those of tomllib, by the start of its message.
_WHY = {
    "Cannot overwrite a value": "this key is given twice; leave one of them out",
    "Cannot declare": "this table is given twice; write all its keys below one of them",
    "Invalid value": "this is not a value; a text needs quotes",
    "Invalid initial character for a key part": "a key is missing here",
    "Expected newline": "the value ends before this place; a text needs quotes",
    "Expected '='": "a key is followed by a `=` and a value",
    "Unclosed array": "the [ is not closed",
    "Unclosed inline table": "the { is not closed",
    "Illegal character '\\n'": "the quote is not closed",
}
_END = (2**31, 0)  # line and column after the end of a valid text
# Factors of units for rad, m and s.
_UNITS = {"deg": math.pi / 180, "°": math.pi / 180, "mm": 1e-3, "cm": 1e-2, "ms": 1e-3}


def _parsed(path: Path, text: str) -> tuple[dict[str, Any], str, list[DescriptionError]]:
    """Return the values of a text, the text without slips, and the slips.

    Raises:
        DescriptionError: A slip cannot be corrected.
    """
    given, slips = text.split("\n"), dict[int, tuple[int, list[str]]]()
    while True:
        try:
            return tomllib.loads(text), text, _shown(path, given, text.split("\n"), slips)
        except ValueError as error:  # also a number with thousands of digits
            place, why = _place(error)
        lines = text.split("\n")
        row, at = _spot(lines, *place)
        right = _corrected(lines, row, at) if len(text) < _MOST_TEXT else None
        first, whys = slips.setdefault(row, (at, []))
        if right is None or len(slips) > _MOST_SLIPS:
            slips[row] = first, [*whys, why]
            raise _joined(path, _shown(path, given, lines, slips))
        whys.append(right[1])
        text = right[0]


def _spot(lines: Sequence[str], line: int, column: int) -> tuple[int, int]:
    """Return row and column of a place; at white space, of the end of the text before."""
    row, at = min(line, len(lines)) - 1, column - 1
    at = at if line <= len(lines) else len(lines[row])
    while row > 0 and not lines[row][:at].partition("#")[0].strip():
        row -= 1
        at = len(lines[row].partition("#")[0].rstrip())
    return row, at


def _corrected(lines: Sequence[str], row: int, at: int) -> tuple[str, str] | None:
    """Return the text without the slip at a place, and a message; None if no slip fits."""
    marked, best, found = f"{lines[row][:at]}\0{lines[row][at:]}", (row + 1, at + 1), None
    for pattern, instead, why in _SLIPS:
        line = re.sub(pattern, instead, marked, count=1)
        text = "\n".join([*lines[:row], line, *lines[row + 1 :]])
        end = _end(text) if "\0" not in line else (0, 0)
        if end[0] == row + 1:  # the slip moves the rest of its line
            end = row + 1, end[1] - max(0, len(line) - len(lines[row]))
        if end > best:
            best, found = end, (text, why)
    return found


def _end(text: str) -> tuple[int, int]:
    """Return the line and column where the reader fails; `_END` if it does not."""
    try:
        tomllib.loads(text)
    except ValueError as error:
        return _place(error)[0]
    return _END


def _shown(
    path: Path,
    before: Sequence[str],
    after: Sequence[str],
    slips: Mapping[int, tuple[int, Sequence[str]]],
) -> list[DescriptionError]:
    """Return one error for each row with slips. Each error has the line and the corrected line."""
    errors = []
    for row, (at, whys) in sorted(slips.items()):
        right = after[row] if after[row] != before[row] else ""
        words = f"{'; '.join(dict.fromkeys(whys))}{excerpt(before[row], at + 1, right)}"
        errors.append(DescriptionError(path, row + 1, words))
    return errors


def _joined(path: Path, mistakes: Sequence[DescriptionError]) -> DescriptionError:
    if len(mistakes) == 1:
        return mistakes[0]
    words = "\n".join(map(str, mistakes))
    return DescriptionError(path, 0, f"{len(mistakes)} mistakes\n{words}")


def _place(error: ValueError) -> tuple[tuple[int, int], str]:
    """Return the line and column where the reader failed, and a message."""
    found = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", f"{error}")
    if not found:
        return (0, 0), f"{error}"
    words = next((why for begin, why in _WHY.items() if found[1].startswith(begin)), found[1])
    return ((int(found[2]), int(found[3])) if found[2] else _END), words


def _instead(value: Any, kind: type, key: str) -> tuple[str, str]:
    """Return advice for a value of the wrong kind, and the right text. Each may be empty."""
    new = ""
    if kind is list and isinstance(value, str):
        names = ", ".join(f'"{name}"' for name in re.split(r"[,\s]+", value) if name)
        new = f"[{names}]"
    elif kind in (int, float) and isinstance(value, str):
        found = re.fullmatch(r"([-+]?[\d.]+) ?(\D*?)(/s[2²]?)?", value)
        if not found:
            return "; write a number without quotes and unit", ""
        factor = 1.0 if key.endswith(f"_{found[2]}") else _UNITS.get(found[2], 1.0)
        new = found[1] if factor == 1.0 else f"{float(found[1]) * factor:.6g}"
    elif kind is bool and str(value) in ("true", "false"):
        new = value
    elif kind is str and isinstance(value, int | float):
        new = f'"{value}"'
    return (f"; write {new}" if new else ""), new


def _key_lines(text: str) -> dict[str, int]:
    """Return the line numbers of all table headers and keys, by full name."""
    lines: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.split("\n"), start=1):
        if header := _HEADER.match(line):
            table = header[1]
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault(f"{table}.{key[1]}" if table else key[1], number)
    return lines
