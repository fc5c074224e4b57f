"""Reachability: finds nodes that are never reached, never end, or always time out.

The possible outcomes of a node follow from those of its children, by the rules of its kind. The
kind also reports wrong combinations of children.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour

from hardware.spelling import there_are
from trees.compile.compiler import CompiledTree
from trees.compile.leaf import Leaf
from trees.compile.port_types import known_skills
from trees.errors import Correction, Mistake, Place
from trees.nodes.kind import Node, PossibleOutcomes
from trees.reading.foreign_loops import EXAMPLES
from trees.reading.lines import added_below

_ROOM = 1.5  # ratio of the suggested time to the least time


@dataclass
class _Times:
    """Times of skills that the analysis assumes.

    Attributes:
        of: Times by skill [s]. The analysis uses `Skill.min_duration` if it is longer.
        start: Name of the pose from which the motions are planned; empty for least times.
        notes: Receives a note for each child whose planned time is too long.
    """

    of: Mapping[Behaviour, float] = field(default_factory=dict)
    start: str = ""
    notes: list[Mistake] = field(default_factory=list)


def check_outcomes(tree: CompiledTree, times: Mapping[Behaviour, float] | None = None) -> None:
    """Report control nodes with wrong children, and nodes that are never reached or never end.

    Args:
        tree: The tree.
        times: Least times by skill [s]. The analysis uses `Skill.min_duration` if it is longer.
    """
    root = _Node(tree, tree.root, _Times(times or {}), False)
    endless = [node for node in root.inside() if node.is_endless()]
    if not _outcomes(root).succeeds and endless and not tree.mistakes.found:
        tree.mistakes.notes.append(endless[0].without_limit())


def slow_children(
    tree: CompiledTree, times: Mapping[Behaviour, float], start: str
) -> Sequence[Mistake]:
    """Return a note for each timeout that is shorter than the planned time of its child.

    Args:
        tree: The tree.
        times: Planned times by skill [s]. The analysis uses `Skill.min_duration` if it is longer.
        start: Name of the pose from which the motions are planned.
    """
    planned = _Times(times, start)
    _outcomes(_Node(tree, tree.root, planned, False))
    return planned.notes


def _outcomes(node: "_Node") -> PossibleOutcomes:
    """Return the possible outcomes of a node. Report mistakes of the node and nodes below it."""
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
    shortest = max(tree.hooks.min_duration(leaf), node.times.of.get(behaviour, 0.0))
    if behaviour in tree.hooks.doubtful:
        return PossibleOutcomes()
    return PossibleOutcomes(leaf.skill.may_succeed, leaf.skill.may_fail, shortest)


def _check_condition(node: "_Node") -> None:
    if name := node.action():
        there = [name for name, kind in known_skills().items() if kind.condition]
        what = name if node.name == name else f"{node.name} (with {name})"
        node.wrong(f"{what} acts, and cannot be a condition; {there_are(name, there)}")


def _longer(place: Place, option: str, shortest: float) -> Correction | None:
    """Return the line with a longer, sufficient time; None if the line has no number."""
    line = place.lines[place.line - 1] if 0 < place.line <= len(place.lines) else ""
    written = re.compile(rf"({option}: *)[0-9.]+( *[a-z]+)?").match(line, place.column - 1)
    if not written or not math.isfinite(shortest):
        return None
    return place.replaced(written[0], f"{written[1]}{math.ceil(_ROOM * shortest)} s")


class _Node:
    """Implements `trees.nodes.kind.Node` for one node of a compiled tree.

    Args:
        tree: The tree.
        behaviour: The node.
        times: Times of skills.
        halted: True if a node above may halt this node before it ends.
        used: True to report mistakes of the root of a subtree at the use of the subtree.
    """

    def __init__(
        self,
        tree: CompiledTree,
        behaviour: Behaviour,
        times: _Times,
        halted: bool,
        used: bool = False,
    ) -> None:
        self.tree, self.behaviour, self.times, self.halted = tree, behaviour, times, halted
        self.control = tree.controls.get(behaviour)
        # The root has the name of the task.
        root = behaviour is tree.root and self.control is not None
        self.name = self.control.kind.name if root and self.control else behaviour.name
        self.options = self.control.options if self.control else {}
        place = tree.calls.get(behaviour) if used else None
        self._place = place or tree.places[behaviour]

    def below(self) -> Sequence["_Node"]:
        children = self.behaviour.children
        return [_Node(self.tree, child, self.times, self.halted, True) for child in children]

    def moves(self) -> bool:
        return any(leaf.skill.moves for leaf in self._leaves())

    def action(self) -> str:
        acting = (leaf.skill for leaf in self._leaves() if not leaf.skill.condition)
        return next((skill.name for skill in acting), "")

    def lasting(self) -> Iterator[Node]:
        for below in self.behaviour.iterate():
            control = self.tree.controls.get(below)
            if control and control.kind.lasts(control.options):
                yield _Node(self.tree, below, self.times, self.halted)

    def is_constant(self) -> bool:
        leaves = list(self._leaves())
        return bool(leaves) and all(
            leaf.skill.pure and self.tree.stand_ins >= set(leaf.keys.values()) for leaf in leaves
        )

    def child(self, number: int, halted: bool) -> PossibleOutcomes:
        return _outcomes(_Node(self.tree, self.behaviour.children[number], self.times, halted))

    def children(self, halted: bool) -> list[PossibleOutcomes]:
        return [self.child(number, halted) for number in range(len(self.behaviour.children))]

    def check_reached(self, continues: Sequence[bool], how: str) -> None:
        children = self.below()
        for child, on, following in zip(children, continues, children[1:], strict=False):
            if not on:
                why = f"{following.name} is never reached: {child.name} before it never {how}"
                right = None
                if child.is_endless():
                    limit, right = child.limit, child.with_option(child.limit)
                    why += f", because without {limit} it runs until its child fails"
                following.report(why, right)

    def inside(self) -> Iterator["_Node"]:
        """Yield the node, and all nodes below it."""
        for each in self.behaviour.iterate():
            yield _Node(self.tree, each, self.times, self.halted)

    @property
    def limit(self) -> str:
        """Option that limits the rounds of the node, such as `times`; empty if there is none."""
        return self.control.kind.limit if self.control else ""

    def is_endless(self) -> bool:
        """Return True if the node is a loop without a limit of its rounds."""
        return bool(self.limit) and self.options[self.limit] is None

    def without_limit(self) -> Mistake:
        """Return the note of a loop without a limit, in a task that cannot succeed."""
        why = f"without {self.limit}, {self.name} runs until its child fails: "
        why += "the task never succeeds"
        return Mistake(self._place, why, self.with_option(self.limit))

    def with_option(self, option: str) -> Correction | None:
        """Return the line that adds an option to the node."""
        kind = self.control.kind if self.control else None
        value = EXAMPLES.get(kind.options[option].type, "…") if kind else ""
        return added_below(self.tree.places[self.behaviour], f"{option}: {value}")

    def wrong(self, message: str, option: str = "", missing: str = "", kind: str = "") -> None:
        right = self.with_option(missing) if missing else None
        if kind and self.control:
            right = self.tree.places[self.behaviour].replaced(self.control.kind.name, kind)
        self.report(message, right, option)

    def report(self, message: str, instead: Correction | None, option: str = "") -> None:
        """Report a mistake with the correct lines."""
        if not self.times.start:  # with planned times, the mistake was reported before
            self.tree.mistakes.found.append(Mistake(self._place_of(option), message, instead))

    def too_slow(self, option: str, shortest: float) -> None:
        place, start = self._place_of(option), self.times.start
        fails = f"{self.name} {'' if start else 'always '}fails after {self.options[option]:g} s"
        takes = (
            f"as planned from the {start}, its child takes" if start else "its child takes at least"
        )
        advice = f"; write a time above {math.ceil(100 * shortest) / 100:g} s"
        message = f"{fails}; {takes} {shortest:.3g} s{advice if math.isfinite(shortest) else ''}"
        found = self.times.notes if start else self.tree.mistakes.found
        found.append(Mistake(place, message, _longer(place, option, shortest)))

    def _place_of(self, option: str) -> Place:
        places = self.control.places if self.control else {}
        return places.get(option, self._place)

    def _leaves(self) -> Iterator[Leaf]:
        below = self.behaviour.iterate()
        return (self.tree.leaves[each] for each in below if each in self.tree.leaves)
