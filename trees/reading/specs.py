"""Nodes of a tree as a file gives them, before compilation."""

from collections.abc import Mapping
from dataclasses import field

from hardware.loading.dataclass import dataclass
from trees.errors import Place

from .document import Located


@dataclass(frozen=True, slots=True)
class Key:
    """A reference `$name` in a file, to a parameter, a port of the subtree, or a key.

    Attributes:
        place: Its place.
        name: Name without the $.
        label: Place of the port or option that has this reference.
    """

    place: Place
    name: str
    label: Place


Value = Located | Key


@dataclass(frozen=True, slots=True)
class SkillNode:
    """A leaf of the tree: one skill.

    Attributes:
        place: Its place.
        skill: Name of the skill; empty if the file is wrong here.
        ports: Values and references by port. A value without a port is at "". If `skill` is empty,
            the references in the wrong text, by their names.
        name: Name of the node; empty for the skill's name.
    """

    place: Place
    skill: str
    ports: Mapping[str, Value]
    name: str = ""


@dataclass(frozen=True, slots=True)
class ControlNode:
    """A node with children.

    Attributes:
        place: Its place.
        kind: Name of its kind; empty if the file is wrong here.
        children: Its children. A condition is the last child.
        options: Values of its options, by name.
        name: Name of the node; empty for its kind.
    """

    place: Place
    kind: str
    children: "tuple[TreeNode, ...]"
    options: Mapping[str, Value] = field(default_factory=dict)
    name: str = ""


@dataclass(frozen=True, slots=True)
class SubtreeNode:
    """A subtree, or another task, from its own file.

    Attributes:
        place: Its place.
        source: Name of the subtree, or number of the task; empty if the file is wrong here.
        values: Values and references by port or parameter. A value without a name is at "".
        name: Name of the node; empty for the name in the file.
        named: Value of the key `head` in the file; None if the node is written like a skill.
        head: First key of the node: `subtree` or `task`. If a task has a name in place of its
            number, `source` is this name.
    """

    place: Place
    source: str | int
    values: Mapping[str, Value]
    name: str = ""
    named: Located | None = None
    head: str = "subtree"


TreeNode = SkillNode | ControlNode | SubtreeNode
