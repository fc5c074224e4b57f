"""The parts of toppra that are used, without what it imports for those that are not.

toppra's splines and plots want scipy and matplotlib, which take 0.6 s of processor time and 60 MB,
and a worker that has just been replaced has a goal waiting. So while toppra is imported, empty
modules stand for these where nobody has loaded them yet.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

_UNUSED = ("scipy.interpolate", "scipy.sparse", "matplotlib", "matplotlib.pyplot")


class _Empty(ModuleType):
    """Has an empty class for every name that is imported from it, as some are inherited from."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {})


@contextmanager
def _without(names: tuple[str, ...]) -> Iterator[None]:
    """Modules that are not loaded are, inside, empty."""
    absent = {name: _Empty(name) for name in names if name not in sys.modules}
    sys.modules.update(absent)
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


with _without(_UNUSED):
    from toppra.constraint import LinearConstraint
    from toppra.solverwrapper.cy_seidel_solverwrapper import seidelWrapper

__all__ = ["LinearConstraint", "seidelWrapper"]
