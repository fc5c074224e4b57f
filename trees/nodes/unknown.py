"""A node of an unknown kind, in a wrong file. It is analysed, but never run."""

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from skills import Context

from .kind import ControlNodeKind, Flow, Node, Options, PossibleOutcomes


class UnknownKind(ControlNodeKind, register=False):
    """May do anything with its children."""

    name = "?"
    many = True
    may_halt = True
    order = Flow.UNKNOWN
    groot_tag = "Sequence"

    def make(
        self, name: str, children: list[Behaviour], options: Options, context: Context
    ) -> Behaviour:
        """Return a new node."""
        return Sequence(name, memory=True, children=children)

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes of the node."""
        node.children(halted=True)
        return PossibleOutcomes()
