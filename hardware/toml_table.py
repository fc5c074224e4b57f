"""Reading a TOML file strictly: every mistake is told with its line and the valid choices."""

import math
import re
import reprlib
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NoReturn

from hardware.errors import DescriptionError
from hardware.suggestions import closest, suggestion

_HEADER = re.compile(r"\s*\[([\w.\-]+)\]\s*(?:#.*)?$")
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
    """One table of a TOML file. What it is asked for it checks; what nobody asked for is an error.

    Raises:
        DescriptionError: From every method, with file, line and key.
    """

    def __init__(self, path: Path, lines: dict[str, int], name: str, values: dict[str, Any]):
        self._path, self._lines, self._name, self._values = path, lines, name, values
        self._asked: set[str] = set()

    @classmethod
    def read(cls, path: Path) -> "TomlTable":
        """The root table of a file."""
        try:
            text = path.read_text(encoding="utf-8")
            values = tomllib.loads(text)
        except OSError as error:
            raise DescriptionError(path, 0, f"cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise DescriptionError(path, 0, f"is not UTF-8 text: {error.reason}") from error
        except ValueError as error:  # a number of thousands of digits is no TOMLDecodeError
            place = re.search(r"at line (\d+)", str(error))
            raise DescriptionError(path, int(place[1]) if place else 0, str(error)) from error
        return cls(path, _key_lines(text), "", values)

    def fail(self, key: str, message: str) -> NoReturn:
        """Refuse the value of a key."""
        raise DescriptionError(self._path, self._line(key), f"{self._full(key)}: {message}")

    def text(self, key: str, default: str | None = None) -> str:
        """A text; the default where the key is absent and a default is given."""
        return str(self._value(key, str, default))

    def number(self, key: str, above: float = -math.inf, least: float = -math.inf) -> float:
        """A finite number greater than `above` and not less than `least`."""
        try:
            value = float(self._value(key, float))
        except OverflowError:
            value = math.inf
        if not (math.isfinite(value) and value > above and value >= least):
            bounds = [f"greater than {above:g}"] if math.isfinite(above) else []
            bounds += [f"at least {least:g}"] if math.isfinite(least) else []
            wanted = " and ".join([*bounds, "finite"])
            self.fail(key, f"{value:g} is not allowed; it must be {wanted}")
        return value

    def vector(
        self, key: str, default: tuple[float, float, float] | None = None
    ) -> tuple[float, float, float]:
        """Three finite numbers; the default where one is given."""
        values = self._value(key, list, None if default is None else list(default))
        most = sys.float_info.max
        numbers = [v for v in values if type(v) in (int, float) and -most <= v <= most]
        if len(values) != 3 or numbers != values:
            self.fail(key, f"{reprlib.repr(values)} is not three finite numbers")
        x, y, z = map(float, values)
        return x, y, z

    def integer(self, key: str, choices: Iterable[int] | None = None, least: int = 1) -> int:
        """A whole number, out of the choices or not less than `least`."""
        value = int(self._value(key, int))
        if choices is not None and value not in choices:
            self.fail(key, f"{value} is not one of {', '.join(map(str, choices))}")
        if choices is None and value < least:
            self.fail(key, f"{value} is less than {least}")
        return value

    def boolean(self, key: str) -> bool:
        """True or false."""
        return bool(self._value(key, bool))

    def choice(self, key: str, choices: Iterable[str]) -> str:
        """A text out of the choices."""
        value, names = self.text(key), list(choices)
        if value not in names:
            self.fail(key, f"{value!r} is not one of {', '.join(names)}{suggestion(value, names)}")
        return value

    def names(
        self, key: str, choices: Iterable[str], default: list[str] | None = None
    ) -> tuple[str, ...]:
        """A list of distinct texts out of the choices; the default where one is given."""
        values = self._value(key, list, default)
        return self._checked_names(key, values, list(choices))

    def pairs(self, key: str, choices: Iterable[str]) -> frozenset[frozenset[str]]:
        """A list of pairs of distinct texts out of the choices."""
        names, values = list(choices), self._value(key, list)
        for pair in values:
            if not isinstance(pair, list) or len(pair) != 2:
                self.fail(key, f"{pair!r} is not a pair of names")
        return frozenset(frozenset(self._checked_names(key, pair, names)) for pair in values)

    def table(self, key: str) -> "TomlTable":
        """A table within this one."""
        values = self._value(key, dict)
        return TomlTable(self._path, self._lines, self._full(key), values)

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __contains__(self, key: str) -> bool:
        self._asked.add(key)  # it may stand there
        return key in self._values

    def done(self) -> None:
        """Refuse the keys that nobody asked for."""
        for key in self._values:
            if key not in self._asked:
                known = sorted(self._asked)
                near = suggestion(key, known)
                self.fail(key, f"unknown key; there are {', '.join(known)}{near}")

    def _checked_names(self, key: str, values: list[Any], choices: list[str]) -> tuple[str, ...]:
        for value in values:
            if value not in choices:
                near = suggestion(str(value), choices)
                self.fail(key, f"{value!r} is not one of {', '.join(choices)}{near}")
        if len(set(values)) != len(values):
            self.fail(key, f"{values!r} names something twice")
        return tuple(values)

    def _value(self, key: str, kind: type, default: Any = None) -> Any:
        self._asked.add(key)
        value = self._values.get(key, default)
        if value is None:
            self._miss(key)
        right = isinstance(value, (int, float) if kind is float else kind)
        if not right or (isinstance(value, bool) and kind is not bool):
            self.fail(key, f"{value!r} is not {_KINDS[kind]}")
        return value

    def _miss(self, key: str) -> NoReturn:
        """Refuse a missing key; at the line of its misspelling where there is one."""
        misspelt = closest(key, [given for given in self._values if given not in self._asked])
        if misspelt:
            self.fail(misspelt, f"unknown key; did you mean {key}?")
        self.fail(key, "is missing")

    def _full(self, key: str) -> str:
        return f"{self._name}.{key}" if self._name else key

    def _line(self, key: str) -> int:
        """The line of the key, or of the nearest table around it."""
        full = self._full(key)
        while full not in self._lines and "." in full:
            full = full.rpartition(".")[0]
        return self._lines.get(full, 0)


def _key_lines(text: str) -> dict[str, int]:
    """Line number of every table header and key, by full name."""
    lines: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            table = header[1]
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault(f"{table}.{key[1]}" if table else key[1], number)
    return lines
