"""The keys that begin a node, the other keys of a node, and synonyms of both."""

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from hardware.spelling import corrections

if TYPE_CHECKING:
    from trees.nodes.kind import ControlNodeKind

# First keys of nodes that are in other files, each with the other keys of such a node.
FILES = {"subtree": ("with", "name"), "task": ("with", "name")}


def kinds() -> "Mapping[str, ControlNodeKind]":
    """Return the kinds of control nodes, by name."""
    from trees.nodes.kind import KINDS  # the import takes 0.3 s; a list of tasks does not need it

    return KINDS


def in_turn() -> str:
    """Return the kind of control node that runs a list of nodes, one after the other."""
    return next(name for name, kind in kinds().items() if kind.many)


def begins_node(key: str) -> bool:
    """Return True if a key begins a node, or looks like the name of a skill."""
    return key in heads() or key[:1].isupper()


def holds_nodes(key: str) -> bool:
    """Return True if a key is the name of a control node, also in another program."""
    return key.lower() in kinds() or key in synonyms()


def heads() -> tuple[str, ...]:
    """Return the keys that begin a node, except for the names of skills."""
    return (*kinds(), *FILES)


def beside_keys() -> set[str]:
    """Return the keys that nodes may have after their first key."""
    return {
        "with",
        "name",
        *(key for kind in kinds().values() for key in (*kind.options, kind.condition)),
    }


def likely_heads(words: Collection[str]) -> dict[str, str]:
    """Return the likely first keys of nodes for unknown words."""
    named = {word: kind for word, kind in synonyms().items() if word in words}
    own = {*beside_keys(), *keywords()}
    skills = {word for word in words if word[:1].isupper() and word.lower() not in heads()}
    return named or corrections([word for word in words if word not in own | skills], heads())


def synonyms() -> dict[str, str]:
    """Return the kinds of control nodes, by their names in other languages and libraries."""
    return {word: name for name, kind in kinds().items() for word in kind.synonyms}


def keywords() -> dict[str, str]:
    """Return the messages for keywords of programming languages, by keyword."""
    return {word: why for kind in kinds().values() for word, why in kind.keywords.items()}
