"""What is a number here, and how large one may be."""

import math

import numpy as np

# Of a joint without an end, a size, or how far off something is; of much more no angle can be told,
# and coal crashes on what is too large to be squared [rad, m].
FARTHEST = 1e6
LEAST = math.ulp(0.0)  # a size is more than 0: nothing solid is flat [m]

_NUMBERS = (int, float, np.integer, np.floating)


def is_number(value: object, least: float, most: float) -> bool:
    """Whether it is a number, and not less than one nor more than another."""
    return isinstance(value, _NUMBERS) and bool(least <= value <= most)
