"""The resolved task: one tree without subtrees, with all values."""

import json
from collections.abc import Mapping
from typing import Any

from py_trees.behaviour import Behaviour

from trees.compile.compiler import CompiledTree
from trees.compile.leaf import Leaf

RESOLVED = "task.resolved.yaml"


def resolved(tree: CompiledTree) -> str:
    """Return a compiled task as the text of one file, in YAML that is also JSON."""

    def described(node: Behaviour) -> dict[str, Any]:
        if leaf := tree.leaves.get(node):
            name = type(node).__name__
            made: dict[str, Any] = {name: _ports(leaf, tree.namespace)}
        else:
            control = tree.controls[node]
            kind, options, name = control.kind, control.options, control.kind.name
            children = [described(child) for child in node.children]
            keys = (name, kind.condition)
            made = {name: children} if kind.many else dict(zip(keys, children, strict=False))
            made |= {option: value for option, value in options.items() if value is not None}
        return made if node.name == name else made | {"name": node.name}

    return json.dumps(described(tree.root), indent=1) + "\n"


def _ports(leaf: Leaf, namespace: str) -> Mapping[str, Any]:
    """Return the values and keys at ports. The names of keys are unique in the tree."""
    keys = {
        port: "$" + key.removeprefix(f"{namespace}/").replace("/", "_")
        for port, key in leaf.keys.items()
    }
    values = {
        port: f"${value}" if isinstance(value, str) and value.startswith("$") else value
        for port, value in leaf.inputs.items()
    }
    return {**keys, **values}
