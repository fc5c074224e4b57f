"""The queue of goals: accepted, waiting, under way, and recently ended goals."""

import math
import re
import uuid
from collections import deque
from collections.abc import Callable, Mapping
from itertools import islice

from executive.api import Policy
from executive.api.outcome import (
    Acceptance,
    CancelCode,
    CancelResult,
    Cause,
    GoalState,
    GoalStatus,
    Outcome,
    cause_of,
)
from executive.errors import (
    BadIdentity,
    DuplicateGoal,
    ExecutorBlocked,
    GoalBusy,
    GoalCanceled,
    GoalPreempted,
    QueueFull,
    ResultTimeout,
    SentBeforeStop,
    ServerClosing,
    UnknownGoal,
)
from hardware import Clock, utc_ns
from logs import goal_title
from trees import Located

from .goal import Goal
from .mailbox import Mailbox

_IDENTITY = re.compile("[0-9a-f]{32}")
WAITING = 100  # longest queue of goals
KEPT = 1000  # number of ended goals to keep, which bounds the memory of a server
NO_GOAL = "0" * 32  # identity in a cancel that names no goal, as in ROS 2


class GoalQueue:
    """All known goals: accepted, waiting, under way and ended. Any thread may call.

    It answers like a ROS 2 action server.

    Args:
        clock: Time source.
        policy: Policy for a second goal.
        keep: Time for which an ended goal is kept [s]; negative for no limit. Of more than `KEPT`
            ended goals, the oldest are forgotten earlier.
        changed: Callback for every change of a goal, in order and from any thread. It must be quick
            and must not wait for other threads.

    Attributes:
        keep: Time for which an ended goal is kept [s].
        running: The goal under way, or None.
        stops: Number of cancels that named no goal. They always stop the arm.
        signal: Lock of the goals. A thread that waits for it is woken at changes of goals.
    """

    def __init__(
        self, clock: Clock, policy: Policy, keep: float, changed: Callable[[GoalStatus], None]
    ) -> None:
        self._clock, self._policy, self._changed = clock, policy, changed
        self.keep = keep if keep >= 0 else math.inf
        self.signal = clock.signal()
        self._goals: dict[str, Goal] = {}
        self._waiting: deque[Goal] = deque()
        self._ended: deque[Goal] = deque()
        self.running: Goal | None = None
        self.stops = 0
        self._last_ns, self._closed = 0, False

    def send(
        self,
        task: int,
        arguments: Mapping[str, str | Located],
        identity: str,
        invalid: Exception | None = None,
        text: str = "",
        client: str = "",
        stops: int | None = None,
    ) -> tuple[Acceptance, Goal | None]:
        """Accept or refuse a goal.

        Args:
            task: Task number; `MOVE` for a move.
            arguments: Values of the task's parameters.
            identity: 32 hexadecimal digits; empty for a new identity.
            invalid: Error of a goal that can never be executed, or None.
            text: Text of a move; empty for a task.
            client: Name of the sending program; empty if unknown.
            stops: `stops` in the last status that the sender has read; None for no such check.

        Returns:
            The answer, and the preempted goal or None. The caller must stop the arm for the
            preempted goal and then call `stopped`.
        """
        with self.signal:
            self._forget()
            identity = identity or uuid.uuid4().hex
            if refusal := self._refusal(identity, invalid, stops):
                return Acceptance(identity, 0, cause_of(refusal)), None
            preempted = self._preempt(identity) if self._policy is Policy.PREEMPT else None
            now, mailbox = self._clock.now(), Mailbox(self._clock)
            stamp = self._stamp(now)
            goal = Goal(identity, task, arguments, now, stamp, mailbox, text, client)
            self._goals[identity] = goal
            self._waiting.append(goal)
            self._changed(goal.status)
            self.signal.notify()
            return Acceptance(identity, goal.stamp_ns), preempted

    def add_ended(self, identity: str, stamp_ns: int, outcome: Outcome) -> None:
        """Add a goal that ended on an earlier server."""
        with self.signal:
            now = self._clock.now()
            goal = Goal(identity, outcome.task, {}, now, stamp_ns, Mailbox(self._clock))
            self._goals[identity] = goal
            canceled = outcome.state is GoalState.CANCELED
            self._enter(goal, GoalState.CANCELING if canceled else GoalState.EXECUTING)
            self._end(goal, outcome)

    def cancel(self, identity: str, stamp_ns: int) -> tuple[CancelResult, list[Goal], Goal | None]:
        """Cancel the goals that the parameters name, or all goals if they name none.

        Args:
            identity: Identity of a goal; empty or `NO_GOAL` for none.
            stamp_ns: Latest time of acceptance [ns since 1970]; 0 for none.

        Returns:
            The answer, the canceled goals, and the goal under way if it is one of them. The caller
            must stop the arm for that goal and then call `stopped`.
        """
        with self.signal:
            self._forget()
            self.stops += not (identity or stamp_ns)
            identity = "" if identity == NO_GOAL else identity
            if identity and not stamp_ns and (code := self._uncancelable(identity)):
                return CancelResult(code, ()), [], None
            canceled = [
                goal
                for goal in self._goals.values()
                if goal.cancelable
                and (
                    goal.identity == identity
                    or goal.stamp_ns <= stamp_ns
                    or not (identity or stamp_ns)
                )
            ]
            for goal in canceled:
                self._cancel(goal)
            result = CancelResult(CancelCode.NONE, tuple(goal.identity for goal in canceled))
            return result, canceled, self.running if self.running in canceled else None

    def stopped_since(self, stops: int | None) -> bool:
        """Return True if a stop came after the status with that number of stops.

        Args:
            stops: `stops` of the status; None if the sender gave none.
        """
        return stops is not None and stops < self.stops

    def stopped(self, goal: Goal) -> None:
        """Report that a stop of the arm for a goal is done."""
        with self.signal:
            goal.stops -= 1
            self.signal.notify()

    def take(self) -> Goal | None:
        """Wait for the next goal and begin to execute it. Return None if the queue is closed."""
        with self.signal:
            while not self._waiting and not self._closed:
                self.signal.wait(None)
            if not self._waiting:
                return None
            self.running = goal = self._waiting.popleft()
            self._enter(goal, GoalState.EXECUTING)
            return goal

    def wait_for_stops(self, goal: Goal) -> None:
        """Wait until no stop of the arm is pending for a goal."""
        with self.signal:
            self._wait_for_stops(goal)

    def finish(self, goal: Goal, outcome: Outcome) -> None:
        """End the goal under way. The next goal may then begin."""
        with self.signal:
            self._wait_for_stops(goal)  # a late stop would stop the next goal
            self.running = None
            if goal.outcome is None:
                self._end(goal, outcome)

    def abort_blocked(self, goal: Goal, outcome: Outcome) -> bool:
        """End a goal that blocks the executor, and all waiting goals.

        Returns:
            False if the goal had already ended.
        """
        with self.signal:
            if goal.outcome:
                return False
            self._end(goal, outcome)
            self._abort_waiting(_blocked(goal))
            return True

    def ended_in(self, goal: Goal, timeout: float | None) -> bool:
        """Wait for the end of a goal. Return False if it does not end in time.

        Args:
            goal: The goal.
            timeout: Longest time to wait [s]; None for no limit.
        """
        until = None if timeout is None else self._clock.now() + timeout
        with self.signal:
            while goal.outcome is None and (until is None or self._clock.now() < until):
                self.signal.wait(until)
            return goal.outcome is not None

    def result(self, identity: str, timeout: float | None) -> Outcome:
        """Wait for the outcome of a goal.

        Args:
            identity: Identity of the goal.
            timeout: Longest time to wait [s]; None for no limit.

        Raises:
            UnknownGoal: No goal has that identity, or it is forgotten.
            ResultTimeout: The goal has not ended in time.
        """
        goal = self.find(identity)
        if not self.ended_in(goal, timeout):
            raise ResultTimeout(identity, timeout or 0.0)
        assert goal.outcome
        return goal.outcome

    def find(self, identity: str) -> Goal:
        """Return the goal with an identity.

        Raises:
            UnknownGoal: No goal has that identity, or it is forgotten.
        """
        with self.signal:
            self._forget()
            if identity not in self._goals:
                raise UnknownGoal(identity)
            return self._goals[identity]

    @property
    def blocked(self) -> bool:
        """True while an ended goal blocks the executor."""
        running = self.running
        return running is not None and running.outcome is not None

    @property
    def current(self) -> Goal | None:
        """The running goal, else the first waiting goal, else None."""
        with self.signal:
            return self.running or next(iter(self._waiting), None)

    @property
    def waiting(self) -> tuple[str, ...]:
        """Identities of the waiting goals after the current goal, in the order of execution."""
        with self.signal:
            waiting = islice(self._waiting, 0 if self.running else 1, None)
            return tuple(goal.identity for goal in waiting)

    def all(self, newest: int | None = None) -> tuple[GoalStatus, ...]:
        """Return all known goals, or only the newest ones, in the order of acceptance."""
        with self.signal:
            self._forget()
            goals = [*islice(reversed(self._goals.values()), newest)]
            return tuple(goal.status for goal in reversed(goals))

    def close(self) -> None:
        """Accept no more goals."""
        with self.signal:
            self._closed = True
            self.signal.notify()

    def _wait_for_stops(self, goal: Goal) -> None:
        while goal.stops:
            self.signal.wait(None)

    def _refusal(
        self, identity: str, invalid: Exception | None, stops: int | None
    ) -> Exception | None:
        if self._closed:
            return ServerClosing("the server is ending; start the server again")
        if not _IDENTITY.fullmatch(identity):
            return BadIdentity(identity)
        if identity in self._goals:
            return DuplicateGoal(identity)
        if self.stopped_since(stops):
            return SentBeforeStop()
        busy = self.current
        if busy and self.blocked:
            return _blocked(busy)
        if invalid:  # checked before the policy, because an invalid goal stays invalid
            return invalid
        if busy and self._policy is Policy.REJECT:
            return GoalBusy(f"goal {busy.identity} for {goal_title(busy.task)} is under way")
        if self._policy is Policy.QUEUE and len(self._waiting) >= WAITING:
            words = f"{WAITING} goals are waiting, which is the limit; wait, or cancel some"
            return QueueFull(words)
        return None

    def _preempt(self, identity: str) -> Goal | None:
        """Abort all other goals for a new goal. Return the goal under way, or None."""
        error = GoalPreempted(identity)
        self._abort_waiting(error)
        if running := self.running:
            running.stops += 1
            running.mailbox.fail(error)
        return running

    def _abort_waiting(self, error: Exception) -> None:
        goals, cause = list(self._waiting), cause_of(error)
        self._waiting.clear()
        for goal in goals:
            self._enter(goal, GoalState.EXECUTING)  # ROS 2 aborts only executing goals
            self._end_unstarted(goal, GoalState.ABORTED, cause)

    def _uncancelable(self, identity: str) -> CancelCode | None:
        goal = self._goals.get(identity)
        if goal is None:
            return CancelCode.UNKNOWN_GOAL_ID
        return None if goal.cancelable else CancelCode.GOAL_TERMINATED

    def _cancel(self, goal: Goal) -> None:
        self._enter(goal, GoalState.CANCELING)
        if goal is self.running:
            goal.stops += 1
            goal.mailbox.cancel()
        else:
            self._waiting.remove(goal)
            self._end_unstarted(goal, GoalState.CANCELED, cause_of(GoalCanceled()))

    def _end_unstarted(self, goal: Goal, state: GoalState, cause: Cause) -> None:
        duration = self._clock.now() - goal.accepted
        self._end(goal, Outcome.of(goal.task, state, cause, duration=duration))

    def _end(self, goal: Goal, outcome: Outcome) -> None:
        goal.outcome, goal.ended = outcome, self._clock.now()
        goal.arguments, goal.text = {}, ""  # frees memory, because arguments may be large
        self._ended.append(goal)
        self._enter(goal, outcome.state)
        self.signal.notify()

    def _enter(self, goal: Goal, state: GoalState) -> None:
        goal.enter(state)
        self._changed(goal.status)

    def _stamp(self, now: float) -> int:
        """Return a unique time of acceptance [ns since 1970]."""
        self._last_ns = max(utc_ns(self._clock, now), self._last_ns + 1)
        return self._last_ns

    def _forget(self) -> None:
        """Forget expired goals, and the oldest goals if there are too many."""
        since = self._clock.now() - self.keep
        while self._ended and (len(self._ended) > KEPT or self._ended[0].ended <= since):
            del self._goals[self._ended.popleft().identity]


def _blocked(goal: Goal) -> ExecutorBlocked:
    cause = goal.outcome and goal.outcome.cause
    return ExecutorBlocked(goal.identity, goal.task, cause.node if cause else "")
