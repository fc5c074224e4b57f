"""Stops the running goal, enforces its deadline and decides its outcome.

`Arm.stop` in hardware/arm/arm.py decides how the arm stops: it holds, or slows down first if the
robot file has `brake_s`. Its torque stays on.
"""

import logging
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial

from py_trees.behaviour import Behaviour

from executive.api.outcome import CancelResult, Cause, GoalState, Outcome, cause_of
from executive.errors import ExecutorBlocked
from executive.recording.recordings import Recordings
from hardware import Arm, CancelTimeout, Clock
from hardware.loading.dataclass import dataclass
from logs import goal_title
from trees.compile.node_paths import paths

from .goal import Goal
from .queue import GoalQueue

logger = logging.getLogger(__name__)

STOP_TIMEOUT = 0.25  # longest time from a stop to the end of all work of the tree [s]
VALIDATION_TIMEOUT = 5.0  # longest further time for validation, during which nothing moves [s]


@dataclass(frozen=True, slots=True)
class _SkillCode:
    """The code of skills that a thread runs.

    Attributes:
        goal: The goal.
        thread: Identity of the thread.
        root: Root of the ticked tree; None while the tree is built.
    """

    goal: Goal
    thread: int
    root: Behaviour | None

    @property
    def node(self) -> str:
        """Path of the node whose code the thread executes; empty if there is none."""
        known = {id(node): path for node, path in paths(self.root)} if self.root else {}
        frame = sys._current_frames().get(self.thread)
        while frame:
            if path := known.get(id(frame.f_locals.get("self"))):
                return path
            frame = frame.f_back
        return ""


class GoalStopper:
    """Stops and ends the goal under way. Any thread may call.

    A stop has two phases. First the calling thread stops the arm, at once. Then the executor
    interrupts the tree and waits until everything that the tree started has ended. If this takes
    longer than the deadline, the arm enters error processing and the goal is aborted. This works
    even if the code of a skill does not return to the executor.

    Args:
        queue: Queue of goals.
        arm: The arm.
        recordings: Receives the outcome.
        clock: Time source.
    """

    def __init__(self, queue: GoalQueue, arm: Arm, recordings: Recordings, clock: Clock) -> None:
        self._queue, self._arm, self._recordings, self._clock = queue, arm, recordings, clock
        self._code: _SkillCode | None = None

    @property
    def _deadline(self) -> float:
        """Longest time from a stop to the end of all work of the tree [s]."""
        return STOP_TIMEOUT + self._arm.robot.brake

    def cancel(self, identity: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel goals like `GoalQueue.cancel`. Without arguments, always stop the arm."""
        result, canceled, running = self._queue.cancel(identity, stamp_ns)
        if not (identity or stamp_ns or running):
            self._arm.stop()
        self.stop(running, canceled)
        return result

    def close(self) -> None:
        """Accept no more goals, and cancel all goals."""
        self._queue.close()
        *_, running = self._queue.cancel("", 0)
        self.stop(running)

    def stop(self, goal: Goal | None, canceled: Sequence[Goal] = ()) -> None:
        """Stop the arm for a goal that the queue has canceled or preempted.

        Args:
            goal: The goal under way; None if it must not be stopped.
            canceled: Goals whose cancel is logged.
        """
        try:
            if goal:
                self._arm.stop()
            for each in canceled:
                logger.info("Received a cancel of the goal for %s (%s)", *each.name)
        finally:
            if goal:
                self._queue.stopped(goal)
                self._clock.spawn(partial(self._watch, goal), "deadline")

    def interrupt(self, error: Exception) -> None:
        """Abort the goal under way, if there is one, because of an error outside its tree."""
        if goal := self._queue.running:
            goal.mailbox.fail(error)

    @contextmanager
    def skill_code(self, goal: Goal, root: Behaviour | None = None) -> Iterator[None]:
        """Mark that this thread runs the code of skills. The code may never return.

        Args:
            goal: The goal.
            root: Root of the ticked tree; None while the tree is built.
        """
        self._code = _SkillCode(goal, threading.get_ident(), root)
        try:
            yield
        finally:
            self._code = None

    def wait_for_tree(self, goal: Goal, busy: Callable[[], str]) -> None:
        """Wait until all work of a tree has ended.

        Args:
            goal: The goal of the tree.
            busy: Callback that returns the names of the busy skills.

        Raises:
            CancelTimeout: The work did not end before the deadline. The arm is in error processing.
        """
        if not goal.mailbox.wait_until(lambda: not busy(), self._deadline):
            raise self._time_out(busy())

    def end(self, goal: Goal, state: GoalState, cause: Cause | None) -> None:
        """End the goal under way, when no stop of the arm is pending for it.

        Args:
            goal: The goal. It may already be aborted.
            state: Final state.
            cause: Cause of a failure; None if the goal succeeded.
        """
        self._queue.wait_for_stops(goal)
        self._queue.finish(goal, goal.outcome or self._report(goal, state, cause))

    def _watch(self, goal: Goal) -> None:
        """Abort a goal that misses the deadline because the code of a skill does not return."""
        if self._queue.ended_in(goal, self._deadline):
            return
        code = self._code
        if code and code.goal is goal and code.root:
            node = code.node
            words = f": the code of {node or 'a skill'} does not return"
            late = self._time_out(f"the tree of {goal_title(goal.task)}", words)
            self._abort(goal, cause_of(late, node), recorded=True)
            return
        if self._is_built(goal):
            self._queue.ended_in(goal, VALIDATION_TIMEOUT)
        if self._is_built(goal):
            blocked = ExecutorBlocked(goal.identity, goal.task, "")
            self._abort(goal, cause_of(blocked), recorded=False)

    def _is_built(self, goal: Goal) -> bool:
        code = self._code
        return code is not None and code.goal is goal and code.root is None

    def _time_out(self, what: str, words: str = "") -> CancelTimeout:
        """Take the arm out of *active* after a missed deadline."""
        late = CancelTimeout(f"{what} did not stop within {self._deadline * 1000:.0f} ms{words}")
        self._arm.fault(late)
        return late

    def _abort(self, goal: Goal, cause: Cause, recorded: bool) -> None:
        """End a goal that blocks the executor. Record the end if the goal has a recording."""
        outcome = self._outcome(
            goal, GoalState.ABORTED, cause, self._recordings.frames, self._recordings.path
        )
        if self._queue.abort_blocked(goal, outcome):
            _log_end(goal, outcome.state, cause)
            if recorded:
                self._recordings.record(outcome.to_record(goal.identity, self._clock.now()))

    def _report(self, goal: Goal, state: GoalState, cause: Cause | None) -> Outcome:
        """Log and record the outcome of a goal."""
        _log_end(goal, state, cause)
        make = partial(self._outcome, goal, state, cause)
        return self._recordings.record_result(goal.identity, make)

    def _outcome(
        self, goal: Goal, state: GoalState, cause: Cause | None, frames: int, recording: str
    ) -> Outcome:
        duration = self._clock.now() - goal.accepted
        return Outcome.of(goal.task, state, cause, frames, duration, recording)


def _log_end(goal: Goal, state: GoalState, cause: Cause | None) -> None:
    words = state.name
    if cause:
        words += f": {cause} -> {cause.advice}" if cause.advice else f": {cause}"
    logger.info("The goal for %s (%s) ended %s", *goal.name, words)
