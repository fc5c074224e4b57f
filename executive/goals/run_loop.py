"""The run loop that ticks one tree, its progress, and the outcome of the goal."""

import logging
from collections.abc import Callable, Iterator
from typing import NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.api.outcome import Cause, GoalState, cause_of
from executive.errors import GoalCanceled
from hardware import ActivationStopped, Arm, Clock, HardwareError
from logs import Feedback, NodeStatus, Record
from skills import Skill, SkillBroken, TaskFailed
from trees.build import Tree
from trees.compile.node_paths import paths
from trees.nodes.loops import loops_in, share_of_rounds

from .goal import Goal
from .stop import GoalStopper

logger = logging.getLogger(__name__)

_ENDED = (Status.SUCCESS, Status.FAILURE)


class _Node:
    """A node of the tree, with its last recorded status."""

    __slots__ = ("node", "path", "start_count", "status")

    def __init__(self, node: Behaviour, path: str) -> None:
        self.node, self.path = node, path
        self.status: Status | None = None
        self.start_count = 0

    @property
    def moving(self) -> bool:
        """True for a skill that moves the arm, or that failed because of the arm."""
        skill = self.node
        if not (isinstance(skill, Skill) and skill.moves):
            return False
        failed = skill.status is Status.FAILURE and isinstance(skill.failure, HardwareError)
        return failed or skill.status is Status.RUNNING

    def update(self) -> bool:
        """Update the status; return True if the change must be recorded."""
        starts, before = self.start_count, self.status
        # A condition starts at every tick.
        if isinstance(self.node, Skill) and not self.node.condition:
            self.start_count = self.node.start_count
        self.status = self.node.status
        if before not in _ENDED:
            return self.status is not before
        if self.status is Status.INVALID:  # py_trees resets finished nodes; keep their last status
            self.status = before
        return self.status is not before or self.start_count != starts


class Run:
    """One run of a tree.

    Args:
        goal: The goal, with its mailbox.
        tree: The tree.
        arm: The arm.
        stopper: Waits for the end of a stopped tree.
        clock: Time source.
        record: Receives every change of the tree and of its progress.

    Attributes:
        moving: Path of the skill that moved the arm at the end of the run; empty if there is none.
    """

    def __init__(
        self,
        goal: Goal,
        tree: Tree,
        arm: Arm,
        stopper: GoalStopper,
        clock: Clock,
        record: Callable[[Record], None],
    ) -> None:
        self._goal, self._tree, self._arm, self._stopper = goal, tree, arm, stopper
        self._clock, self._mailbox, self._record = clock, goal.mailbox, record
        self._nodes = [_Node(node, path) for node, path in paths(tree.root)]
        self._progress = Progress(tree)
        self._broken: SkillBroken | None = None
        self.moving = ""

    def execute(self) -> None:
        """Tick until the tree ends, the goal is canceled, or something fails.

        Raises:
            Exception: An error outside the tree ended the run.
            CancelTimeout: A skill did not stop before the deadline.
        """
        self._record_changes()
        self._mailbox.wake()
        try:
            with self._stopper.skill_code(self._goal, self._tree.root):
                self._tick_until_end()
            self._stopper.wait_for_tree(self._goal, self._busy)
            self._finish()
        finally:
            self._tree.halt()  # after an exception, the parents of its node are still running

    def _tick_until_end(self) -> None:
        root, mailbox = self._tree.root, self._mailbox
        while root.status in (Status.INVALID, Status.RUNNING):
            mailbox.wait()
            if mailbox.stopping:
                break
            self._guard(self._pause if mailbox.paused else self._tick)
        self.moving = next((each.path for each in self._nodes if each.moving), "")
        # The stop may make a skill, and with it the tree, fail.
        if root.status is not Status.SUCCESS and mailbox.stopping:
            root.stop(Status.INVALID)
            self._arm.stop()
            self._guard(self._record_changes)

    def _finish(self) -> None:
        """Raise an error from outside the tree, or report the end of the task."""
        if self._broken:
            raise self._broken
        if self._tree.root.status is Status.SUCCESS:
            done = self._progress.done()
            self._record(Feedback(self._clock.now(), self._goal.identity, *done))
        # A failed arm may refuse a motion before it reports its fault.
        elif fault := self._mailbox.fault or self._arm.failure:
            raise fault

    def _tick(self) -> None:
        self._tree.root.tick_once()
        self._record_changes()

    def _guard(self, step: Callable[[], None]) -> None:
        """Run a step. If the code of a skill raises an exception, the run ends."""
        try:
            step()
        except SkillBroken as error:
            self._note(error)
            self._mailbox.fail(error)

    def _note(self, error: SkillBroken) -> None:
        """Store the exception of a skill, with its node."""
        raised = (each for each in self._nodes if getattr(each.node, "broken", None) is error)
        error.node = next(raised).path
        self._broken = self._broken or error

    def _pause(self) -> None:
        """Pause the running skills, and wait until the run is resumed."""
        for skill in self._tree.skills:
            if skill.status is Status.RUNNING:
                skill.call_hook("on_pause")
        self._record_changes(paused=True)
        self._mailbox.wait_for_resume()

    def _busy(self) -> str:
        """Return the names of the skills that have not ended."""
        return ", ".join(skill.name for skill in self._tree.skills if self._is_busy(skill))

    def _is_busy(self, skill: Skill) -> bool:
        try:
            return bool(skill.call_hook("busy"))
        except SkillBroken as error:
            self._note(error)
            return False

    def _record_changes(self, paused: bool = False) -> None:
        """Record the changes since the last tick."""
        now, running = self._clock.now(), Status.RUNNING
        for each in self._nodes:
            node = each.node
            if node.status is running is each.status:  # fast for most nodes of a large tree
                continue
            if each.update():
                status, message = node.status.name, node.feedback_message
                read = dict(node.values_read) if isinstance(node, Skill) else {}
                self._record(NodeStatus(now, each.path, node.name, status, message, read))
        if point := self._progress.step(paused):
            self._record(Feedback(now, self._goal.identity, *point))


