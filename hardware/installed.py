"""Versions and entry points of installed packages, in place of importlib.metadata.

importlib.metadata reads the files of all packages with a parser for e-mail. This takes 40 ms in
each run, mostly for imports.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from operator import attrgetter
from typing import Any

from .loading.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class EntryPoint:
    """An object that an installed package offers under a name.

    Attributes:
        name: The name.
        value: Module and object, such as `arms.driver:Driver`.
    """

    name: str
    value: str

    @property
    def module(self) -> str:
        """Name of the module."""
        return self.value.partition(":")[0]

    def load(self) -> Any:
        """Import the module, and return the object."""
        found, path = import_module(self.module), self.value.partition(":")[2]
        return attrgetter(path)(found) if path else found


def entry_points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name. The first package on the path has precedence."""
    found: dict[str, EntryPoint] = {}
    for text in _entry_point_files(tuple(sys.path)):
        for line in _section(text, group) if f"[{group}]" in text else ():
            name, _, value = (part.strip() for part in line.partition("="))
            found.setdefault(name, EntryPoint(name, value.partition("[")[0].strip()))
    return found


def version(name: str) -> str:
    """Return the version of a package; empty if it is not installed.

    Args:
        name: Name as in the dist-info folder of the package: lower case, _ for each - and dot.
    """
    for folder in _packages(tuple(sys.path)):
        package, _, number = os.path.basename(folder).removesuffix(".dist-info").partition("-")
        if package == name:
            return number
    return ""


@cache
def _entry_point_files(path: tuple[str, ...]) -> list[str]:
    texts: list[str] = []
    for folder in _packages(path):
        with (
            suppress(OSError),
            open(f"{folder}/entry_points.txt", encoding="utf-8", errors="replace") as file,
        ):
            texts.append(file.read())
    return texts


@cache
def _packages(path: tuple[str, ...]) -> list[str]:
    """Return the folders that describe the packages on a path, in the order of the path."""
    found: list[str] = []
    for folder in path:
        with suppress(OSError):  # the path is a ZIP file, or it does not exist
            names = os.listdir(folder or ".")
            found += (f"{folder}/{name}" for name in names if name.endswith("-info"))
    return found


def _section(text: str, name: str) -> Iterator[str]:
    """Yield the lines `NAME = VALUE` of a section."""
    inside = False
    for line in text.splitlines():
        if line.strip().startswith("["):
            inside = line.strip() == f"[{name}]"
        elif inside and "=" in line and not line.lstrip().startswith(("#", ";")):
            yield line
