"""The nodes of a tree as data, and the table of those that hold others."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from trees.errors import Place

from .document import Located
from .values import Declaration


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


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of node that holds others.

    Attributes:
        description: What it does.
        options: What may be written beside it.
        many: Whether it holds a list.
        condition: The key beside it that holds a second node, if it has one.
    """

    description: str
    options: Mapping[str, Declaration] = field(default_factory=dict)
    many: bool = False
    condition: str = ""


MAX_DURATION = 86_400.0  # [s]

_MEMORY = Declaration(
    "boolean",
    default=True,
    description="whether a finished child is not asked again while a later one runs",
)


def _duration(description: str, default: float | None = None, least: float = 0.0) -> Declaration:
    return Declaration(
        "duration", default=default, least=least, most=MAX_DURATION, description=description
    )


def _count(description: str, optional: bool = False) -> Declaration:
    return Declaration(
        "integer", optional=optional, least=1, most=1_000_000, description=description
    )


KINDS: Mapping[str, Kind] = {
    "sequence": Kind(
        "one after the other, up to the first that fails", {"memory": _MEMORY}, many=True
    ),
    "selector": Kind(
        "one after the other, up to the first that succeeds", {"memory": _MEMORY}, many=True
    ),
    "parallel": Kind(
        "all at once",
        {
            "policy": Declaration(
                "text",
                default="all",
                choices=("all", "any"),
                description="all: wait for every one, and fail if any did; "
                "any: the first success halts the others",
            )
        },
        many=True,
    ),
    "retry": Kind(
        "again until it succeeds",
        {
            "attempts": _count("how often at most"),
            "backoff": _duration("pause before the second attempt; it doubles each time", 0.0),
        },
    ),
    "repeat": Kind(
        "again until it fails",
        {"times": _count("how often; without it for ever", optional=True)},
    ),
    "wait_for": Kind(
        "until the condition holds",
        {"every": _duration("how often it is asked", 0.1, least=0.01)},
    ),
    "timeout": Kind(
        "halted, and failed, when it takes too long",
        {"after": _duration("how long it may take", least=0.001)},
    ),
    "inverter": Kind("fails where the node succeeds, and the other way round"),
    "force_success": Kind("succeeds when the node has ended, however it did"),
    "guard": Kind(
        "only as long as a condition holds",
        {
            "otherwise": Declaration(
                "text",
                default="fail",
                choices=("fail", "pause"),
                description="fail: halt the node and fail; pause: halt it, and begin it anew when "
                "the condition holds again",
            ),
            "every": _duration("how often the condition is asked", 0.1, least=0.01),
        },
        condition="while",
    ),
}
