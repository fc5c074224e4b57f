"""Guard: a node that runs only while a condition holds."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from skills import Context
from trees.declarations import Declaration

from .kind import ControlNodeKind, Element, Node, Options, PossibleOutcomes, duration
from .loops import busy


class Guard(Composite):
    """Runs its first child while its second child, a condition, holds.

    Args:
        name: Name of the node.
        children: The node to run, and the condition.
        context: Source of time and of ticks.
        otherwise: Reaction to a false condition: `pause` to wait until it holds, or `fail`.
        every: Period in which the condition is checked [s].
    """

    def __init__(
        self, name: str, children: list[Behaviour], context: Context, otherwise: str, every: float
    ) -> None:
        super().__init__(name, children)
        self._context, self.pause, self.every = context, otherwise == "pause", every

    def tick(self) -> Iterator[Behaviour]:
        """Check the condition, then run the child."""
        child, condition = self.children
        if self.status is not Status.RUNNING:
            self.initialise()
        yield from condition.tick()
        self.current_child = child
        if condition.status is Status.SUCCESS:
            if child.status is Status.RUNNING or not busy(child):
                yield from child.tick()
            self._end(child.status)
        else:
            if child.status is Status.RUNNING:
                child.stop(Status.INVALID)
            self._end(Status.RUNNING if self.pause else Status.FAILURE)
        yield self

    def _end(self, status: Status) -> None:
        if status in (Status.SUCCESS, Status.FAILURE):
            self.stop(status)
            return
        self.status = Status.RUNNING
        self._context.wake_at(self._context.now() + self.every)


class GuardKind(ControlNodeKind):
    """Runs its child while a condition holds."""

    name = "guard"
    options = {
        "otherwise": Declaration(
            "text",
            default="fail",
            choices=("fail", "pause"),
            description="fail: halt the child and fail; pause: halt it, and restart it when "
            "the condition holds again",
        ),
        "every": duration("period of the checks", 0.1, least=0.01),
    }
    condition = "while"
    synonyms = ("when",)
    keywords = {
        "do": "there is no do: a guard runs its node while a condition holds; write guard:, not do:"
    }
    may_halt = True
    node = Guard

    def lasts(self, options: Options) -> bool:
        """Return True if the node may take several ticks."""
        return _pauses(options)

    def check(self, node: Node) -> None:
        """Report a condition that may take several ticks."""
        for below in node.below()[1].lasting():
            below.wrong(
                f"{below.name} may take several ticks, but the condition of while must end in one "
                "tick. The guard already repeats the check"
            )

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes of the node."""
        pauses, condition = _pauses(node.options), node.child(1, halted=False)
        child = node.child(0, node.halted or (condition.fails and not pauses))
        return PossibleOutcomes(child.succeeds, child.fails or not pauses, child.shortest)

    def groot(self, options: Options) -> list[Element]:
        """Return the nodes of BehaviorTree.CPP. A retried sequence waits like a guard."""
        description = {"_description": f"checked every {options['every']:g} s"}
        if _pauses(options):
            attributes = {"num_attempts": "-1", **description}
            return [("RetryUntilSuccessful", attributes), ("ReactiveSequence", {})]
        return [("ReactiveSequence", description)]


def _pauses(options: Options) -> bool:
    return bool(options["otherwise"] == "pause")
