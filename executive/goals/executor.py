"""The one thread that executes goals: it alone builds, ticks, stops and discards their trees."""

import dataclasses
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from threading import Lock, Thread

import logs
from executive.errors import ExecutorBlocked, GoalError
from executive.recording.recordings import Recordings
from hardware import ActivationStopped, Arm, CancelTimeout, Clock, HardwareError, NotActive, State
from skills import Context, SkillError
from skills.motion import MotionError, Pool
from trees import Library, Located, TaskFile, TreeError, UnknownTask
from trees.build import Tree, build
from trees.compile.arguments import located
from trees.errors import BadArguments
from trees.live_library import LiveLibrary

from .blocked_node import blocked_node
from .breakpoints import Breakpoints
from .goal import Goal
from .mailbox import Mailbox
from .outcome import Cause, GoalState, Outcome, cause_of
from .queue import NOBODY, GoalQueue
from .run import CANCEL_DEADLINE, Run, decide_outcome
from .start_pose import StartPose

logger = logging.getLogger(__name__)

# So long may skills go on to judge a goal that was canceled [s]; nothing moves for it yet.
_JUDGED = 5.0

_OURS = (HardwareError, SkillError, MotionError, TreeError, GoalError, logs.LogError)


@dataclass
class _Attempt:
    """A goal on its way.

    Attributes:
        goal: Which.
        task: Its file; None where there is none that can be read.
        tree: What to run; None where it could not be built.
        error: What failed outside the tree.
        warning: What the user is to know of its files; empty for nothing.
    """

    goal: Goal
    task: TaskFile | None = None
    tree: Tree | None = None
    error: Exception | None = None
    warning: str = ""


