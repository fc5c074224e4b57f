"""Timeout, inverter and force_success: nodes that change the result of their child."""

import math
from typing import ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator, FailureIsSuccess, Inverter

from skills import Context, Skill, TookTooLong

from .kind import ControlNodeKind, Element, Flow, Node, Options, PossibleOutcomes, duration


class Timeout(Decorator):
    """Halts its child, and fails, if it takes too long.

    Args:
        name: Name of the node.
        child: Node to run.
        context: Source of time and of ticks.
        after: Longest time that the child may take [s].

    Attributes:
        failure: Error of the last timeout, or None.
    """

    def __init__(self, name: str, child: Behaviour, context: Context, after: float) -> None:
        super().__init__(name, child)
        self._context, self.after, self._until = context, after, 0.0
        self.failure: TookTooLong | None = None

    def initialise(self) -> None:
        """Start the timer."""
        self.failure, self._until = None, self._context.now() + self.after

    def update(self) -> Status:
        """Check the timer, if the child still runs."""
        if self.decorated.status is not Status.RUNNING:
            return self.decorated.status
        if self._context.now() < self._until:
            self._context.wake_at(self._until)
            return Status.RUNNING
        running = (node for node in self.decorated.iterate() if node.status is Status.RUNNING)
        left = [node.call_hook("time_left") for node in running if isinstance(node, Skill)]
        self.failure = TookTooLong(f"{self.name} took longer than {self.after:g} s")
        if any(left):
            self.failure.hint = f"allow more than {math.ceil(self.after + max(left))} s"
        self.feedback_message = str(self.failure)
        return Status.FAILURE


class TimeoutKind(ControlNodeKind):
    """Halts its child, and fails, if it takes too long."""

    name = "timeout"
    options = {"after": duration("longest time that the child may take", least=0.001)}
    placeholders = {"after": math.inf}
    synonyms = ("Timeout", "timeout-minutes", "timeout_minutes", "timeout_seconds", "timeout_ms")
    may_halt = timed = True
    node = Timeout

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes. Report a child that is always slower than the timeout."""
        child = node.child(0, halted=True)
        if child.shortest >= node.options["after"]:
            node.too_slow("after", child.shortest)
        return PossibleOutcomes(child.succeeds, True, child.shortest)

    def groot(self, options: Options) -> list[Element]:
        """Return the node of BehaviorTree.CPP. A time that is not known yet becomes 0: no limit."""
        after = options["after"]
        return [("Timeout", {"msec": str(round(after * 1000) if math.isfinite(after) else 0)})]


class _ResultKind(ControlNodeKind, register=False):
    """A node of py_trees that changes the result of its child.

    Attributes:
        decorator: Class of the node.
    """

    order = Flow.UNCERTAIN
    decorator: ClassVar[type[Decorator]]

    def make(
        self, name: str, children: list[Behaviour], options: Options, context: Context
    ) -> Behaviour:
        """Return a new node."""
        return self.decorator(name, children[0])


class InverterKind(_ResultKind):
    """Fails if its child succeeds, and succeeds if its child fails."""

    name = "inverter"
    decorator = Inverter
    groot_tag = "Inverter"
    synonyms = ("not", "Inverter")

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes of the node."""
        child = node.child(0, node.halted)
        return PossibleOutcomes(child.fails, child.succeeds, 0.0)


class ForceSuccessKind(_ResultKind):
    """Succeeds when its child has ended."""

    name = "force_success"
    decorator = FailureIsSuccess
    groot_tag = "ForceSuccess"
    synonyms = ("ForceSuccess", "ignore_errors", "continue-on-error", "continue_on_error")

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes of the node."""
        child = node.child(0, node.halted)
        return PossibleOutcomes(True, False, 0.0 if child.fails else child.shortest)
