"""Checks of numbers and joint positions that come from callers."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hardware import Joint

from .errors import BadQuery, NotFinite, shown

# Largest position of a continuous joint, size or distance [rad, m]. Far above it the rounding of an
# angle is larger than a turn, and coal crashes on numbers whose square is not finite.
MAX_MAGNITUDE = 1e6
MIN_SIZE = math.ulp(0.0)  # smallest number above 0: a solid has no size of 0 [m]

_NUMBERS = (int, float, np.integer, np.floating)
_MAX_SEED = 2**64 - 2  # recordings store 64 bits


def is_number(value: object, least: float, most: float) -> bool:
    """Return True if a value is a number in [least, most]. NaN is in no range."""
    return isinstance(value, _NUMBERS) and bool(least <= value <= most)


def check_seed(seed: int) -> None:
    """Check a random seed.

    Raises:
        BadQuery: It is not a whole number, or too large for a recording.
    """
    if not (isinstance(seed, int) and 0 <= seed <= _MAX_SEED):
        raise BadQuery(f"The seed is {shown(seed)}; give a whole number from 0 to {_MAX_SEED}")


def joint_positions(
    what: str, values: Sequence[float] | NDArray[np.float64], joints: Sequence[Joint]
) -> NDArray[np.float64]:
    """Return positions of joints as an array (J,) [rad].

    Args:
        what: Name of the values in messages, such as `start`.
        values: One position per joint [rad].
        joints: The joints, in the same order.

    Raises:
        BadQuery: The number of values is wrong, or one is not a number.
        NotFinite: A value is NaN or infinite.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise BadQuery(f"The {what} {shown(values)} is not all numbers; give radians") from error
    if array.shape != (len(joints),):
        raise BadQuery.count(what, array.size, (joint.name for joint in joints))
    for joint, value in zip(joints, array.tolist(), strict=True):
        if not math.isfinite(value):
            raise NotFinite(what, joint.name, value)
    return array