class GoalExecutor:
    """Executes goals, one after the other.

    Args:
        goals: Where they come from.
        arm: What moves.
        library: The tasks there are.
        pool: The planners.
        recordings: Told of everything.
        context: What skills work with, but for the mailbox of their run.
        clock: Whose time.
        marked: Paths of the nodes that every run holds before; may change meanwhile.
        single_user: Whether goals activate the arm by themselves.
    """

    def __init__(
        self,
        goals: GoalQueue,
        arm: Arm,
        library: Library | LiveLibrary,
        pool: Pool,
        recordings: Recordings,
        context: Context,
        clock: Clock,
        marked: set[str],
        start_pose: StartPose,
        single_user: bool,
    ) -> None:
        self._goals, self._arm, self._library, self._pool = goals, arm, library, pool
        self._recordings, self._context, self._clock = recordings, context, clock
        self._marked, self._start_pose, self._single_user = marked, start_pose, single_user
        self._signal = clock.signal()
        self._blackboard = Lock()  # py_trees has one for all, and no lock
        self._ended = self._held = False
        self._thread: Thread | None = None
        self._tree: Tree | None = None  # that it may be in
        self._judged: Goal | None = None  # whose tree is being built

    def start(self) -> None:
        """Begin to execute."""
        if not self._single_user:
            self._pool.start()
        self._thread = self._clock.spawn(self._own, "owner")

    def join(self) -> None:
        """Wait until the last goal has ended, once there will be no more."""
        if self._thread is None:
            return
        with self._signal:
            while not (self._ended or self._held):
                self._signal.wait(None)
        if self._ended:
            self._thread.join()

    def stop_in_time(self, goal: Goal) -> None:
        """See that a goal that was asked to stop ends in time, though its tree hold the owner."""
        self._clock.spawn(partial(self._watch, goal), "deadline")

    def interrupt(self, error: Exception) -> None:
        """End the goal under way, if there is one, for this error. From any thread."""
        if goal := self._goals.running:
            goal.mailbox.fail(error)

    def arm_leaves(self) -> None:
        """End the goal under way, if there is one, because the arm leaves *active*."""
        self.interrupt(NotActive("the arm left *active* before the goal had ended"))

    def judge(self, task: int, arguments: Mapping[str, str | Located]) -> Exception | None:
        """What is wrong with a goal, as far as that goes without the arm; any thread asks."""
        attempt = _Attempt(Goal(NOBODY, task, arguments, 0.0, 0, Mailbox(self._clock)))
        self._try(attempt, self._build)
        self._discard(attempt)
        return attempt.error

    def judge_request(self, task: int, arguments: Mapping[str, str | Located]) -> Exception | None:
        """What is wrong with how a goal is asked for; what else is, its recording is to tell."""
        running = self._goals.running
        held = running and running.outcome  # refused in any case, and judging might not return
        error = None if held else self.judge(task, arguments)
        return error if isinstance(error, (UnknownTask, BadArguments)) else None

    def _own(self) -> None:
        try:
            while goal := self._goals.take():
                self._execute(_Attempt(goal))
        except BaseException:
            logger.critical("a bug in armtree: no goal is executed any more", exc_info=True)
            self._goals.close()
            self._arm.stop()
        with self._signal:
            self._ended = True
            self._signal.notify()

    def _execute(self, attempt: _Attempt) -> None:
        self._judged = attempt.goal
        self._try(attempt, self._build)
        self._judged = None
        if attempt.goal.outcome is None:  # else it was given up meanwhile
            self._try(attempt, self._open)
            if attempt.error is None:
                self._try(attempt, self._run)
        self._end(attempt)
        self._discard(attempt)

    def _try(self, attempt: _Attempt, step: Callable[[_Attempt], None]) -> None:
        """Take a step; the first error counts."""
        try:
            step(attempt)
        except _OURS as error:
            if attempt.error:
                logger.error("%s", error)
            attempt.error = attempt.error or error
        except Exception as error:  # a bug, too, must end the goal
            logger.exception("a bug in armtree")
            attempt.error = attempt.error or error

    def _build(self, attempt: _Attempt) -> None:
        """Judge a goal as far as that goes without the arm."""
        goal = attempt.goal
        library, attempt.warning = self._library.for_task(goal.task)
        draft = library.draft(goal.task)
        attempt.task = draft[0]
        mailbox, breakpoints = goal.mailbox, Breakpoints(self._marked, goal.mailbox)
        context = dataclasses.replace(
            self._context,
            wake=mailbox.wake,
            wake_at=mailbox.wake_at,
            paused_time=lambda: mailbox.paused_time,
            at_breakpoint=breakpoints.holds,
        )
        namespace = f"run_{goal.identity}"
        arguments = located(goal.arguments)
        with self._blackboard:
            attempt.tree = build(draft, library, context, namespace, arguments)
        breakpoints.watch(attempt.tree)

    def _open(self, attempt: _Attempt) -> None:
        goal, name = attempt.goal, attempt.task.name if attempt.task else ""
        self._recordings.open(goal, name, self._context.seed, attempt.tree)
        # Only now is its recording open, and whoever watches told of the goal.
        logger.info("Executing the goal for task %d (%s)", goal.task, goal.identity)
        if attempt.warning:
            logger.warning("%s", attempt.warning)

    def _run(self, attempt: _Attempt) -> None:
        assert attempt.tree
        self._ready(attempt.goal)
        self._tree = attempt.tree
        run = Run(attempt.goal, attempt.tree, self._arm, self._clock, self._recordings.record)
        try:
            run.execute()
        except _OURS:
            raise
        except Exception:
            self._arm.stop()
            raise

    def _ready(self, goal: Goal) -> None:
        """See that the arm is active."""
        if goal.mailbox.canceled:
            raise ActivationStopped("canceled before the arm moved")
        if self._single_user:
            self._activate()
        self._arm.check_active()  # first: a fault that is still being told hit the goal before
        if goal.mailbox.fault:
            raise goal.mailbox.fault

    def _activate(self) -> None:
        if self._arm.failure:  # coming back from a fault is a person's act
            raise self._arm.failure
        self._recordings.check_space()
        if self._arm.state is State.UNCONFIGURED:
            self._pool.start()  # it starts while the board boots
            self._arm.configure()
        if self._arm.state is State.INACTIVE:
            self._recordings.flush()  # the board boots next, and may move the arm
            self._start_pose.activate(self._arm)

    def _end(self, attempt: _Attempt) -> None:
        """Judge a goal, record its outcome, and tell whoever waits for it."""
        goal, recordings, now = attempt.goal, self._recordings, self._clock.now()
        outcome = self._outcome(
            goal, *decide_outcome(attempt.tree, attempt.error, goal.mailbox.canceled)
        )
        self._goals.settle(goal)
        if goal.outcome is None:
            _log_end(goal, outcome)
            recordings.record(outcome.to_record(goal.identity, now))
        self._goals.finish(goal, outcome)
        self._held = False
        if not self._single_user:
            recordings.goal_ended()

    def _watch(self, goal: Goal) -> None:
        deadline = CANCEL_DEADLINE + self._arm.robot.brake
        if self._goals.ends_in(goal, deadline):
            return
        if goal.mailbox.ticking:
            node = self._node_at_work()
            late = CancelTimeout(
                f"the tree of task {goal.task} did not stop within {deadline * 1000:.0f} ms: "
                f"the code of {node or 'a skill'} does not return"
            )
            self._give_up(goal, cause_of(late, node), late)
        elif self._judges(goal) and not self._goals.ends_in(goal, _JUDGED) and self._judges(goal):
            self._give_up(goal, cause_of(ExecutorBlocked(goal.identity, goal.task, "")))

    def _judges(self, goal: Goal) -> bool:
        return self._judged is goal

    def _give_up(self, goal: Goal, cause: Cause, fault: CancelTimeout | None = None) -> None:
        """End a goal whose skills hold the owner; the arm fails where they may move it."""
        outcome = self._outcome(goal, GoalState.ABORTED, cause)
        if fault:
            self._arm.fault(fault)
        if self._goals.give_up(goal, outcome):
            _log_end(goal, outcome)
            if fault:  # else it has no recording of its own yet
                self._recordings.record(outcome.to_record(goal.identity, self._clock.now()))
            with self._signal:
                self._held = True
                self._signal.notify()

    def _node_at_work(self) -> str:
        """Path of the node whose code the owner is in; empty where it is in none."""
        thread, tree = self._thread, self._tree
        return blocked_node(thread, tree.root) if thread and tree else ""

    def _outcome(self, goal: Goal, state: GoalState, cause: Cause | None) -> Outcome:
        spent = self._clock.now() - goal.accepted
        frames, recording = self._recordings.frames, self._recordings.path
        return Outcome.of(goal.task, state, cause, frames, spent, recording)

    def _discard(self, attempt: _Attempt) -> None:
        if attempt.tree:
            with self._blackboard:
                attempt.tree.discard()


def _log_end(goal: Goal, outcome: Outcome) -> None:
    end, cause = outcome.state.name, outcome.cause
    if cause:
        end += f": {cause} -> {cause.hint}" if cause.hint else f": {cause}"
    logger.info("The goal for task %d (%s) ended %s", goal.task, goal.identity, end)
