"""The outline of a tree: the source of drawings and of files for other programs."""

from collections.abc import Iterator, Mapping
from dataclasses import field

from py_trees.behaviour import Behaviour

from hardware.loading.dataclass import dataclass
from skills import Skill
from trees.compile.compiler import CompiledTree
from trees.compile.leaf import Leaf
from trees.nodes.kind import Control


@dataclass(frozen=True, slots=True)
class Entry:
    """One node of an outline.

    Attributes:
        name: Name of the node.
        kind: Name of its kind or skill.
        children: Its children.
        ports: Values and keys at its ports, by port. Values are text; keys begin with $.
        outputs: Names of the ports that it writes.
        keys: Names of the ports that have a key.
        skill: Class of the skill; None for a node with children, or from a recording.
        control: Kind and options of a node with children; None for a skill, or from a recording.
        state: Last status in a run, a key of `drawings.LOOKS`; empty without a run.
        note: Time and message of `state`.
    """

    name: str
    kind: str
    children: "tuple[Entry, ...]"
    ports: Mapping[str, str] = field(default_factory=dict)
    outputs: frozenset[str] = frozenset()
    keys: frozenset[str] = frozenset()
    skill: type[Skill] | None = None
    control: Control | None = None
    state: str = ""
    note: str = ""

    @property
    def title(self) -> str:
        """Name of the node, and its kind if the kind has another name."""
        return self.name if self.name == self.kind else f"{self.name} ({self.kind})"

    def wiring(self) -> list[str]:
        """Return one line of text per port."""
        arrows = {port: "->" if port in self.outputs else "=" for port in self.ports}
        return [f"{port} {arrows[port]} {value}" for port, value in self.ports.items()]

    def walk(self) -> "Iterator[Entry]":
        """Yield the entry and all entries below it, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()


def outline(tree: CompiledTree) -> Entry:
    """Return the outline of a compiled tree."""
    return _entry(tree, tree.root)


def _entry(tree: CompiledTree, node: Behaviour) -> Entry:
    if leaf := tree.leaves.get(node):
        return _leaf_entry(leaf, f"{tree.namespace}/")
    children, control = tuple(_entry(tree, child) for child in node.children), tree.controls[node]
    return Entry(node.name, control.kind.label(control.options), children, control=control)


def _leaf_entry(leaf: Leaf, namespace: str) -> Entry:
    kind = type(leaf.skill)
    ports = {port: _text(value) for port, value in leaf.inputs.items()}
    ports |= {port: f"${key.removeprefix(namespace)}" for port, key in leaf.keys.items()}
    outputs = frozenset(kind.output_ports()) & set(ports)
    keys = frozenset(leaf.keys)
    return Entry(leaf.skill.name, kind.__name__, (), ports, outputs, keys, kind)


def _text(value: object) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    if isinstance(value, float):
        return f"{value:g}"
    return str(value).lower() if isinstance(value, bool) else str(value)
