"""Loads public names of a package at their first use, so that the package is quick to import.

The package lists the names as imports under `if typing.TYPE_CHECKING`. This module reads them.
"""

import importlib
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any


def lazy_exports(package: str) -> Callable[[str], Any]:
    """Return the `__getattr__` of a module (PEP 562).

    Args:
        package: Name of the module that calls this function.
    """

    def load(name: str) -> Any:
        module = sys.modules[package]
        if name == "__all__":
            return [*_sources(str(module.__file__))]
        # Python asks each module for `__path__`, which needs no file.
        if name.startswith("__") or name not in (sources := _sources(str(module.__file__))):
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(sources[name], package), name)
        setattr(module, name, value)
        return value

    return load


@cache
def _sources(file: str) -> dict[str, str]:
    """Return the modules of the public names of a file, by name: of all `from x import A as A`."""
    import ast  # slow, and not needed to import the package

    nodes = ast.walk(ast.parse(Path(file).read_bytes()))
    return {
        alias.name: "." * node.level + (node.module or "")
        for node in nodes
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.name == alias.asname
    }
