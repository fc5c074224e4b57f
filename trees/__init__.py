"""Task files: their grammar, how they are read, compiled and checked, and the shipped tasks."""

from .declarations import ANY, LIST, TYPES, UNITS, Declaration, type_fits, words
from .errors import DuplicateTask, FileError, Mistake, Mistakes, Place, TreeError, UnknownTask
from .reading.document import REFUSED, Located, StandIn, nested, read_text
from .reading.grammar import UNTYPED, VERSION, PosesFile, SubtreeFile, TaskFile, parse_value
from .reading.library import Library, poses_of
from .reading.node_parser import MAX_NUMBER
from .reading.specs import ControlNode, Key, SkillNode, SubtreeNode, TreeNode, Value
from .reading.values import fit, measured

__all__ = [
    "ANY",
    "LIST",
    "MAX_NUMBER",
    "REFUSED",
    "TYPES",
    "UNITS",
    "UNTYPED",
    "VERSION",
    "ControlNode",
    "Declaration",
    "DuplicateTask",
    "FileError",
    "Key",
    "Library",
    "Located",
    "Mistake",
    "Mistakes",
    "Place",
    "PosesFile",
    "SkillNode",
    "StandIn",
    "SubtreeFile",
    "SubtreeNode",
    "TaskFile",
    "TreeError",
    "TreeNode",
    "UnknownTask",
    "Value",
    "fit",
    "measured",
    "nested",
    "parse_value",
    "poses_of",
    "read_text",
    "type_fits",
    "words",
]
