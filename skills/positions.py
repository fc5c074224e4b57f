"""Joint positions by name, and places in the room, as they stand in task files."""

from collections.abc import Sequence

from .errors import BadTarget


class Positions(dict[str, float]):
    """Joint name to position [rad].

    Attributes:
        unknown: Further joints that are named, but with a value that is wrong or not given yet.
    """

    unknown: tuple[str, ...] = ()


def three(what: str, values: Sequence[float]) -> tuple[float, float, float]:
    """The three numbers of a vector.

    Raises:
        BadTarget: There are not three.
    """
    if len(values) != 3:
        raise BadTarget(f"the {what} has {len(values)} values; give x, y, z")
    x, y, z = values
    return x, y, z
