"""A built tree as an outline: what a picture, a text or another program's file is made from."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector, Sequence
from py_trees.decorators import FailureIsSuccess, Inverter

from skills import Skill

from .assembly import Leaf
from .control import Guard, ReactiveSelector, ReactiveSequence, Repeat, Retry, Timeout, WaitFor
from .join import Join, Race

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
        node: Which.
        kind: What it does with its children, or the name of its skill.
        ports: What its ports are wired to: values as text, keys with a $.
        outputs: Which of these it writes.
        children: What it holds.
    """

    node: Behaviour
    kind: str
    ports: Mapping[str, str]
    outputs: frozenset[str]
    children: "tuple[Entry, ...]"

    @property
    def title(self) -> str:
        """Its name, and its kind where that says more."""
        name = self.node.name
        return name if name == self.kind else f"{name} ({self.kind})"

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
        return Entry(node, kind, {}, frozenset(), children)
    leaf = leaves[node]
    ports = {port: _text(value) for port, value in leaf.inputs.items()}
    ports |= {port: f"${key.removeprefix(namespace)}" for port, key in leaf.keys.items()}
    outputs = frozenset(node.output_ports()) & set(ports)
    return Entry(node, type(node).__name__, ports, outputs, ())


def _text(value: object) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, float):
        return f"{value:g}"
    return str(value).lower() if isinstance(value, bool) else str(value)
