"""The run loop: one thread ticks, stops and edits a tree; everybody else posts and wakes it."""

import logging
from collections.abc import Callable

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from hardware import Arm, Clock, HardwareError
from logs import Feedback, NodeStatus, Record

from .builder import Tree
from .goal import Goal, GoalState

logger = logging.getLogger(__name__)

# What is asked to stop has this long to say that it has.
CANCEL_DEADLINE = 0.25  # [s]


class CancelTimeout(HardwareError):
    """Something that was asked to stop did not in time, so the arm was taken out of *active*."""

    code = "hw.cancel_timeout"


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
        """Wait until somebody posts."""
        with self._signal:
            while not (self._woken or self._canceled or self._fault):
                self._signal.wait(None)
            self._woken = False

    def wait_until(self, settled: Callable[[], bool], seconds: float) -> bool:
        """Wait until something is so; False when it took longer than that [s]."""
        until = self._clock.now() + seconds
        with self._signal:
            while not settled() and self._clock.now() < until:
                self._signal.wait(until)
            return settled()


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
        self._paths = dict(_paths(tree.root, ""))
        self._shown: dict[Behaviour, Status] = {}
        self._percentage = -1
        self._node = ""

    def execute(self) -> bool:
        """Tick until the tree has ended, was canceled, or something failed.

        Returns:
            Whether the tree succeeded.

        Raises:
            Exception: What failed outside the tree.
            CancelTimeout: A skill did not acknowledge the cancel in time.
        """
        self._goal.enter(GoalState.EXECUTING)
        root = self._tree.root
        self._show()
        self._mailbox.wake()
        while root.status in (Status.INVALID, Status.RUNNING):
            self._mailbox.wait()
            if self._mailbox.canceled or self._mailbox.fault:
                self._interrupt()
                return False
            root.tick_once()
            self._show()
        if root.status is Status.SUCCESS:
            now, name = self._clock.now(), root.name
            self._tell(Feedback(now, self._goal.identity, 100, "succeeded", name))
        return root.status is Status.SUCCESS

    def _interrupt(self) -> None:
        """Stop the tree and the arm, and wait until all that it began has acknowledged."""
        if self._mailbox.canceled:
            self._goal.enter(GoalState.CANCELING)
        self._tree.root.stop(Status.INVALID)
        self._arm.stop()
        if not self._mailbox.wait_until(self._settled, CANCEL_DEADLINE):
            busy = ", ".join(skill.name for skill in self._tree.skills if skill.busy)
            late = CancelTimeout(f"{busy} did not stop within {CANCEL_DEADLINE * 1000:.0f} ms")
            self._arm.fault(late)
            raise late
        self._show()
        if self._mailbox.fault:
            raise self._mailbox.fault

    def _settled(self) -> bool:
        return not any(skill.busy for skill in self._tree.skills)

    def _show(self) -> None:
        """Tell what has changed since the last tick."""
        now = self._clock.now()
        for node, path in self._paths.items():
            if node.status is not self._shown.get(node):
                self._shown[node] = node.status
                status, message = node.status.name, node.feedback_message
                self._tell(NodeStatus(now, path, node.name, status, message))
        self._show_progress(now)

    def _show_progress(self, now: float) -> None:
        running = [skill for skill in self._tree.skills if skill.status is Status.RUNNING]
        moving = [skill for skill in self._tree.skills if skill.progress is not None]
        # 100 belongs to success alone, and what was reached is never taken back.
        done = min(99, int(100 * max((skill.progress or 0.0 for skill in moving), default=0.0)))
        percentage, node = max(self._percentage, done, 0), running[-1].name if running else ""
        if (percentage, node) != (self._percentage, self._node) and node:
            self._percentage, self._node = percentage, node
            phase = "executing" if moving else "planning"
            self._tell(Feedback(now, self._goal.identity, percentage, phase, node))


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
