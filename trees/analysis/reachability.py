"""Reachability: finds nodes that are never reached, never end, or always time out.

How a node can end follows from how its children can end; each kind of node says how.
"""

from collections.abc import Mapping, Sequence

from py_trees.behaviour import Behaviour

from trees.compile.compiler import CompiledTree
from trees.nodes.kind import PossibleOutcomes


def check_outcomes(tree: CompiledTree, least: Mapping[Behaviour, float] | None = None) -> None:
    """Report nodes of a tree that are never reached, never end, or always time out.

    Args:
        tree: The tree.
        least: Least times of skills [s], in addition to what they say themselves.
    """
    _outcomes(tree, tree.root, least or {}, halted=False)


def _outcomes(
    tree: CompiledTree, node: Behaviour, least: Mapping[Behaviour, float], halted: bool
) -> PossibleOutcomes:
    """Return the possible outcomes of a node.

    Args:
        tree: The tree.
        node: A node of the tree.
        least: Least times of skills [s].
        halted: Whether a node above may halt it before it ends.
    """
    control = tree.controls.get(node)
    if control and node not in tree.hooks.doubtful:
        return control.kind.possible_outcomes(_Node(tree, node, least, halted))
    if control:
        for child in node.children:
            _outcomes(tree, child, least, halted or control.kind.may_halt)
    if node in tree.hooks.doubtful:
        return PossibleOutcomes()
    leaf = tree.leaves[node]
    shortest = max(tree.hooks.min_duration(leaf), least.get(node, 0.0))
    if node in tree.hooks.doubtful:
        return PossibleOutcomes()
    return PossibleOutcomes(leaf.skill.may_succeed, leaf.skill.may_fail, shortest)


class _Node:
    """A node, with the interface `trees.nodes.kind.Outcomes` that its kind uses."""

    def __init__(
        self, tree: CompiledTree, node: Behaviour, least: Mapping[Behaviour, float], halted: bool
    ) -> None:
        self._tree, self._node, self._least = tree, node, least
        self.options, self.halted = tree.controls[node].options, halted
        self.count = len(node.children)

    def child(self, number: int, halted: bool) -> PossibleOutcomes:
        """Return the possible outcomes of a child."""
        return _outcomes(self._tree, self._node.children[number], self._least, halted)

    def children(self, halted: bool) -> list[PossibleOutcomes]:
        """Return the possible outcomes of all children."""
        return [self.child(number, halted) for number in range(self.count)]

    def check_reached(self, continues: Sequence[bool], how: str) -> None:
        """Report children that are never reached."""
        children = self._node.children
        for child, on, following in zip(children, continues, children[1:], strict=False):
            if not on:
                place = self._tree.calls.get(following, self._tree.places[following])
                why = f"is never reached: {child.name} before it never {how}"
                self._tree.mistakes.add_also(place, f"{following.name} {why}")

    def wrong(self, message: str) -> None:
        """Report a mistake of the node."""
        place = self._tree.places[self._node]
        self._tree.mistakes.add_also(place, f"{self._node.name} {message}")
