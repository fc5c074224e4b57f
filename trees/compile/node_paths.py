"""Paths of nodes in a tree, made of their names."""

from py_trees.behaviour import Behaviour


def paths(node: Behaviour, above: str = "") -> list[tuple[Behaviour, str]]:
    """Return every node with its path. A repeated name among siblings gets a number."""
    path = f"{above}/{node.name}" if above else node.name
    found, seen = [(node, path)], set()
    for number, child in enumerate(node.children):
        below = paths(child, path)
        if child.name in seen:
            below = [(n, f"{path}/{number}:{p.removeprefix(path + '/')}") for n, p in below]
        seen.add(child.name)
        found += below
    return found
