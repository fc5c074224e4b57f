"""The run loop: one thread ticks, stops and edits a tree; everybody else posts and wakes it."""

import logging
from collections.abc import Callable
from typing import NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from hardware import Arm, CancelTimeout, Clock
from logs import Feedback, NodeStatus, Record
from skills import Skill

from .building.builder import Tree
from .goal import Goal

logger = logging.getLogger(__name__)

# What is asked to stop has this long to say that it has.
CANCEL_DEADLINE = 0.25  # [s]


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
        goal: For which goal, with its mailbox.
        tree: What to run.
        arm: What to stop.
        clock: Whose time.
        tell: Handed every change of the tree and of the progress.
    """

    def __init__(
        self, goal: Goal, tree: Tree, arm: Arm, clock: Clock, tell: Callable[[Record], None]
    ) -> None:
        self._goal, self._tree, self._arm = goal, tree, arm
        self._clock, self._mailbox, self._tell = clock, goal.mailbox, tell
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
            if mailbox.stopping:
                break
            root.tick_once()
            self._show()
        if root.status is not Status.SUCCESS and mailbox.stopping:  # which may have made it fail
            self._interrupt()
        self._settle()
        if root.status is Status.SUCCESS:
            now, name = self._clock.now(), root.name
            self._tell(Feedback(now, self._goal.identity, 100, "succeeded", name))
            return True
        if mailbox.fault:
            raise mailbox.fault
        return False

    def _interrupt(self) -> None:
        """Stop the tree and the arm."""
        self._tree.root.stop(Status.INVALID)
        self._arm.stop()
        self._show()

    def _settle(self) -> None:
        """Wait until all that the tree began has ended; what is left may not disturb what follows.

        Raises:
            CancelTimeout: It did not in time, and the arm was taken out of *active*.
        """
        deadline = CANCEL_DEADLINE + self._arm.robot.brake
        if not self._mailbox.wait_until(self._settled, deadline):
            busy = ", ".join(skill.name for skill in self._tree.skills if skill.busy)
            late = CancelTimeout(f"{busy} did not stop within {deadline * 1000:.0f} ms")
            self._arm.fault(late)
            raise late

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
