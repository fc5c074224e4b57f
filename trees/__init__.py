"""The tasks that ship, their grammar, and the reading of task files."""

from .errors import DuplicateTask, FileError, Mistake, Place, TreeError, UnknownTask
from .reading.document import REFUSED, Located, StandIn, nested, read_text
from .reading.grammar import UNTYPED, VERSION, PosesFile, SubtreeFile, TaskFile, parse_value
from .reading.library import Library, poses_of
from .reading.node_parser import MAX_NUMBER, Mistakes
from .reading.specs import KINDS, ControlNode, Key, Kind, SkillNode, SubtreeNode, TreeNode, Value
from .reading.values import (
    ANY,
    LIST,
    TYPES,
    UNITS,
    Declaration,
    fit,
    measured,
    type_fits,
    words,
)

__all__ = [
    "ANY",
    "KINDS",
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
    "Kind",
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
