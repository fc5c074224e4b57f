"""A node whose kind is not known because the file is wrong. It is analysed, and never run."""

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from skills import Context

from .kind import ControlNodeKind, Element, Flow, Options, Outcomes, PossibleOutcomes


class UnknownKind(ControlNodeKind, register=False):
    """May do anything with its children."""

    name = "?"
    description = ""
    many = True
    may_halt = True

    def make(
        self, name: str, children: list[Behaviour], options: Options, context: Context
    ) -> Behaviour:
        """Return a node."""
        return Sequence(name, memory=True, children=children)

    def flow(self, options: Options) -> Flow:
        """Return how its children follow each other."""
        return Flow.UNKNOWN

    def possible_outcomes(self, node: Outcomes) -> PossibleOutcomes:
        """Return how it can end."""
        node.children(halted=True)
        return PossibleOutcomes()

    def groot(self, options: Options) -> list[Element]:
        """Return the node of BehaviorTree.CPP."""
        return [("Sequence", {})]
