"""Types of ports: values with a unit and bounds, joint positions, vectors."""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from py_trees.ports import PortInformation

from hardware import DISPLAY_UNITS, Robot
from hardware.joints import rounded
from hardware.printable import plural

from .errors import BadTarget

MOST_REACHES = 10  # largest length in a task, as a multiple of the arm's reach
ORIGIN = (0.0, 0.0, 0.0)
MAX_WORDS = 200  # largest number of characters of a value for people


@dataclass(frozen=True)
class Port(PortInformation):
    """A port of a skill. Values of this port in task files are checked against it.

    A port of type `object` accepts a number, a text, or true or false.

    Attributes:
        unit: Unit of a float or of a list's items: `rad`, `s` or `m`; "" for no unit. With `rad`, a
            task file may also write `-80 deg`.
        least: Smallest value.
        most: Largest value.
        count: Number of items of a list; 0 for any number.
        choices: Allowed texts; empty for any.
        relative: True for positions that are distances: a task cannot give a pose for them.
        like: Port of the same skill that must have the same type; for ports of type `object`.
    """

    unit: str = ""
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    count: int = 0
    relative: bool = False
    like: str = ""


class Positions(dict[str, float]):
    """Joint name to position [rad].

    Attributes:
        unknown: Names of further joints, whose values are invalid or not known yet.
    """

    unknown: tuple[str, ...] = ()


def vector(
    description: str,
    unit: str = "",
    default: tuple[float, ...] | None = None,
    least: float | None = None,
) -> Port:
    """Declare a port for three numbers.

    Args:
        description: Description of the port.
        unit: Unit of the numbers; "" for no unit.
        default: Value if the task gives none; it may be empty. None if the task must give a value.
        least: Smallest number.
    """
    value = None if default is None else list(default)
    return Port(list[float], True, description, value, unit=unit, least=least, count=3)


def xyz(name: str, values: Sequence[float]) -> tuple[float, float, float]:
    """Return the three numbers of a vector.

    Args:
        name: Name of the vector, for the message.
        values: Its numbers.

    Raises:
        BadTarget: There are not exactly three values.
    """
    if len(values) != 3:
        raise BadTarget(f"the {name} has {plural(len(values), 'value')}; give x, y, z")
    x, y, z = values
    return x, y, z


def value_words(value: Any, unit: str, robot: Robot) -> str:
    """Return the value of a port for people, in at most `MAX_WORDS` characters.

    Args:
        value: The value. It may have any type. Of a large object, of a list in a list and of an
            integer too large for a float, only the type is named.
        unit: Unit of its numbers: `rad`, `s`, `m` or "".
        robot: Description of the robot.
    """
    items = _items(value, unit, robot)
    words = next(items, "")
    while len(words) <= MAX_WORDS and (item := next(items, None)) is not None:
        words += f", {item}"
    return words if len(words) <= MAX_WORDS else f"{words[: MAX_WORDS - 1]}…"


def _items(value: Any, unit: str, robot: Robot) -> Iterator[str]:
    match value:
        case Positions():
            units = {joint.name: joint.unit for joint in robot.joints}
            for name, q in value.items():
                its = units.get(name, "rad")
                yield f"{name} {rounded(q, its) if isinstance(q, float) else _words(q, its)}"
        case list() | tuple():
            for each in value:
                if isinstance(each, Positions):
                    yield from _items(each, unit, robot)
                else:
                    yield _words(each, unit)
        case _:
            yield _words(value, unit)


def _words(value: Any, unit: str) -> str:
    match value:
        case str():
            return value
        case bool():
            return str(value).lower()
        case int() if abs(value) > sys.float_info.max:
            return "int"
        case int() if not unit:
            return str(value)
        case int() | float():
            scale, shown = DISPLAY_UNITS.get(unit, (1.0, unit))
            return f"{scale * value:z.6g} {shown}".rstrip()
        case _:
            return type(value).__name__
