"""Arrays that nobody can change, on either side of a pipe."""

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def readonly(values: ArrayLike) -> NDArray[np.float64]:
    """A read-only copy, unless it already is a read-only array of its own."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable or not array.flags.owndata:
        array = array.copy()
        array.setflags(write=False)
    return array


def norms(steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length of every row (N, J) -> (N,), also where its square would underflow."""
    largest = np.max(abs(steps), axis=1, initial=np.finfo(float).tiny)
    lengths: NDArray[np.float64] = largest * np.linalg.norm(steps / largest[:, None], axis=1)
    return lengths


class Rebuilt:
    """A dataclass that is pickled by its fields, so that its arrays are read-only again."""

    def __reduce__(self) -> tuple[Any, ...]:
        values = tuple(getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]
        return type(self), values
