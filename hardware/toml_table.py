"""A strict reader of TOML files. Every error names its line, its key and the valid choices."""

import math
import re
import reprlib
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from .errors import DescriptionError
from .files import read_file
from .spelling import closest, did_you_mean, suggestion, there_are

_HEADER = re.compile(r"\s*\[([\w.\-]+)\]\s*(?:#.*)?$")
_MAX_BYTES = 256 * 1024
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

    def __init__(self, path: Path, lines: dict[str, int], name: str, values: dict[str, Any]):
        self._path, self._lines, self._name, self._values = path, lines, name, values
        self._known: set[str] = set()  # keys that a method has read
        self.mistakes: list[DescriptionError] = []  # those that `later` keeps, of all tables

    @classmethod
    def read(cls, path: Path) -> "TomlTable":
        """Return the root table of a file."""
        try:
            text = read_file(path, _MAX_BYTES).decode("utf-8")
            values = tomllib.loads(text)
        except OSError as error:
            raise DescriptionError(path, 0, f"cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise DescriptionError(path, 0, f"is not UTF-8 text: {error.reason}") from error
        except RecursionError as error:
            raise DescriptionError(path, 0, "its lists or tables are nested too deep") from error
        except ValueError as error:  # also a number with thousands of digits
            found = re.fullmatch(
                r"(.*) \(at (?:line (\d+), column \d+|end of document)\)", str(error)
            )
            why, line = (found[1], int(found[2] or 0)) if found else (str(error), 0)
            raise DescriptionError(path, line, why + _repaired(text, line)) from error
        return cls(path, _key_lines(text), "", values)

    def fail(self, key: str, message: str) -> NoReturn:
        """Reject the value of a key."""
        raise DescriptionError(self._path, self.line(key), f"{self._full(key)}: {message}")

    @contextmanager
    def later(self) -> Iterator[None]:
        """Keep a mistake until `raise_mistakes`, and skip the rest of the block."""
        try:
            yield
        except DescriptionError as error:
            self.mistakes.append(error)

    def raise_mistakes(self) -> None:
        """Raise the mistakes that `later` kept, as one error."""
        if len(self.mistakes) > 1:
            words = "\n".join(map(str, self.mistakes))
            raise DescriptionError(self._path, 0, f"{len(self.mistakes)} mistakes\n{words}")
        for mistake in self.mistakes:
            raise mistake

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
            self.fail(key, f"{value!r} is not one of {', '.join(names)}{suggestion(value, names)}")
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
        """Return a table within this one."""
        values = self._value(key, dict)
        table = TomlTable(self._path, self._lines, self._full(key), values)
        table.mistakes = self.mistakes
        return table

    def is_table(self, key: str) -> bool:
        """Return True if the value of a key is a table."""
        return isinstance(self._values.get(key), dict)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __contains__(self, key: str) -> bool:
        self._known.add(key)  # `done` knows the optional key
        return key in self._values

    def done(self) -> None:
        """Reject all keys that no method has read."""
        for key in self._values:
            if key not in self._known:
                self.fail(key, f"unknown key; {there_are(key, self._known)}")

    def _checked_names(self, key: str, values: list[Any], choices: list[str]) -> tuple[str, ...]:
        for value in values:
            if value not in choices:
                near = suggestion(str(value), choices)
                self.fail(key, f"{value!r} is not one of {', '.join(choices)}{near}")
        if len(set(values)) != len(values):
            self.fail(key, f"{values!r} contains a name twice")
        return tuple(values)

    def _value(self, key: str, kind: type, default: Any = None) -> Any:
        self._known.add(key)
        value = self._values.get(key, default)
        if value is None:
            self._miss(key)
        right = isinstance(value, (int, float) if kind is float else kind)
        if not right or (isinstance(value, bool) and kind is not bool):
            self.fail(key, f"{value!r} is not {_KINDS[kind]}{_instead(value, kind)}")
        return value

    def _miss(self, key: str) -> NoReturn:
        """Reject a missing key. The line is that of a misspelling, if there is one."""
        misspelt = closest(key, [given for given in self._values if given not in self._known])
        if misspelt:
            self._known.add(misspelt)  # `done` need not report it again
            self.fail(misspelt, "unknown key" + did_you_mean(key))
        self.fail(key, "is missing")

    def _full(self, key: str) -> str:
        return f"{self._name}.{key}" if self._name else key

    def line(self, key: str) -> int:
        """Return the line of a key, or of the nearest table around it; 0 if unknown."""
        full = self._full(key)
        while full not in self._lines and "." in full:
            full = full.rpartition(".")[0]
        return self._lines.get(full, 0)


# Slips of a line: pattern and replacement.
_SLIPS = (
    (r"^(\s*[\w.-]+)\s*:\s*", r"\1 = "),
    (r"\b(True|False)\b", lambda found: found[0].lower()),
    (r"(=\s*)([^\s#\"'\[{][^#]*?)(?=\s*(#.*)?$)", r'\1"\2"'),
)


def _repaired(text: str, line: int) -> str:
    """Return `; write LINE` if a small change of a line makes the file valid up to it."""
    lines = text.splitlines()[:line]
    for pattern, instead in _SLIPS if lines else ():
        last = re.sub(pattern, instead, lines[-1])
        with suppress(ValueError):
            tomllib.loads("\n".join([*lines[:-1], last]))
            return f"; write {last.partition(' #')[0].strip()}"
    return ""


def _instead(value: Any, kind: type) -> str:
    """Return what to write for a text of a wrong kind; empty for other values."""
    if kind is list and isinstance(value, str):
        names = ", ".join(f'"{name}"' for name in re.split(r"[,\s]+", value) if name)
        return f"; write [{names}]"
    if kind in (int, float) and isinstance(value, str):
        return "; write a number without quotes and unit"
    return "; write it without quotes" if str(value) in ("true", "false") else ""


def _key_lines(text: str) -> dict[str, int]:
    """Return the line numbers of all table headers and keys, by full name."""
    lines: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            table = header[1]
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault(f"{table}.{key[1]}" if table else key[1], number)
    return lines
