"""Reachability: finds nodes that are never reached, never end, or always time out.

How a node can end follows from how its children can end; each kind of node says how. It also
reports children that do not fit together.
"""

from collections.abc import Iterator, Mapping, Sequence

from py_trees.behaviour import Behaviour

from hardware.suggestions import there_are
from trees.compile.compiler import CompiledTree
from trees.compile.leaf import Leaf
from trees.compile.port_types import known_skills
from trees.nodes.kind import Node, PossibleOutcomes


def check_outcomes(tree: CompiledTree, least: Mapping[Behaviour, float] | None = None) -> None:
    """Report control nodes whose children do not fit, or that are never reached or never end.

    Args:
        tree: The tree.
        least: Least times of skills [s], in addition to what they say themselves.
    """
    _outcomes(_Node(tree, tree.root, least or {}, False))


def _outcomes(node: "_Node") -> PossibleOutcomes:
    """Return the possible outcomes of a node, and report mistakes in it."""
    tree, behaviour = node.tree, node.behaviour
    if control := node.control:
        if control.kind.only_asks or control.kind.condition:
            _check_condition(node.below()[-1])
        control.kind.check(node)
        if behaviour not in tree.hooks.doubtful:
            return control.kind.possible_outcomes(node)
        node.children(node.halted or control.kind.may_halt)
    if behaviour in tree.hooks.doubtful:
        return PossibleOutcomes()
    leaf = tree.leaves[behaviour]
    shortest = max(tree.hooks.min_duration(leaf), node.least.get(behaviour, 0.0))
    if behaviour in tree.hooks.doubtful:
        return PossibleOutcomes()
    return PossibleOutcomes(leaf.skill.may_succeed, leaf.skill.may_fail, shortest)


def _check_condition(node: "_Node") -> None:
    if name := node.action():
        there = [name for name, kind in known_skills().items() if kind.condition]
        what = name if node.name == name else f"{node.name} (with {name})"
        node.wrong(f"{what} acts, and cannot be a condition; {there_are(name, there)}")


class _Node:
    """A node, with the interface `trees.nodes.kind.Node` that its kind uses.

    Args:
        tree: The tree.
        behaviour: The node.
        least: Least times of skills [s].
        halted: Whether a node above may halt it before it ends.
        used: Whether its place is that of its use, if it is the root of a subtree.
    """

    def __init__(
        self,
        tree: CompiledTree,
        behaviour: Behaviour,
        least: Mapping[Behaviour, float],
        halted: bool,
        used: bool = False,
    ) -> None:
        self.tree, self.behaviour, self.least, self.halted = tree, behaviour, least, halted
        self.name, self.control = behaviour.name, tree.controls.get(behaviour)
        self.options = self.control.options if self.control else {}
        place = tree.calls.get(behaviour) if used else None
        self._place = place or tree.places[behaviour]

    def below(self) -> Sequence["_Node"]:
        """Return its children."""
        children = self.behaviour.children
        return [_Node(self.tree, child, self.least, self.halted, True) for child in children]

    def moves(self) -> bool:
        """Return whether a skill in it moves the arm."""
        return any(leaf.skill.moves for leaf in self._leaves())

    def action(self) -> str:
        """Return the name of the first skill in it that is not a condition, or ""."""
        acting = (leaf.skill for leaf in self._leaves() if not leaf.skill.condition)
        return next((skill.name for skill in acting), "")

    def lasting(self) -> Iterator[Node]:
        """Return the nodes in it that may take longer than one tick."""
        for below in self.behaviour.iterate():
            control = self.tree.controls.get(below)
            if control and control.kind.lasts(control.options):
                yield _Node(self.tree, below, self.least, self.halted)

    def is_constant(self) -> bool:
        """Return whether its result depends only on values that are known before the run."""
        leaves = list(self._leaves())
        return bool(leaves) and all(
            leaf.skill.pure and self.tree.stand_ins >= set(leaf.keys.values()) for leaf in leaves
        )

    def child(self, number: int, halted: bool) -> PossibleOutcomes:
        """Return the possible outcomes of a child."""
        return _outcomes(_Node(self.tree, self.behaviour.children[number], self.least, halted))

    def children(self, halted: bool) -> list[PossibleOutcomes]:
        """Return the possible outcomes of all children."""
        return [self.child(number, halted) for number in range(len(self.behaviour.children))]

    def check_reached(self, continues: Sequence[bool], how: str) -> None:
        """Report children that are never reached."""
        children = self.below()
        for child, on, following in zip(children, continues, children[1:], strict=False):
            if not on:
                why = f"is never reached: {child.name} before it never {how}"
                following.wrong(f"{following.name} {why}")

    def wrong(self, message: str, option: str = "") -> None:
        """Report a mistake of the node, or of one of its options."""
        places = self.control.places if self.control else {}
        self.tree.mistakes.add_also(places.get(option, self._place), message)

    def _leaves(self) -> Iterator[Leaf]:
        below = self.behaviour.iterate()
        return (self.tree.leaves[each] for each in below if each in self.tree.leaves)
