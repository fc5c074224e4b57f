"""The nodes of a tree as a table: kinds, ports, and places in the files."""

from typing import Any

from trees.compile.compiler import CompiledTree
from trees.compile.node_paths import paths

from .outline import outline


def node_table(tree: CompiledTree) -> list[dict[str, Any]]:
    """Return one JSON object per node, parents first.

    Each object has `path` (its path in the tree), `kind` (name of its kind or skill), `file` and
    `line`, `called_at` (for the root of a subtree, the place that refers to it; else empty), and
    `ports` (values and keys as text, by name).
    """
    found = []
    for (node, path), entry in zip(paths(tree.root), outline(tree).walk(), strict=True):
        place, call = tree.places[node], tree.calls.get(node)
        row = {"path": path, "kind": entry.kind, "file": place.path.name, "line": place.line}
        found.append(
            row | {"called_at": call.file_line if call else "", "ports": dict(entry.ports)}
        )
    return found
