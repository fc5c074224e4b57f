"""The nodes of a tree as data, as in the file."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from trees.errors import Place

from .document import Located


@dataclass(frozen=True, slots=True)
class Key:
    """A reference `$name` in a file, to a parameter, a port of the subtree, or a key.

    Attributes:
        place: Its place.
        name: Name without the $.
        label: Place of the port whose value it is.
    """

    place: Place
    name: str
    label: Place


Value = Located | Key


@dataclass(frozen=True, slots=True)
class SkillNode:
    """A leaf.

    Attributes:
        place: Its place.
        skill: Name of the skill; empty if the file is wrong here.
        ports: Values and references by port. A value without a port is at "". In a wrong part of a
            file, the references in it.
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
        named: The source in the file, with its key; None if the file writes it like a skill.
        head: Its key: `subtree` or `task`. A task that has a name in place of its number has a
            text as its source.
    """

    place: Place
    source: str | int
    values: Mapping[str, Value]
    name: str = ""
    named: Located | None = None
    head: str = "subtree"


TreeNode = SkillNode | ControlNode | SubtreeNode
