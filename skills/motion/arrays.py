"""Arrays that nobody can change, on either side of a pipe."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

_FLOAT = np.dtype(np.float64)
# Of each array its shape and where it begins, and what is in them, one after another.
Joined = tuple[list[tuple[tuple[int, ...], int]], bytes]


def readonly(values: ArrayLike) -> NDArray[np.float64]:
    """A read-only copy, unless it already is a read-only array of its own, or one of bytes."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable or not (array.flags.owndata or isinstance(array.base, bytes)):
        array = array.copy()
        array.setflags(write=False)
    return array


def norms(steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length of every row (N, J) -> (N,), also where its square would underflow."""
    largest = np.max(abs(steps), axis=1, initial=np.finfo(float).tiny)
    lengths: NDArray[np.float64] = largest * np.linalg.norm(steps / largest[:, None], axis=1)
    return lengths


def joined(arrays: Iterable[NDArray[np.float64]]) -> Joined:
    """Arrays as one piece of memory: pickle takes 3 us for each array that it is given."""
    places, memory, begin = list[tuple[tuple[int, ...], int]](), list[bytes](), 0
    for array in arrays:
        places.append((array.shape, begin))
        memory.append(array.tobytes())
        begin += len(memory[-1])
    return places, b"".join(memory)


def parted(together: Joined) -> list[NDArray[np.float64]]:
    """The arrays that were joined; they are read-only.

    Raises:
        ValueError: They hold a NaN or an infinity, or there is less of them than is said.
    """
    places, memory = together
    if not all(map(math.isfinite, memoryview(memory).cast("d"))):
        raise ValueError("a value is not finite")
    return [np.ndarray(shape, _FLOAT, memory, begin) for shape, begin in places]
