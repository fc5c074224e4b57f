"""A task as it was run: one tree, every subtree in its place, every value filled in."""

import json
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from skills import Skill

from .builder import Tree

RESOLVED = "task.resolved.yaml"


def resolved(tree: Tree) -> str:
    """The tree as YAML, in the part of YAML that is JSON too."""
    return json.dumps(_node(tree.root, tree), indent=1) + "\n"


def _node(node: Behaviour, tree: Tree) -> dict[str, Any]:
    if isinstance(node, Skill):
        return {type(node).__name__: tree.ports[node]}
    kind = "sequence" if isinstance(node, Sequence) else "parallel"
    return {kind: [_node(child, tree) for child in node.children]}
