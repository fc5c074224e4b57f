"""Retry, repeat and wait_for: nodes that run their child several times."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from skills import Context, Skill

from .kind import ControlNodeKind, Element, Node, Options, PossibleOutcomes, count, duration

# Least time between two rounds of a loop, so that a loop of instant nodes causes little load [s].
LEAST_ROUND = 0.005


class Loop(Decorator):
    """Restarts its child, after a pause.

    Attributes:
        rounds: Number of rounds that have ended.
    """

    def __init__(self, name: str, child: Behaviour, context: Context) -> None:
        super().__init__(name, child)
        self._context = context
        self._next: float | None = None
        self.rounds = 0

    @property
    def failed_attempts(self) -> int:
        """Number of failed rounds that were repeated."""
        return 0

    def progress(self, share: float | None) -> float | None:
        """Return the progress of the loop.

        Args:
            share: Progress of the child, from 0 to 1; None if unknown.
        """
        # Between two rounds, `share` belongs to the round that has ended.
        return None if self._next is not None else share

    def initialise(self) -> None:
        """Start the first round."""
        self.rounds, self._next = 0, None

    def tick(self) -> Iterator[Behaviour]:
        """Tick the child, unless its next round must wait."""
        if self.status is Status.RUNNING and self._next is not None:
            if self._context.now() < self._next or busy(self.decorated):
                self._wait(self._next)
                yield self
                return
            self._next = None
        yield from super().tick()

    def again(self, pause: float) -> Status:
        """Schedule another round, after a pause [s]. Return RUNNING."""
        self._next = self._context.now() + max(pause, LEAST_ROUND)
        self._wait(self._next)
        return Status.RUNNING

    def _wait(self, until: float) -> None:
        self._context.wake_at(max(until, self._context.now() + LEAST_ROUND))


class Retry(Loop):
    """Runs its child until it succeeds.

    Args:
        name: Name of the node.
        child: Node to run.
        context: Source of time and of ticks.
        attempts: Largest number of attempts.
        backoff: Pause before the second attempt; it doubles each time [s].
    """

    def __init__(
        self, name: str, child: Behaviour, context: Context, attempts: int, backoff: float
    ) -> None:
        super().__init__(name, child, context)
        self.attempts, self.backoff = attempts, backoff

    @property
    def failed_attempts(self) -> int:
        """Number of attempts that have failed."""
        return self.rounds

    def update(self) -> Status:
        """Decide after each attempt if another one follows."""
        if self.decorated.status is not Status.FAILURE:
            return self.decorated.status
        self.rounds += 1
        self.feedback_message = f"{self.rounds} of {self.attempts} attempts failed"
        if self.rounds == self.attempts:
            return Status.FAILURE
        return self.again(self.backoff * 2.0 ** min(self.rounds - 1, 30))


class RetryKind(ControlNodeKind):
    """Runs its child until it succeeds."""

    name = "retry"
    options = {
        "attempts": count("largest number of attempts"),
        "backoff": duration("pause before the second attempt; it doubles each time", 0.0),
    }
    placeholders = {"attempts": 1}
    synonyms = ("RetryUntilSuccessful", "Retry", "retries", "max_retries")
    other_options = {"num_attempts": "attempts", "delay": "backoff"}
    lasting = True
    node = Retry

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes, and report a child that never fails."""
        child = node.child(0, node.halted)
        if not child.fails:
            node.wrong(f"{node.name} has nothing to retry: its child never fails")
        return child

    def groot(self, options: Options) -> list[Element]:
        """Return the node of BehaviorTree.CPP."""
        attributes = {"num_attempts": str(options["attempts"])}
        if backoff := options["backoff"]:
            attributes["_description"] = f"after {backoff:g} s; this time doubles at each attempt"
        return [("RetryUntilSuccessful", attributes)]


