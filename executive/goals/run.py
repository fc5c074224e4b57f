"""The run loop: one thread ticks, stops and edits a tree; everybody else posts and wakes it."""

import logging
from collections.abc import Callable, Iterator
from typing import NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from hardware import ActivationStopped, Arm, CancelTimeout, Clock
from logs import Feedback, NodeStatus, Record
from skills import Skill, SkillBroken, TaskFailed
from trees.build import Tree
from trees.compile.paths import paths
from trees.nodes.loops import Loop

from .goal import Goal
from .outcome import CANCELED_CAUSE, Cause, GoalState, cause_of

logger = logging.getLogger(__name__)

_ENDED = (Status.SUCCESS, Status.FAILURE)

# What is asked to stop has this long to say that it has.
CANCEL_DEADLINE = 0.25  # [s]


class _Shown:
    """A node, and what was told of it last: its status, and which time it was."""

    __slots__ = ("begun", "node", "path", "status")

    def __init__(self, node: Behaviour, path: str) -> None:
        self.node, self.path = node, path
        self.status: Status | None = None
        self.begun = 0

    def changed(self) -> bool:
        """Whether there is something new to tell; it counts as told from now on."""
        begun = self.begun
        if isinstance(self.node, Skill) and not self.node.condition:  # which asks at every tick
            self.begun = self.node.start_count
        before, self.status = self.status, self.node.status
        if before not in _ENDED:
            return self.status is not before
        if self.status is Status.INVALID:  # as py_trees makes finished nodes; what they did is true
            self.status = before
        return self.status is not before or self.begun != begun


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
        self._shown = [_Shown(node, path) for node, path in paths(tree.root)]
        self._progress = Progress(tree)
        self._broken: SkillBroken | None = None

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
        self._mailbox.ticking = True
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
            if mailbox.paused:
                self._guarded(self._pause)
                continue
            self._guarded(self._tick)
        if root.status is not Status.SUCCESS and mailbox.stopping:  # which may have made it fail
            self._interrupt()
        self._settle()
        if self._broken:
            raise self._broken
        if root.status is Status.SUCCESS:
            done = self._progress.done()
            self._tell(Feedback(self._clock.now(), self._goal.identity, *done))
            return True
        # An arm that has failed refuses a motion before it has told everybody why.
        if fault := mailbox.fault or self._arm.failure:
            raise fault
        return False

    def _tick(self) -> None:
        self._tree.root.tick_once()
        self._show()

    def _guarded(self, step: Callable[[], None]) -> None:
        """Take a step; where the code of a skill raises in it, the run ends for that."""
        try:
            step()
        except SkillBroken as error:
            self._note(error)
            self._mailbox.fail(error)

    def _note(self, error: SkillBroken) -> None:
        """Keep what the code of a skill raised, with its node."""
        raised = (shown for shown in self._shown if getattr(shown.node, "broken", None) is error)
        error.node = next(raised).path
        self._broken = self._broken or error

    def _pause(self) -> None:
        """Stand still; the goal stays."""
        for skill in self._tree.skills:
            if skill.status is Status.RUNNING:
                skill.call_hook("on_pause")
        self._show(paused=True)
        self._mailbox.wait_for_resume()

    def _interrupt(self) -> None:
        """Stop the tree and the arm."""
        self._tree.root.stop(Status.INVALID)
        self._arm.stop()
        self._guarded(self._show)

    def _settle(self) -> None:
        """Wait until all that the tree began has ended; what is left may not disturb what follows.

        Raises:
            CancelTimeout: It did not in time, and the arm was taken out of *active*.
        """
        self._mailbox.ticking = False
        deadline = CANCEL_DEADLINE + self._arm.robot.brake
        if not self._mailbox.wait_until(self._settled, deadline):
            busy = ", ".join(skill.name for skill in self._tree.skills if self._busy(skill))
            late = CancelTimeout(f"{busy} did not stop within {deadline * 1000:.0f} ms")
            self._arm.fault(late)
            raise late

    def _settled(self) -> bool:
        return not any(map(self._busy, self._tree.skills))

    def _busy(self, skill: Skill) -> bool:
        try:
            return bool(skill.call_hook("busy"))
        except SkillBroken as error:
            self._note(error)
            return False

    def _show(self, paused: bool = False) -> None:
        """Tell what has changed since the last tick."""
        now, running = self._clock.now(), Status.RUNNING
        for shown in self._shown:
            node = shown.node
            if node.status is running is shown.status:  # most of a large tree, and soon seen
                continue
            if shown.changed():
                status, message = node.status.name, node.feedback_message
                self._tell(NodeStatus(now, shown.path, node.name, status, message))
        if reached := self._progress.step(paused):
            self._tell(Feedback(now, self._goal.identity, *reached))


