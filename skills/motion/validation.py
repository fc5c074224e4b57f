"""Checks of numbers that come from callers."""

from numbers import Real
from typing import cast

from .errors import BadQuery, shown

# Largest position of a continuous joint [rad], size or distance [m]. With much larger numbers,
# rounding errors of an angle exceed a turn, and coal crashes if the square is not finite.
MAX_MAGNITUDE = 1e6
# Smallest size of a body [m]. pinocchio ignores a body if the computed volume of its box is 0.
MIN_SIZE = 1e-6

_MAX_SEED = 2**64 - 2  # recordings store seeds in 64 bits


def is_number(value: object, least: float, most: float) -> bool:
    """Return True if a value is a number in [least, most]. NaN is in no range."""
    return isinstance(value, Real) and bool(least <= cast(float, value) <= most)


def check_seed(seed: int) -> None:
    """Check a random seed.

    Raises:
        BadQuery: The seed is not a whole number, or it is too large for a recording.
    """
    if not (isinstance(seed, int) and 0 <= seed <= _MAX_SEED):
        raise BadQuery(f"The seed is {shown(seed)}; give a whole number from 0 to {_MAX_SEED}")
