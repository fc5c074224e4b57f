"""The tasks that ship, their grammar, and the reading of task files."""

from .document import Located
from .errors import DuplicateTask, FileError, Mistake, Place, TreeError, UnknownTask
from .grammar import (
    COMPOSITES,
    CompositeNode,
    Key,
    SkillNode,
    SubtreeFile,
    SubtreeNode,
    TaskFile,
    TreeNode,
    choices,
)
from .library import Library

__all__ = [
    "COMPOSITES",
    "CompositeNode",
    "DuplicateTask",
    "FileError",
    "Key",
    "Library",
    "Located",
    "Mistake",
    "Place",
    "SkillNode",
    "SubtreeFile",
    "SubtreeNode",
    "TaskFile",
    "TreeError",
    "TreeNode",
    "UnknownTask",
    "choices",
]
