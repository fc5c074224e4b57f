"""The run loop: one thread ticks, stops and edits a tree; everybody else posts and wakes it."""

import logging
import math
from collections.abc import Callable
from typing import NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from hardware import Arm, CancelTimeout, Clock
from logs import Feedback, NodeStatus, Record
from skills import Skill

from .building.builder import Tree
from .goal import Goal, GoalState

logger = logging.getLogger(__name__)

# What is asked to stop has this long to say that it has.
CANCEL_DEADLINE = 0.25  # [s]


class Mailbox:
    """What others want of the owner thread; posting wakes it.

    Args:
        clock: Whose time.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._signal = clock.signal()
        self._woken = self._canceled = False
        self._fault: Exception | None = None
        self._deadline = math.inf

    def wake_at(self, time: float) -> None:
        """Ask for a tick at a time [s]; from the owner thread, and anew at each tick."""
        self._deadline = min(self._deadline, time)

    def wake(self) -> None:
        """Ask for a tick."""
        with self._signal:
            self._woken = True
            self._signal.notify()

    def cancel(self) -> None:
        """Ask to cancel."""
        with self._signal:
            self._canceled = True
            self._signal.notify()

    def fail(self, error: Exception) -> None:
        """Say that something outside the tree failed; the first cause counts."""
        with self._signal:
            self._fault = self._fault or error
            self._signal.notify()

    @property
    def canceled(self) -> bool:
        """Whether a cancel was asked for."""
        return self._canceled

    @property
    def fault(self) -> Exception | None:
        """What failed outside the tree."""
        return self._fault

    def wait(self) -> None:
        """Wait until somebody posts, or the earliest time that was asked for has come."""
        with self._signal:
            while not (self._woken or self._canceled or self._fault or self._due):
                self._signal.wait(None if self._deadline == math.inf else self._deadline)
            self._woken = False
            if self._due:
                self._deadline = math.inf

    @property
    def _due(self) -> bool:
        return self._clock.now() >= self._deadline

    def wait_until(self, settled: Callable[[], bool], seconds: float) -> bool:
        """Wait until something is so; False when it took longer than that [s]."""
        until = self._clock.now() + seconds
        with self._signal:
            while not settled() and self._clock.now() < until:
                self._signal.wait(until)
            return settled()


class _Reached(NamedTuple):
    """How far a run is, as it was last told."""

    percentage: int
    phase: str
    node: str


class _Shown:
    """A node, and the status that was told of it last."""

    __slots__ = ("node", "path", "status")

    def __init__(self, node: Behaviour, path: str) -> None:
        self.node, self.path = node, path
        self.status: Status | None = None


class Run:
    """One tree, run once.

    Args:
        goal: For which goal.
        tree: What to run.
        arm: What to stop.
        clock: Whose time.
        mailbox: What others want.
        tell: Handed every change of the tree and of the progress.
    """

    def __init__(
        self,
        goal: Goal,
        tree: Tree,
        arm: Arm,
        clock: Clock,
        mailbox: Mailbox,
        tell: Callable[[Record], None],
    ) -> None:
        self._goal, self._tree, self._arm = goal, tree, arm
        self._clock, self._mailbox, self._tell = clock, mailbox, tell
        self._shown = [_Shown(node, path) for node, path in _paths(tree.root, "")]
        # Those that measure how far they are, whether or not they have begun.
        self._moving = [s for s in tree.skills if type(s).progress is not Skill.progress]
        self._reached = _Reached(0, "", "")

    def execute(self) -> bool:
        """Tick until the tree has ended, was canceled, or something failed.

        Returns:
            Whether the tree succeeded.

        Raises:
            Exception: What failed outside the tree.
            CancelTimeout: A skill did not acknowledge the cancel in time.
        """
        self._goal.enter(GoalState.EXECUTING)
        self._show()
        self._mailbox.wake()
        try:
            return self._tick_on()
        finally:
            self._tree.halt()  # an exception goes through the nodes above without ending any

    def _tick_on(self) -> bool:
        root, mailbox = self._tree.root, self._mailbox
        while root.status in (Status.INVALID, Status.RUNNING):
            mailbox.wait()
            if mailbox.canceled or mailbox.fault:
                break
            root.tick_once()
            self._show()
        if root.status is Status.SUCCESS:
            now, name = self._clock.now(), root.name
            self._tell(Feedback(now, self._goal.identity, 100, "succeeded", name))
            return True
        if mailbox.canceled or mailbox.fault:  # also where a stop made the tree fail
            self._interrupt()
        return False

    def _interrupt(self) -> None:
        """Stop the tree and the arm, and wait until all that it began has acknowledged."""
        if self._mailbox.canceled:
            self._goal.enter(GoalState.CANCELING)
        self._tree.root.stop(Status.INVALID)
        self._arm.stop()
        self._show()
        deadline = CANCEL_DEADLINE + self._arm.robot.brake
        if not self._mailbox.wait_until(self._settled, deadline):
            busy = ", ".join(skill.name for skill in self._tree.skills if skill.busy)
            late = CancelTimeout(f"{busy} did not stop within {deadline * 1000:.0f} ms")
            self._arm.fault(late)
            raise late
        if self._mailbox.fault:
            raise self._mailbox.fault

    def _settled(self) -> bool:
        return not any(skill.busy for skill in self._tree.skills)

    def _show(self) -> None:
        """Tell what has changed since the last tick."""
        now = self._clock.now()
        for shown in self._shown:
            node = shown.node
            if node.status is shown.status:
                continue
            # py_trees invalidates finished nodes too; what they did stays true.
            ended = shown.status is Status.SUCCESS or shown.status is Status.FAILURE
            if node.status is Status.INVALID and ended:
                continue
            shown.status = node.status
            status, message = node.status.name, node.feedback_message
            self._tell(NodeStatus(now, shown.path, node.name, status, message))
        self._show_progress(now)

    def _show_progress(self, now: float) -> None:
        skills = reversed(self._tree.skills)
        running = next((skill for skill in skills if skill.status is Status.RUNNING), None)
        if running is None:
            return
        shares = [skill.progress for skill in self._moving]
        done = sum(share or 0.0 for share in shares) / len(shares) if shares else 0.0
        # 100 belongs to success alone, and what was reached is never taken back.
        percentage = max(self._reached.percentage, min(99, int(100 * done)))
        phase = "planning" if all(share is None for share in shares) else "executing"
        reached = _Reached(percentage, phase, running.name)
        if reached != self._reached:
            self._reached = reached
            self._tell(Feedback(now, self._goal.identity, *reached))


def _paths(node: Behaviour, above: str) -> list[tuple[Behaviour, str]]:
    """Every node with its path of names; a name that a sibling has too gets a number."""
    path = f"{above}/{node.name}" if above else node.name
    paths, seen = [(node, path)], set()
    for number, child in enumerate(node.children):
        below = _paths(child, path)
        if child.name in seen:
            below = [(n, f"{path}/{number}:{p.removeprefix(path + '/')}") for n, p in below]
        seen.add(child.name)
        paths += below
    return paths
