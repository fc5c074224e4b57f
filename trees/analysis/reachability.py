"""What can become of a tree, judged before it runs: what is never reached, never ends, never fits.

Every node may succeed, may fail, and takes at least some time; what that is follows from the
nodes below it.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector, Sequence
from py_trees.decorators import FailureIsSuccess, Inverter

from skills import Skill
from trees.errors import Place
from trees.nodes.control import Guard, Repeat, Retry, Timeout, WaitFor
from trees.nodes.parallel import Join, Race
from trees.reading.node_parser import Mistakes


@dataclass(frozen=True, slots=True)
class PossibleOutcomes:
    """What can become of a node.

    Attributes:
        succeeds: Whether it may.
        fails: Whether it may.
        shortest: How long a success takes at least [s].
    """

    succeeds: bool = True
    fails: bool = True
    shortest: float = 0.0


@dataclass(frozen=True, slots=True)
class Places:
    """Where nodes stand.

    Attributes:
        own: By node.
        calls: Of the roots of subtrees, where these are asked for.
    """

    own: Mapping[Behaviour, Place]
    calls: Mapping[Behaviour, Place]


def check_flow(
    root: Behaviour,
    shortest: Mapping[Skill, float],
    places: Places,
    doubtful: Collection[Behaviour],
    mistakes: Mistakes,
) -> None:
    """Find what cannot be meant.

    Args:
        root: Of the tree.
        shortest: How long each skill takes at least [s].
        places: Where the nodes stand.
        doubtful: Nodes of which anything may become, as what they do is not known.
        mistakes: Told what is wrong.
    """
    _Judge(shortest, places, doubtful, mistakes).fate(root, False)


class _Judge:
    def __init__(
        self,
        shortest: Mapping[Skill, float],
        places: Places,
        doubtful: Collection[Behaviour],
        mistakes: Mistakes,
    ) -> None:
        self._shortest, self._places, self._mistakes = shortest, places, mistakes
        self._doubtful = doubtful

    def fate(self, node: Behaviour, ended: bool) -> PossibleOutcomes:
        """What can become of a node; `ended` says whether something above may halt it."""
        if node in self._doubtful:
            ends = isinstance(node, Guard | Join | Timeout)  # perhaps what it holds
            for child in node.children:
                self.fate(child, ended or ends)
            return PossibleOutcomes()
        match node:
            case Skill():
                least = self._shortest.get(node, 0.0)
                return PossibleOutcomes(node.may_succeed, node.may_fail, least)
            case Sequence():
                return self._sequence(node, ended)
            case Selector():
                return self._selector(node, ended)
            case Join():
                return self._parallel(node, ended)
            case Guard():
                return self._guard(node, ended)
        (child,) = node.children
        return self._decorated(node, child, ended)

    def _sequence(self, node: Sequence, ended: bool) -> PossibleOutcomes:
        fates = [self.fate(child, ended) for child in node.children]
        self._reached(node, [fate.succeeds for fate in fates], "succeeds")
        return PossibleOutcomes(
            all(fate.succeeds for fate in fates),
            any(fate.fails for fate in fates),
            sum(fate.shortest for fate in fates),
        )

    def _selector(self, node: Selector, ended: bool) -> PossibleOutcomes:
        fates = [self.fate(child, ended) for child in node.children]
        self._reached(node, [fate.fails for fate in fates], "fails")
        return PossibleOutcomes(
            any(fate.succeeds for fate in fates),
            all(fate.fails for fate in fates),
            min(fate.shortest for fate in fates),
        )

    def _parallel(self, node: Join, ended: bool) -> PossibleOutcomes:
        race = isinstance(node, Race)
        # Who may end a race is judged without it first, so that two endless nodes do not vouch
        # for each other.
        fates = [
            self.fate(child, ended or (race and len(node.children) > 1)) for child in node.children
        ]
        if race:
            if not ended and not any(fate.succeeds for fate in fates):
                self._wrong(node, "never ends: no node of it can succeed")
            return PossibleOutcomes(
                any(fate.succeeds for fate in fates),
                all(fate.fails for fate in fates),
                min(fate.shortest for fate in fates),
            )
        return PossibleOutcomes(
            all(fate.succeeds for fate in fates),
            any(fate.fails for fate in fates),
            max(fate.shortest for fate in fates),
        )

    def _guard(self, node: Guard, ended: bool) -> PossibleOutcomes:
        child, condition = node.children
        asked = self.fate(condition, False)
        fate = self.fate(child, ended or (asked.fails and not node.pause))
        return PossibleOutcomes(fate.succeeds, fate.fails or not node.pause, fate.shortest)

    def _decorated(self, node: Behaviour, child: Behaviour, ended: bool) -> PossibleOutcomes:
        fate = self.fate(child, ended or isinstance(node, Timeout))
        match node:
            case Timeout():
                if fate.shortest >= node.after:
                    least = f"what it holds takes {fate.shortest:g} s at least"
                    self._wrong(node, f"always fails after {node.after:g} s; {least}")
                return PossibleOutcomes(fate.succeeds, True, fate.shortest)
            case Repeat():
                return self._repeat(node, fate, ended)
            case Retry():
                if not fate.fails:
                    self._wrong(node, "has nothing to retry: what it holds never fails")
                return fate
            case WaitFor():
                if not fate.succeeds:
                    self._wrong(node, "never ends: what it waits for never holds")
                return PossibleOutcomes(fate.succeeds, False, fate.shortest)
            case Inverter():
                return PossibleOutcomes(fate.fails, fate.succeeds, 0.0)
            case FailureIsSuccess():
                return PossibleOutcomes(True, False, 0.0 if fate.fails else fate.shortest)
        return fate

    def _repeat(self, node: Repeat, fate: PossibleOutcomes, ended: bool) -> PossibleOutcomes:
        if not fate.succeeds:
            self._wrong(node, "has nothing to repeat: what it holds never succeeds")
        if node.times is not None:
            return PossibleOutcomes(fate.succeeds, fate.fails, fate.shortest * node.times)
        if not fate.fails and not ended:
            self._wrong(
                node,
                "never ends: nothing in it can fail; say times, or put it into a timeout or into a "
                "parallel with policy any",
            )
        return PossibleOutcomes(False, fate.fails, 0.0)

    def _reached(self, node: Behaviour, goes_on: list[bool], how: str) -> None:
        """See that what stands after a child can be reached."""
        for child, on, following in zip(node.children, goes_on, node.children[1:], strict=False):
            if not on:
                place = self._places.calls.get(following, self._places.own[following])
                why = f"is never reached: {child.name} before it never {how}"
                self._mistakes.add_also(place, f"{following.name} {why}")

    def _wrong(self, node: Behaviour, message: str) -> None:
        self._mistakes.add_also(self._places.own[node], f"{node.name} {message}")
