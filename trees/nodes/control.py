"""The nodes between root and skills that py_trees has not, or not on an injected clock."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite, Selector, Sequence
from py_trees.decorators import Decorator

from skills import Context, Skill, TookTooLong

# Rounds of a loop follow each other no faster, so that a loop of instant nodes loads nothing [s].
LEAST_ROUND = 0.005
# How often conditions without memory are asked again while a later node runs [s].
ASK_AGAIN = 0.1


class ReactiveSequence(Sequence):
    """A sequence without memory: what has succeeded is asked again while a later node runs."""

    def __init__(self, name: str, children: list[Behaviour], context: Context) -> None:
        super().__init__(name, memory=False, children=children)
        self._context = context

    def tick(self) -> Iterator[Behaviour]:
        """Tick from the first child on."""
        yield from super().tick()
        _ask_again(self, self._context)


class ReactiveSelector(Selector):
    """A selector without memory: what has failed is asked again while a later node runs."""

    def __init__(self, name: str, children: list[Behaviour], context: Context) -> None:
        super().__init__(name, memory=False, children=children)
        self._context = context

    def tick(self) -> Iterator[Behaviour]:
        """Tick from the first child on."""
        yield from super().tick()
        _ask_again(self, self._context)


def _ask_again(node: Composite, context: Context) -> None:
    if node.status is Status.RUNNING:
        context.wake_at(context.now() + ASK_AGAIN)


class _Loop(Decorator):
    """Begins its child anew, after a pause.

    Attributes:
        rounds: How many have ended.
    """

    def __init__(self, name: str, child: Behaviour, context: Context) -> None:
        super().__init__(name, child)
        self._context = context
        self._next: float | None = None
        self.rounds = 0

    @property
    def between_rounds(self) -> bool:
        """Whether a round has ended and the next one has not begun."""
        return self._next is not None

    def initialise(self) -> None:
        """Begin the first round."""
        self.rounds, self._next = 0, None

    def tick(self) -> Iterator[Behaviour]:
        """Tick the child, unless its next round has still to wait."""
        if self.status is Status.RUNNING and self._next is not None:
            if self._context.now() < self._next or busy(self.decorated):
                self._wait(self._next)
                yield self
                return
            self._next = None
        yield from super().tick()

    def again(self, pause: float) -> Status:
        """Plan another round, after a pause [s]."""
        self._next = self._context.now() + max(pause, LEAST_ROUND)
        self._wait(self._next)
        return Status.RUNNING

    def _wait(self, until: float) -> None:
        self._context.wake_at(max(until, self._context.now() + LEAST_ROUND))


class Retry(_Loop):
    """Tries until the child succeeds.

    Args:
        name: Shown in the tree.
        child: What to try.
        context: Whose clock.
        attempts: How often at most.
        backoff: Pause before the second attempt, which doubles each time [s].
    """

    def __init__(
        self, name: str, child: Behaviour, context: Context, attempts: int, backoff: float
    ) -> None:
        super().__init__(name, child, context)
        self.attempts, self.backoff = attempts, backoff

    def update(self) -> Status:
        """Judge the attempt."""
        if self.decorated.status is not Status.FAILURE:
            return self.decorated.status
        self.rounds += 1
        self.feedback_message = f"{self.rounds} of {self.attempts} attempts failed"
        if self.rounds == self.attempts:
            return Status.FAILURE
        return self.again(self.backoff * 2.0 ** min(self.rounds - 1, 30))


class Repeat(_Loop):
    """Does it again until the child fails.

    Args:
        name: Shown in the tree.
        child: What to do.
        context: Whose clock.
        times: How often; None for ever.
    """

    def __init__(self, name: str, child: Behaviour, context: Context, times: int | None) -> None:
        super().__init__(name, child, context)
        self.times = times

    def update(self) -> Status:
        """Judge the round."""
        if self.decorated.status is not Status.SUCCESS:
            return self.decorated.status
        self.rounds += 1
        self.feedback_message = f"{self.rounds} of {self.times}" if self.times else f"{self.rounds}"
        return Status.SUCCESS if self.rounds == self.times else self.again(0.0)


class WaitFor(_Loop):
    """Asks a condition until it holds.

    Args:
        name: Shown in the tree.
        child: The condition.
        context: Whose clock.
        every: How often [s].
    """

    def __init__(self, name: str, child: Behaviour, context: Context, every: float) -> None:
        super().__init__(name, child, context)
        self.every = every

    def update(self) -> Status:
        """Judge the answer."""
        if self.decorated.status is Status.FAILURE:
            return self.again(self.every)
        return self.decorated.status


class Timeout(Decorator):
    """Halts its child, and fails, when it takes too long.

    Args:
        name: Shown in the tree.
        child: What to do.
        context: Whose clock.
        after: How long it may take [s].

    Attributes:
        failure: What it failed of, if it did.
    """

    def __init__(self, name: str, child: Behaviour, context: Context, after: float) -> None:
        super().__init__(name, child)
        self._context, self.after, self._until = context, after, 0.0
        self.failure: TookTooLong | None = None

    def initialise(self) -> None:
        """Begin to count."""
        self.failure, self._until = None, self._context.now() + self.after

    def update(self) -> Status:
        """Look at the clock, if the child has not ended."""
        if self.decorated.status is not Status.RUNNING:
            return self.decorated.status
        if self._context.now() < self._until:
            self._context.wake_at(self._until)
            return Status.RUNNING
        self.failure = TookTooLong(f"{self.name} took longer than {self.after:g} s")
        self.feedback_message = str(self.failure)
        return Status.FAILURE


class Guard(Composite):
    """Runs its first child as long as its second, a condition, holds.

    Args:
        name: Shown in the tree.
        children: What to do, and the condition.
        context: Whose clock.
        pause: Whether to wait until the condition holds again, rather than to fail.
        every: How often the condition is asked [s].
    """

    def __init__(
        self, name: str, children: list[Behaviour], context: Context, pause: bool, every: float
    ) -> None:
        super().__init__(name, children)
        self._context, self.pause, self.every = context, pause, every

    def tick(self) -> Iterator[Behaviour]:
        """Ask, then do."""
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


def busy(node: Behaviour) -> bool:
    """Whether work goes on that a node began, even after it was halted."""
    return any(isinstance(below, Skill) and below.call_hook("busy") for below in node.iterate())
