"""Ports with a unit and bounds."""

from dataclasses import dataclass

from py_trees.ports import PortInformation


@dataclass(frozen=True)
class Port(PortInformation):
    """A port of a skill; what a task file writes there is checked by it.

    `object` as the type takes a number, a text, or true or false.

    Attributes:
        unit: Of a float, or of each in a list: `rad`, `s` or `m`, which also lets a file write
            `-80 deg`; empty for none.
        least: Smallest value.
        most: Largest value.
        count: How many items a list has; 0 for any number.
        choices: The only texts there are; empty for all.
        like: Another port of the skill that holds the same type; for ports of type `object`.
    """

    unit: str = ""
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    count: int = 0
    like: str = ""
