"""A built tree as an outline: what a picture, a text or another program's file is made from."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector, Sequence
from py_trees.decorators import FailureIsSuccess, Inverter

from skills import Skill
from trees.compile.leaf import Leaf
from trees.nodes.control import (
    Guard,
    ReactiveSelector,
    ReactiveSequence,
    Repeat,
    Retry,
    Timeout,
    WaitFor,
)
from trees.nodes.parallel import Join, Race

# The first that fits counts.
_KINDS: tuple[tuple[type[Behaviour], str], ...] = (
    (ReactiveSequence, "reactive sequence"),
    (ReactiveSelector, "reactive selector"),
    (Sequence, "sequence"),
    (Selector, "selector"),
    (Race, "parallel, any"),
    (Join, "parallel"),
    (Guard, "guard"),
    (Retry, "retry"),
    (Repeat, "repeat"),
    (WaitFor, "wait for"),
    (Timeout, "timeout"),
    (Inverter, "inverter"),
    (FailureIsSuccess, "force success"),
)


@dataclass(frozen=True)
class Entry:
    """One node.

    Attributes:
        name: Of the node.
        kind: What it does with its children, or the name of its skill.
        children: What it holds.
        ports: What its ports are wired to: values as text, keys with a $.
        outputs: Which of these it writes.
        keys: Which of these are wired to keys.
        node: Which; None where it is known from a recording only.
        state: After a run, what became of it; a key of `drawings.LOOKS`. Else empty.
        note: After a run, when, and what it said.
    """

    name: str
    kind: str
    children: "tuple[Entry, ...]"
    ports: Mapping[str, str] = field(default_factory=dict)
    outputs: frozenset[str] = frozenset()
    keys: frozenset[str] = frozenset()
    node: Behaviour | None = None
    state: str = ""
    note: str = ""

    @property
    def title(self) -> str:
        """Its name, and its kind where that says more."""
        return self.name if self.name == self.kind else f"{self.name} ({self.kind})"

    def wiring(self) -> list[str]:
        """Its ports, one line each."""
        arrows = {port: "->" if port in self.outputs else "=" for port in self.ports}
        return [f"{port} {arrows[port]} {value}" for port, value in self.ports.items()]

    def walk(self) -> "Iterator[Entry]":
        """Itself and all below it, from the top."""
        yield self
        for child in self.children:
            yield from child.walk()


def outline(root: Behaviour, leaves: list[Leaf], namespace: str) -> Entry:
    """The outline of a tree.

    Args:
        root: Of the tree.
        leaves: Its skills.
        namespace: Of its keys.
    """
    return _entry(root, {leaf.skill: leaf for leaf in leaves}, f"{namespace}/")


def _entry(node: Behaviour, leaves: Mapping[Behaviour, Leaf], namespace: str) -> Entry:
    children = tuple(_entry(child, leaves, namespace) for child in node.children)
    if not isinstance(node, Skill):
        kind = next(name for fits, name in _KINDS if isinstance(node, fits))
        return Entry(node.name, kind, children, node=node)
    leaf = leaves[node]
    ports = {port: _text(value) for port, value in leaf.inputs.items()}
    ports |= {port: f"${key.removeprefix(namespace)}" for port, key in leaf.keys.items()}
    outputs = frozenset(node.output_ports()) & set(ports)
    keys = frozenset(leaf.keys)
    return Entry(node.name, type(node).__name__, (), ports, outputs, keys, node)


def _text(value: object) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, float):
        return f"{value:g}"
    return str(value).lower() if isinstance(value, bool) else str(value)
