"""Helpers for arrays of joint positions.

A run loads NumPy while the board boots. Modules that are needed before must not import this file.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hardware import Joint

from .errors import BadQuery, NotFinite, shown

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Shape and offset of each array [bytes], and the bytes of all arrays.
Packed = tuple[list[tuple[tuple[int, ...], int]], bytes]


def readonly(values: ArrayLike) -> Array:
    """Return the values as a read-only array of floats. Copies data that may change later."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable or not (array.flags.owndata or isinstance(array.base, bytes)):
        array = array.copy()
        array.setflags(write=False)
    return array


def norms(steps: Array) -> Array:
    """Return the length of each row (N, J) -> (N,). Also exact if the squares would underflow."""
    largest = np.max(abs(steps), axis=1, initial=np.finfo(float).tiny)
    lengths: Array = largest * np.sqrt(np.square(steps / largest[:, None]).sum(axis=1))
    return lengths


def joint_positions(what: str, values: Sequence[float] | Array, joints: Sequence[Joint]) -> Array:
    """Return positions of joints as an array (J,) [rad].

    Args:
        what: Name of the values in messages, such as `start`.
        values: One position per joint [rad].
        joints: The joints, in the same order.

    Raises:
        BadQuery: The number of values is wrong, or a value is not a number.
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


def pack(arrays: Iterable[Array]) -> Packed:
    """Return arrays packed into one bytes object, because pickle takes 3 us for each array."""
    places, memory, begin = list[tuple[tuple[int, ...], int]](), list[bytes](), 0
    for array in arrays:
        places.append((array.shape, begin))
        memory.append(array.tobytes())
        begin += len(memory[-1])
    return places, b"".join(memory)


def unpack(packed: Packed) -> list[Array]:
    """Return read-only arrays from the result of `pack`.

    Raises:
        ValueError: A value is not finite, or bytes are missing.
    """
    places, memory = packed
    if not all(map(math.isfinite, memoryview(memory).cast("d"))):
        raise ValueError("a value is not finite")
    dtype = np.dtype(np.float64)
    return [np.ndarray(shape, dtype, memory, begin) for shape, begin in places]