def decide_outcome(
    tree: Tree | None, error: Exception | None, canceled: bool, node: str = ""
) -> tuple[GoalState, Cause | None]:
    """Decide the final state of a goal.

    Args:
        tree: The tree; None if it could not be built.
        error: Error outside the tree, or None.
        canceled: True if the goal was canceled.
        node: Path of the node that the error ended; empty if there is none.

    Returns:
        The final state, and the cause; None for success.
    """
    if error is not None and not (canceled and isinstance(error, ActivationStopped)):
        return GoalState.ABORTED, cause_of(error, node)
    if tree is not None and tree.root.status is Status.SUCCESS:
        return GoalState.SUCCEEDED, None
    if tree is not None and tree.root.status is Status.FAILURE:
        return GoalState.ABORTED, _of_tree(tree.root)
    return GoalState.CANCELED, cause_of(GoalCanceled())


def _of_tree(root: Behaviour) -> Cause:
    """Return the cause of the first failed skill, with the messages of all failed skills."""
    failed = list(_failed(root))
    if not failed:
        return cause_of(TaskFailed(f"{root.name} failed, although none of its skills failed"))
    node, error = failed[0]
    planning = getattr(error, "code", "").startswith("plan.")
    names = dict[str, list[str]]()  # names of the failed skills, by message
    for each, failure in failed:
        names.setdefault(str(failure), []).append(each.name)
    words = [f"{', '.join(own)}: {said}" if planning else said for said, own in names.items()]
    return cause_of(error, dict(paths(root))[node], "; ".join(words))


def _failed(node: Behaviour) -> Iterator[tuple[Behaviour, Exception]]:
    """Yield the failed skills, except for failures that a fallback handled."""
    if node.status is not Status.FAILURE:
        return
    failure: Exception | None = getattr(node, "failure", None)
    if failure:
        yield node, failure
        return
    for child in node.children:
        yield from _failed(child)


class ProgressPoint(NamedTuple):
    """Progress of a run.

    Attributes:
        percentage: Finished share of the work, averaged over the moving skills [%]; None before the
            first motion.
        phase: planning, executing, asking, waiting, paused or succeeded.
        node: Name of the running skill.
        attempt: Number of the attempt, from 1. A retry starts another attempt.
    """

    percentage: int | None
    phase: str
    node: str
    attempt: int


class Progress:
    """Progress of one tree: the finished shares of its moving skills, averaged.

    Args:
        tree: The tree.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        # Skills that measure their progress, also before their start.
        self._moving = [s for s in tree.skills if type(s).progress is not Skill.progress]
        # Failed attempts of each loop at the last step.
        self._failed = dict.fromkeys(loops_in(tree.root), 0)
        self._last = ProgressPoint(None, "", "", 1)

    def step(self, paused: bool = False) -> ProgressPoint | None:
        """Return the current progress; None if it has not changed."""
        skills = reversed(self._tree.skills)
        running = next((skill for skill in skills if skill.status is Status.RUNNING), None)
        if running is None and not paused:
            return None
        attempt = self._attempt()
        before = self._last.percentage if attempt == self._last.attempt else None
        percentage = self._percentage(before)
        name = running.name if running else self._tree.root.name
        reported = "paused" if paused else running.phase if running else ""
        phase = reported or ("planning" if percentage is None else "executing")
        last, self._last = self._last, ProgressPoint(percentage, phase, name, attempt)
        return self._last if self._last != last else None

    def done(self) -> ProgressPoint:
        """Return the progress of a successful run."""
        return ProgressPoint(100, "succeeded", self._tree.root.name, self._last.attempt)

    def _attempt(self) -> int:
        """Return the number of the attempt.

        The number only grows, also if an outer loop restarts the retries.
        """
        more = 0
        for loop, failed in self._failed.items():
            more += max(0, loop.failed_attempts - failed)
            self._failed[loop] = loop.failed_attempts
        return self._last.attempt + more

    def _percentage(self, before: int | None) -> int | None:
        shares = [_share(skill) for skill in self._moving]
        if before is None and all(share is None for share in shares):
            return None
        done = sum(share or 0.0 for share in shares) / len(shares) if shares else 0.0
        # Only success is 100 %, and the percentage never falls within an attempt.
        return max(before or 0, min(99, int(100 * done)))


def _share(skill: Skill) -> float | None:
    """Return the finished share of a skill's work, with all rounds of loops; None if unknown."""
    share = None if skill.status is Status.INVALID else skill.call_hook("progress")
    return share_of_rounds(skill, share)
