"""Task files: their grammar, how they are read, compiled and checked, and the shipped tasks."""

from .declarations import UNITS, Declaration
from .errors import DuplicateTask, FileError, Mistake, Place, TreeError, UnknownTask
from .reading.document import Located
from .reading.grammar import TaskFile, parse_value
from .reading.library import Library
from .reading.specs import ControlNode, Key, SkillNode, SubtreeNode, TreeNode
from .reading.values import fit

__all__ = [
    "UNITS",
    "ControlNode",
    "Declaration",
    "DuplicateTask",
    "FileError",
    "Key",
    "Library",
    "Located",
    "Mistake",
    "Place",
    "SkillNode",
    "SubtreeNode",
    "TaskFile",
    "TreeError",
    "TreeNode",
    "UnknownTask",
    "fit",
    "parse_value",
]