def decide_outcome(
    tree: Tree | None, error: Exception | None, canceled: bool
) -> tuple[GoalState, Cause | None]:
    """Decide the final state of a goal.

    Args:
        tree: What was run; None where it could not even be built.
        error: What failed outside the tree, if anything did.
        canceled: Whether a cancel was asked for.

    Returns:
        Its last state, and the cause where it was not done.
    """
    if error is not None and not (canceled and isinstance(error, ActivationStopped)):
        return GoalState.ABORTED, cause_of(error)
    if tree is not None and tree.root.status is Status.SUCCESS:
        return GoalState.SUCCEEDED, None
    if tree is not None and tree.root.status is Status.FAILURE:
        return GoalState.ABORTED, _of_tree(tree.root)
    return GoalState.CANCELED, CANCELED_CAUSE


def _of_tree(root: Behaviour) -> Cause:
    """The first failed node that knows why, with what every one of them says."""
    failed = list(_failed(root))
    if not failed:
        return cause_of(TaskFailed(f"{root.name} failed, as its tree has it"))
    node, error = failed[0]
    planning = getattr(error, "code", "").startswith("plan.")
    said = (f"{node.name}: {error}" if planning else str(error) for node, error in failed)
    return cause_of(error, dict(paths(root))[node], "; ".join(said))


def _failed(node: Behaviour) -> Iterator[tuple[Behaviour, Exception]]:
    """The nodes that a failure came from; what others have made good is none."""
    if node.status is not Status.FAILURE:
        return
    failure: Exception | None = getattr(node, "failure", None)
    if failure:
        yield node, failure
        return
    for child in node.children:
        yield from _failed(child)


class Reached(NamedTuple):
    """How far a run is, as it is told.

    Attributes:
        percentage: Of the frames; None while none are scheduled.
        phase: planning, executing, asking, waiting, paused or succeeded.
        node: Name of the skill at work.
        attempt: From 1; a retry begins another one.
    """

    percentage: int | None
    phase: str
    node: str
    attempt: int


class Progress:
    """Follows one tree.

    Args:
        tree: Which.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        # Those that measure how far they are, whether or not they have begun.
        self._moving = [s for s in tree.skills if type(s).progress is not Skill.progress]
        loops = (node for node in tree.root.iterate() if isinstance(node, Loop))
        self._failed = dict.fromkeys(loops, 0)  # attempts of each, when it was looked at last
        self._told = Reached(None, "", "", 1)

    def step(self, paused: bool = False) -> Reached | None:
        """How far the tree is now; None where nothing has changed."""
        skills = reversed(self._tree.skills)
        running = next((skill for skill in skills if skill.status is Status.RUNNING), None)
        if running is None and not paused:
            return None
        attempt = self._attempt()
        before = self._told.percentage if attempt == self._told.attempt else None
        percentage = self._percentage(before)
        name = running.name if running else self._tree.root.name
        doing = "paused" if paused else running.doing if running else ""
        phase = doing or ("planning" if percentage is None else "executing")
        return self._tell(Reached(percentage, phase, name, attempt))

    def done(self) -> Reached:
        """What is told of success."""
        return Reached(100, "succeeded", self._tree.root.name, self._told.attempt)

    def _attempt(self) -> int:
        """The number of the attempt; it only grows, also where a loop begins its retries anew."""
        more = 0
        for loop, failed in self._failed.items():
            more += max(0, loop.failed_attempts - failed)
            self._failed[loop] = loop.failed_attempts
        return self._told.attempt + more

    def _tell(self, reached: Reached) -> Reached | None:
        told, self._told = self._told, reached
        return reached if reached != told else None

    def _percentage(self, before: int | None) -> int | None:
        shares = [_share(skill) for skill in self._moving]
        if before is None and all(share is None for share in shares):
            return None
        done = sum(share or 0.0 for share in shares) / len(shares) if shares else 0.0
        # 100 belongs to success alone, and what was reached is not taken back within an attempt.
        return max(before or 0, min(99, int(100 * done)))


def _share(skill: Skill) -> float | None:
    """How much of all that a skill has to do is done, rounds of loops included."""
    share = None if skill.status is Status.INVALID else skill.call_hook("progress")
    node: Behaviour | None = skill.parent
    while node is not None:
        if isinstance(node, Loop):
            share = node.progress(share)
        node = node.parent
    return share