class Repeat(Loop):
    """Runs its child until it fails.

    Args:
        name: Name of the node.
        child: Node to run.
        context: Source of time and of ticks.
        times: Number of rounds; None for no limit.
    """

    def __init__(self, name: str, child: Behaviour, context: Context, times: int | None) -> None:
        super().__init__(name, child, context)
        self.times = times

    def progress(self, share: float | None) -> float | None:
        """Return the progress of all rounds."""
        share = super().progress(share)
        if self.times and (self.rounds or share is not None):
            return (self.rounds + (share or 0.0)) / self.times
        return share

    def update(self) -> Status:
        """Decide after a round if another one follows."""
        if self.decorated.status is not Status.SUCCESS:
            return self.decorated.status
        self.rounds += 1
        self.feedback_message = f"{self.rounds} of {self.times}" if self.times else f"{self.rounds}"
        return Status.SUCCESS if self.rounds == self.times else self.again(0.0)


class RepeatKind(ControlNodeKind):
    """Runs its child until it fails."""

    name = "repeat"
    options = {"times": count("number of rounds; no limit without it", optional=True)}
    placeholders = {"times": 1}
    synonyms = ("loop", "for", "for_each", "foreach", "KeepRunningUntilFailure", "Repeat")
    other_options = {"num_cycles": "times"}
    lasting = True
    limit = "times"
    node = Repeat

    def rounds(self, options: Options) -> int | None:
        """Return the number of rounds; None for no limit. Its child succeeds in each round."""
        times: int | None = options["times"]
        return times

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes. Report a loop that never repeats or never ends."""
        child, times = node.child(0, node.halted), node.options["times"]
        if not child.succeeds:
            node.wrong(f"{node.name} has nothing to repeat: its child never succeeds")
        if times is not None:
            return PossibleOutcomes(child.succeeds, child.fails, child.shortest * times)
        if not child.fails and not node.halted:
            node.wrong(
                f"{node.name} never ends: its child cannot fail; give times, or put it into a "
                "timeout or into a parallel with policy any",
                missing=self.limit,
            )
        return PossibleOutcomes(False, child.fails, 0.0)

    def groot(self, options: Options) -> list[Element]:
        """Return the node of BehaviorTree.CPP."""
        return [("Repeat", {"num_cycles": str(options["times"] or -1)})]


class WaitFor(Loop):
    """Checks a condition until it holds.

    Args:
        name: Name of the node.
        child: The condition.
        context: Source of time and of ticks.
        every: Period of the checks [s].
    """

    def __init__(self, name: str, child: Behaviour, context: Context, every: float) -> None:
        super().__init__(name, child, context)
        self.every = every

    def update(self) -> Status:
        """Decide after a check if another one follows."""
        if self.decorated.status is Status.FAILURE:
            return self.again(self.every)
        return self.decorated.status


class WaitForKind(ControlNodeKind):
    """Checks a condition until it holds."""

    name = "wait_for"
    synonyms = ("wait_until", "until")
    options = {"every": duration("period of the checks", 0.1, least=0.01)}
    only_asks = True
    lasting = True
    node = WaitFor

    def check(self, node: Node) -> None:
        """Report a condition that cannot change."""
        (condition,) = node.below()
        if condition.is_constant():
            condition.wrong(
                "wait_for has nothing to wait for: its condition is known before the run"
            )

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes, and report a condition that never holds."""
        child = node.child(0, node.halted)
        if not child.succeeds:
            node.wrong(f"{node.name} never ends: its condition never holds")
        return PossibleOutcomes(child.succeeds, False, child.shortest)

    def groot(self, options: Options) -> list[Element]:
        """Return the node of BehaviorTree.CPP."""
        description = f"checked every {options['every']:g} s"
        return [("RetryUntilSuccessful", {"num_attempts": "-1", "_description": description})]


def loops_in(root: Behaviour) -> Iterator[Loop]:
    """Yield the loops in a tree."""
    return (node for node in root.iterate() if isinstance(node, Loop))


def share_of_rounds(node: Behaviour, share: float | None) -> float | None:
    """Return the progress of a node, with all rounds of the loops above the node.

    Args:
        node: The node.
        share: Progress of the node in this round, from 0 to 1; None if it is unknown.
    """
    above = node.parent
    while above is not None:
        share = above.progress(share) if isinstance(above, Loop) else share
        above = above.parent
    return share


def busy(node: Behaviour) -> bool:
    """Return True while work of a node continues, even after the node was halted."""
    return any(isinstance(below, Skill) and below.call_hook("busy") for below in node.iterate())
