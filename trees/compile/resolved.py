"""A task as it is run: one tree, every subtree in its place, every value filled in."""

import json
from collections.abc import Mapping
from typing import Any

from py_trees.behaviour import Behaviour

from skills import Skill
from trees.reading.specs import KINDS

from .assembly import TreeCompiler
from .leaf import Leaf

RESOLVED = "task.resolved.yaml"


def resolved(root: Behaviour, assembly: TreeCompiler, namespace: str) -> str:
    """The tree of a task in the grammar's words, in the part of YAML that is JSON too.

    Args:
        root: Of the tree.
        assembly: What put it together.
        namespace: Of its keys.
    """
    leaves = {leaf.skill: leaf for leaf in assembly.leaves}

    def described(node: Behaviour) -> dict[str, Any]:
        if isinstance(node, Skill):
            kind = type(node).__name__
            made: dict[str, Any] = {kind: _ports(leaves[node], namespace)}
        else:
            kind, options = assembly.controls[node]
            children = [described(child) for child in node.children]
            made = _control(kind, children) | {k: v for k, v in options.items() if v is not None}
        return made if node.name == kind else made | {"name": node.name}

    return json.dumps(described(root), indent=1) + "\n"


def _ports(leaf: Leaf, namespace: str) -> Mapping[str, Any]:
    """A port's value, or its key, by a name that no other subtree has."""
    keys = {
        port: "$" + key.removeprefix(f"{namespace}/").replace("/", "_")
        for port, key in leaf.keys.items()
    }
    values = {
        port: f"${value}" if isinstance(value, str) and value.startswith("$") else value
        for port, value in leaf.inputs.items()
    }
    return {**keys, **values}


def _control(kind: str, children: list[dict[str, Any]]) -> dict[str, Any]:
    if KINDS[kind].many:
        return {kind: children}
    return dict(zip((kind, KINDS[kind].condition), children, strict=False))
