"""Task files: their grammar, how they are read, compiled and checked, and the shipped tasks."""

from .declarations import UNITS, Declaration
from .errors import FileError, Mistake, Place, TreeError, UnknownTask
from .reading.document import Located
from .reading.grammar import TaskFile, parse_value
from .reading.library import Library
from .reading.values import fit

__all__ = [
    "UNITS",
    "Declaration",
    "FileError",
    "Library",
    "Located",
    "Mistake",
    "Place",
    "TaskFile",
    "TreeError",
    "UnknownTask",
    "fit",
    "parse_value",
]
