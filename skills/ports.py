"""Types of ports: values with a unit and bounds, joint positions, vectors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from py_trees.ports import PortInformation

from hardware import DISPLAY_UNITS, Robot
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
        like: Port of the same skill that must have the same type; for ports of type `object`.
    """

    unit: str = ""
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    count: int = 0
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
        value: The value. Of a large object, only the type is named.
        unit: Unit of its numbers: `rad`, `s`, `m` or "".
        robot: Description of the robot.
    """
    words = _words(value, unit, robot)
    return words if len(words) <= MAX_WORDS else f"{words[: MAX_WORDS - 1]}…"


def _words(value: Any, unit: str, robot: Robot) -> str:
    match value:
        case Positions():
            return robot.words(value)
        case str():
            return value
        case bool():
            return str(value).lower()
        case int() | float():
            scale, shown = DISPLAY_UNITS.get(unit, (1.0, unit))
            return f"{scale * value:z.6g} {shown}".rstrip()
        case list() | tuple():
            return ", ".join(_words(each, unit, robot) for each in value)
        case _:
            return type(value).__name__
