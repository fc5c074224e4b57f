"""Parallel: children that run at the same time."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from skills import Context
from trees.declarations import Declaration

from .kind import ControlNodeKind, Element, Flow, Node, Options, PossibleOutcomes, all_of, any_of


class Join(Composite):
    """Ticks its children until all have ended. Fails if any of them failed.

    The Parallel of py_trees fails when its first child fails, and halts the other children. Their
    results would be lost.
    """

    def tick(self) -> Iterator[Behaviour]:
        """Tick the children that still run."""
        if self.status is not Status.RUNNING:
            for child in self.children:
                if child.status is not Status.INVALID:
                    child.stop(Status.INVALID)
            self.initialise()
            unfinished = list(self.children)
        else:
            unfinished = [child for child in self.children if child.status is Status.RUNNING]
        for child in unfinished:
            yield from child.tick()
        self.current_child = self.children[-1] if self.children else None
        self.decide({child.status for child in self.children})
        yield self

    def decide(self, statuses: set[Status]) -> None:
        """Set the status from the statuses of the children."""
        if Status.RUNNING in statuses:
            self.status = Status.RUNNING
        else:
            self.stop(Status.SUCCESS if statuses <= {Status.SUCCESS} else Status.FAILURE)


class Race(Join):
    """Succeeds when a child succeeds, and halts the other children. Fails if all children fail."""

    def decide(self, statuses: set[Status]) -> None:
        """Set the status from the statuses of the children."""
        if Status.SUCCESS in statuses:
            for child in self.children:
                if child.status is Status.RUNNING:
                    child.stop(Status.INVALID)
            self.stop(Status.SUCCESS)
        elif Status.RUNNING in statuses:
            self.status = Status.RUNNING
        else:
            self.stop(Status.FAILURE)


class ParallelKind(ControlNodeKind):
    """Runs its children at the same time."""

    name = "parallel"
    synonyms = ("concurrent", "together")
    other_options = {"success_threshold": "policy"}
    options = {
        "policy": Declaration(
            "text",
            default="all",
            choices=("all", "any"),
            description="all: wait for all children, and fail if any failed; "
            "any: the first success halts the others",
        )
    }
    many = True
    may_halt = True

    def make(
        self, name: str, children: list[Behaviour], options: Options, context: Context
    ) -> Behaviour:
        """Return a new node."""
        return Race(name, children) if options["policy"] == "any" else Join(name, children)

    def label(self, options: Options) -> str:
        """Return the name of the node in drawings."""
        return "parallel, any" if options["policy"] == "any" else "parallel"

    def flow(self, options: Options) -> Flow:
        """Return the order of its children."""
        return Flow.ALTERNATIVES if options["policy"] == "any" else Flow.PARALLEL

    def check(self, node: Node) -> None:
        """Report a mistake if several children move the arm."""
        moves = [child.moves() for child in node.below()]
        if sum(moves) > 1:
            why = "only one node of a parallel may move the arm; put its moves into a sequence"
            node.wrong(why, kind="sequence" if all(moves) else "")

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes, and report a race that no child can win."""
        if node.options["policy"] != "any":
            children = node.children(node.halted)
            return all_of(children, max(each.shortest for each in children))
        # Each child may be halted by another child. Endless children are only a mistake if no child
        # can succeed.
        children = node.children(node.halted or len(node.below()) > 1)
        if not node.halted and not any(each.succeeds for each in children):
            node.wrong(f"{node.name} never ends: none of its nodes can succeed")
        return any_of(children)

    def groot(self, options: Options) -> list[Element]:
        """Return the node of BehaviorTree.CPP."""
        success, failure = ("1", "-1") if options["policy"] == "any" else ("-1", "1")
        return [("Parallel", {"success_count": success, "failure_count": failure})]
