"""The tasks that ship, their grammar, and the reading of task files."""

from .document import Located
from .errors import DuplicateTask, FileError, Mistake, Place, TreeError, UnknownTask
from .grammar import CompositeNode, Key, SkillNode, SubtreeFile, SubtreeNode, TaskFile, TreeNode
from .library import Library

__all__ = [
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
]
