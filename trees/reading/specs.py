"""The nodes of a tree as data, and the table of those that hold others."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from trees.errors import Place

from .document import Located


@dataclass(frozen=True, slots=True)
class Key:
    """A value by name, `$name` in a file: a parameter, a port of the subtree, or a key.

    Attributes:
        place: Where it stands.
        name: Without the $.
        label: Where the port stands that it is wired to.
    """

    place: Place
    name: str
    label: Place


Value = Located | Key


@dataclass(frozen=True, slots=True)
class SkillNode:
    """A leaf.

    Attributes:
        place: Where it stands.
        skill: Name of the skill; empty where the file is wrong here.
        ports: What its ports are wired to; where the file is wrong, the keys that stand here.
        name: How it is shown; empty for the skill's name.
    """

    place: Place
    skill: str
    ports: Mapping[str, Value]
    name: str = ""


@dataclass(frozen=True, slots=True)
class ControlNode:
    """A node that decides what becomes of others.

    Attributes:
        place: Where it stands.
        kind: A key of KINDS; empty where the file is wrong here.
        children: What it holds; the condition of a guard comes last.
        options: What is written beside it.
        name: How it is shown; empty for its kind.
    """

    place: Place
    kind: str
    children: "tuple[TreeNode, ...]"
    options: Mapping[str, Value] = field(default_factory=dict)
    name: str = ""


@dataclass(frozen=True, slots=True)
class SubtreeNode:
    """A subtree, or a task, from a file of its own.

    Attributes:
        place: Where it stands.
        source: Name of the subtree, or number of the task; empty where the file is wrong here.
        values: What its ports or parameters are wired to.
        name: How it is shown; empty for the name of the file.
    """

    place: Place
    source: str | int
    values: Mapping[str, Value]
    name: str = ""


TreeNode = SkillNode | ControlNode | SubtreeNode
