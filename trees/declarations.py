"""Declarations of parameters, ports and options: types, units, bounds and choices."""

import math
from collections.abc import Mapping
from typing import Any

from hardware.loading.dataclass import dataclass

# Units by type. A number without a unit is in the first unit.
UNITS: Mapping[str, Mapping[str, float]] = {
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "duration": {"s": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0},
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001},
}
LIST = "list of "  # prefix of a list's type, before the type of its items
_PLAIN = ("number", "integer", "boolean", "text", *UNITS, "positions")
TYPES = (*_PLAIN, *(LIST + kind for kind in _PLAIN))
ANY = "any"

_WORDS = {
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
    "text": "a text",
    "positions": "a mapping from joint names to angles, or a pose",
    ANY: "a number, a text, or true or false",
}


@dataclass(frozen=True, slots=True)
class Declaration:
    """The declared type and limits of a parameter, a port or an option.

    Attributes:
        type: One of TYPES, ANY, or the name of a type that only skills can write.
        default: Value if the file gives none. If None, a value is required unless `optional` is
            set.
        optional: True if the value may be omitted although there is no default.
        least: Smallest value, in the first unit of the type.
        most: Largest value, in the first unit of the type.
        choices: Allowed values; empty if all are allowed.
        count: Number of items of a list; 0 for any number.
        relative: True if the value changes joint positions by distances. Poses are then wrong.
        output: True for a key that is written, False for a value that is read.
        description: Description, in one line.
    """

    type: str
    default: Any = None
    optional: bool = False
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    count: int = 0
    relative: bool = False
    output: bool = False
    description: str = ""

    @property
    def needed(self) -> bool:
        """True if a value is required."""
        return self.default is None and not self.optional

    @property
    def refuses_poses(self) -> bool:
        """True if the name of a pose is always a wrong value, such as for a number."""
        return self.relative or self.type.removeprefix(LIST) in ("number", "integer", *UNITS)

    @property
    def unit(self) -> str:
        """Unit of a number that is written without a unit; empty for types without units."""
        kind = self.type.removeprefix(LIST)
        return next(iter(UNITS.get("angle" if kind == "positions" else kind, {})), "")

    @property
    def limits(self) -> str:
        """Limits and choices as text with a comma before each; empty if there are none."""
        ends = ("at least", self.least), ("at most", self.most)
        given = [f"{word} {end:g} {self.unit}".rstrip() for word, end in ends if end is not None]
        given += [f"one of {', '.join(self.choices)}"] if self.choices else []
        return "".join(f", {each}" for each in given)

    def __str__(self) -> str:
        text = words(self.type)
        return text.removesuffix(", or a pose") if self.relative else text


def words(kind: str) -> str:
    """Describe a type in a few words, for messages."""
    if kind.startswith(LIST):
        return f"a list, each item {words(kind.removeprefix(LIST))}"
    if kind in UNITS:
        units = list(UNITS[kind])
        article = "an" if kind == "angle" else "a"
        return f"{article} {kind} in {', '.join(units[:-1])} or {units[-1]}"
    return _WORDS.get(kind) or f"a {kind}"


def type_fits(given: str, wanted: str) -> bool:
    """Return True if a value of one type is accepted for another type.

    A plain number is accepted for any quantity, and a quantity for a number.
    """
    if given == wanted or "" in (given, wanted) or ANY in (given, wanted):
        return True
    if given.startswith(LIST) and wanted.startswith(LIST):
        return type_fits(given.removeprefix(LIST), wanted.removeprefix(LIST))
    if wanted == "number":
        return given == "integer" or given in UNITS
    return wanted in UNITS and given in ("number", "integer")
