"""Arrays that nobody can change, on either side of a pipe."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Values by name, shapes of arrays by name, and what is in these, one after another.
_State = tuple[dict[str, Any], list[tuple[str, tuple[int, ...]]], bytes]


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


class Rebuilt:
    """A dataclass that is pickled by its fields, so that its arrays are read-only again.

    All of its arrays travel as one piece of memory: pickle takes 3 us for each that it is given.
    """

    def __getstate__(self) -> _State:
        rest, shapes, memory = dict[str, Any](), list[tuple[str, tuple[int, ...]]](), list[bytes]()
        for name, value in self.__dict__.items():
            if isinstance(value, np.ndarray):
                shapes.append((name, value.shape))
                memory.append(value.tobytes())
            else:
                rest[name] = value
        return rest, shapes, b"".join(memory)

    def __setstate__(self, state: _State) -> None:
        rest, shapes, memory = state
        values, begin = self.__dict__, 0
        values.update(rest)
        for name, shape in shapes:
            values[name] = array = np.ndarray(shape, np.float64, memory, begin)
            begin += array.nbytes
