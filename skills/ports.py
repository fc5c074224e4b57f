"""Ports of skills: their units and bounds, joint positions, vectors, and texts for values."""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from py_trees.ports import PortInformation

from hardware import DISPLAY_UNITS, Robot
from hardware.joints import rounded
from hardware.printable import plural

from .errors import BadTarget

MOST_REACHES = 10  # largest length in a task, divided by the arm's reach
ORIGIN = (0.0, 0.0, 0.0)
MAX_WORDS = 200  # largest length of a text for a value [characters]


@dataclass(frozen=True)
class Port(PortInformation):
    """A port of a skill. The values of this port in task files must fit its attributes.

    A port of type `object` accepts a number, a text, or true or false.

    Attributes:
        unit: Unit of a float, or of each item of a list: `rad`, `s` or `m`; "" for no unit. With
            `rad`, a task file may also contain `-80 deg`.
        least: Smallest allowed value; None for no limit.
        most: Largest allowed value; None for no limit.
        count: Number of items of a list; 0 for any number.
        choices: Allowed texts; empty if any text is allowed.
        relative: True if the positions are distances; a task then cannot name a pose here.
        like: Other port of the skill whose value must have the same type. Only for ports of type
            `object`.
    """

    unit: str = ""
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    count: int = 0
    relative: bool = False
    like: str = ""


class Positions(dict[str, float]):
    """Joint positions: a dict from joint name to position [rad].

    Attributes:
        unknown: Names of additional joints whose positions are invalid or not known yet.
    """

    unknown: tuple[str, ...] = ()


def vector(
    description: str,
    unit: str = "",
    default: tuple[float, ...] | None = None,
    least: float | None = None,
) -> Port:
    """Return a port for three numbers x, y, z.

    Args:
        description: Description of the port.
        unit: Unit of the numbers; "" for no unit.
        default: Value of the port if the task has no value; may be empty. None if the task must
            have a value.
        least: Smallest allowed number; None for no limit.
    """
    value = None if default is None else list(default)
    return Port(list[float], True, description, value, unit=unit, least=least, count=3)


def xyz(name: str, values: Sequence[float]) -> tuple[float, float, float]:
    """Return the three numbers of a vector as a tuple.

    Args:
        name: Name of the vector, for the message.
        values: Numbers of the vector.

    Raises:
        BadTarget: There are not exactly three values.
    """
    if len(values) != 3:
        raise BadTarget(f"the {name} has {plural(len(values), 'value')}; give x, y, z")
    x, y, z = values
    return x, y, z


def value_words(value: Any, unit: str, robot: Robot) -> str:
    """Return a text for people that shows the value of a port, in at most `MAX_WORDS` characters.

    Args:
        value: The value, of any type. The text has only the name of the type for an object, for a
            list in a list, and for an integer that is too large for a float.
        unit: Unit of the numbers in the value: `rad`, `s`, `m` or "".
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
