"""Helpers for arrays of joint positions."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def readonly(values: ArrayLike) -> Array:
    """Return a read-only array of floats; a copy, unless the array already owns read-only data."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable or not (array.flags.owndata or isinstance(array.base, bytes)):
        array = array.copy()
        array.setflags(write=False)
    return array


def norms(steps: Array) -> Array:
    """Return the length of every row (N, J) -> (N,), also if its square would underflow."""
    largest = np.max(abs(steps), axis=1, initial=np.finfo(float).tiny)
    lengths: Array = largest * np.linalg.norm(steps / largest[:, None], axis=1)
    return lengths
