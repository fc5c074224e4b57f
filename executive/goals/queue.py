"""The goals there are: accepted, waiting, under way, and ended ones until they are forgotten.

The semantics are those of a ROS 2 action server, answer by answer; it knows no transport.
"""

import logging
import math
import re
import uuid
from collections import deque
from collections.abc import Callable, Mapping
from enum import StrEnum
from itertools import islice

from executive.codes import BAD_IDENTITY, BUSY, CLOSING, DUPLICATE, QUEUE_FULL
from executive.errors import ExecutorBlocked, GoalPreempted, ResultTimeout, UnknownGoal
from hardware import Clock
from trees import Located

from .goal import Goal
from .mailbox import Mailbox
from .outcome import (
    CANCELED_CAUSE,
    Acceptance,
    CancelCode,
    CancelResult,
    Cause,
    GoalState,
    GoalStatus,
    Outcome,
    cause_for,
    cause_of,
)

logger = logging.getLogger(__name__)

_IDENTITY = re.compile("[0-9a-f]{32}")
WAITING = 100  # so many goals may wait for their turn
KEPT = 1000  # so many ended goals are known, the newest, so that a server does not grow
NOBODY = "0" * 32  # names no goal where one is to be canceled


class Policy(StrEnum):
    """What becomes of a goal that comes while another one is under way."""

    REJECT = "reject"
    QUEUE = "queue"
    PREEMPT = "preempt"


class GoalQueue:
    """All goals that are known. Any thread may call.

    Args:
        clock: Whose time.
        policy: What becomes of a second goal.
        keep: How long an ended goal is known [s], unless `KEPT` others have ended after it; where
            it is negative, until they have.
        changed: Told of every change, in order and from any thread; it must be quick, and wait for
            no other thread.
    """

    def __init__(
        self, clock: Clock, policy: Policy, keep: float, changed: Callable[[GoalStatus], None]
    ) -> None:
        self._clock, self.policy, self._changed = clock, policy, changed
        self.keep = keep if keep >= 0 else math.inf
        self._signal = clock.signal()
        self._goals: dict[str, Goal] = {}
        self._waiting: deque[Goal] = deque()
        self._ended: deque[Goal] = deque()
        self._running: Goal | None = None
        self._last_ns, self._closed = 0, False

    def send(
        self,
        task: int,
        arguments: Mapping[str, str | Located],
        identity: str,
        wrong: Exception | None = None,
    ) -> tuple[Acceptance, Goal | None]:
        """Accept a goal, or refuse it.

        Args:
            task: Number of its task.
            arguments: Values of its parameters.
            identity: 32 hexadecimal digits, made here where there are none.
            wrong: Why it can never be done, where that is known.

        Returns:
            The answer; and the goal that must make room for it, for which the caller stops the arm
            and then calls `stopped`.
        """
        with self._signal:
            self._forget()
            identity = identity or uuid.uuid4().hex
            if refusal := self._refusal(identity, wrong):
                return Acceptance(identity, 0, refusal), None
            preempted = self._preempt(identity) if self.policy is Policy.PREEMPT else None
            now, mailbox = self._clock.now(), Mailbox(self._clock)
            goal = Goal(identity, task, arguments, now, self._stamp(now), mailbox)
            self._goals[identity] = goal
            self._waiting.append(goal)
            self._changed(goal.status)
            self._signal.notify()
            return Acceptance(identity, goal.stamp_ns), preempted

    def add_ended(self, identity: str, stamp_ns: int, outcome: Outcome) -> None:
        """Know a goal of an earlier server."""
        with self._signal:
            now = self._clock.now()
            goal = Goal(identity, outcome.task, {}, now, stamp_ns, Mailbox(self._clock))
            self._goals[identity] = goal
            canceled = outcome.state is GoalState.CANCELED
            self._enter(goal, GoalState.CANCELING if canceled else GoalState.EXECUTING)
            self._end(goal, outcome)

    def cancel(self, identity: str, stamp_ns: int) -> tuple[CancelResult, list[Goal], Goal | None]:
        """Ask to cancel goals.

        Args:
            identity: Which one; empty, or all zeros, to name none.
            stamp_ns: All that were accepted up to then [ns since 1970]; 0 to name none by time.
                All there are where neither is named.

        Returns:
            The answer; the goals in it; and the one under way where it is among them, for which
            the caller stops the arm and then calls `stopped`.
        """
        with self._signal:
            self._forget()
            identity = "" if identity == NOBODY else identity
            if identity and not stamp_ns and (code := self._uncancelable(identity)):
                return CancelResult(code, ()), [], None
            chosen = [
                goal
                for goal in self._goals.values()
                if goal.identity == identity
                or goal.stamp_ns <= stamp_ns
                or not (identity or stamp_ns)
            ]
            canceled = [goal for goal in chosen if goal.cancelable]
            for goal in canceled:
                self._cancel(goal)
            answer = CancelResult(CancelCode.NONE, tuple(goal.identity for goal in canceled))
            return answer, canceled, self._running if self._running in canceled else None

    def stopped(self, goal: Goal) -> None:
        """Note that the stop of the arm for a goal is done."""
        with self._signal:
            goal.stops -= 1
            self._signal.notify()

    def take(self) -> Goal | None:
        """Wait for a goal and begin to execute it; None once there will be none any more."""
        with self._signal:
            while not self._waiting and not self._closed:
                self._signal.wait(None)
            if not self._waiting:
                return None
            self._running = goal = self._waiting.popleft()
            self._enter(goal, GoalState.EXECUTING)
            return goal

    def settle(self, goal: Goal) -> None:
        """Wait until no stop is under way for a goal."""
        with self._signal:
            self._settle(goal)

    def finish(self, goal: Goal, outcome: Outcome) -> None:
        """End the goal that is under way, and tell whoever waits for it."""
        with self._signal:
            self._settle(goal)  # a stop must not hit the goal after this one
            self._running = None
            waiters = [] if goal.outcome else self._end(goal, outcome)
        _call(waiters, outcome)

    def ends_in(self, goal: Goal, seconds: float) -> bool:
        """Wait for the end of a goal; whether it has ended in so long [s]."""
        until = self._clock.now() + seconds
        with self._signal:
            while goal.outcome is None and self._clock.now() < until:
                self._signal.wait(until)
            return goal.outcome is not None

    def give_up(self, goal: Goal, outcome: Outcome) -> bool:
        """End a goal that holds its owner, which it goes on to do, and all that wait for that."""
        with self._signal:
            if goal.outcome:
                return False
            waiters = self._end(goal, outcome)
            self._abort_waiting(_held(goal))
        _call(waiters, outcome)
        return True

    def result(self, identity: str, timeout: float | None) -> Outcome:
        """Wait for the outcome of a goal.

        Args:
            identity: Which.
            timeout: How long at most [s]; None for as long as it takes.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
            ResultTimeout: It has not ended in that time.
        """
        until = None if timeout is None else self._clock.now() + timeout
        with self._signal:
            goal = self.find(identity)
            while goal.outcome is None:
                if until is not None and timeout is not None and self._clock.now() >= until:
                    raise ResultTimeout(identity, timeout)
                self._signal.wait(until)
            return goal.outcome

    def on_result(self, identity: str, callback: Callable[[Outcome], None]) -> None:
        """Have the outcome of a goal told once, from any thread; at once if it has ended.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
        """
        with self._signal:
            goal = self.find(identity)
            if goal.outcome is None:
                goal.waiters.append(callback)
                return
        _call([callback], goal.outcome)

    def find(self, identity: str) -> Goal:
        """The goal of that name.

        Raises:
            UnknownGoal: There is none, or it is forgotten.
        """
        with self._signal:
            self._forget()
            if identity not in self._goals:
                raise UnknownGoal(identity)
            return self._goals[identity]

    @property
    def running(self) -> Goal | None:
        """The goal under way."""
        return self._running

    @property
    def waiting(self) -> tuple[str, ...]:
        """The goals that wait for their turn, the next one first."""
        with self._signal:
            return tuple(goal.identity for goal in self._waiting)

    def all(self, newest: int | None = None) -> tuple[GoalStatus, ...]:
        """All goals that are known, or the newest; in the order in which they were accepted."""
        with self._signal:
            self._forget()
            goals = [*islice(reversed(self._goals.values()), newest)]
            return tuple(goal.status for goal in reversed(goals))

    def close(self) -> None:
        """Take no more goals."""
        with self._signal:
            self._closed = True
            self._signal.notify()

    def _settle(self, goal: Goal) -> None:
        while goal.stops:
            self._signal.wait(None)

    def _refusal(self, identity: str, wrong: Exception | None) -> Cause | None:
        if self._closed:
            return cause_for(CLOSING, "the server is ending; start it again")
        if not _IDENTITY.fullmatch(identity):
            words = f"{identity!r} names no goal: 32 lower-case hexadecimal digits do"
            return cause_for(BAD_IDENTITY, words)
        if identity in self._goals:
            words = f"there is a goal {identity} already; every goal needs a name of its own"
            return cause_for(DUPLICATE, words)
        busy = self._running or next(iter(self._waiting), None)
        if busy and busy.outcome:
            return cause_of(_held(busy))
        if wrong:  # before what waiting would help against
            return cause_of(wrong)
        if busy and self.policy is Policy.REJECT:
            words = f"goal {busy.identity} for task {busy.task} is under way; wait, or cancel it"
            return cause_for(BUSY, words)
        if self.policy is Policy.QUEUE and len(self._waiting) >= WAITING:
            words = f"{WAITING} goals wait for their turn already; wait, or cancel some"
            return cause_for(QUEUE_FULL, words)
        return None

    def _preempt(self, identity: str) -> Goal | None:
        """Make room for a goal."""
        error = GoalPreempted(identity)
        self._abort_waiting(error)
        if running := self._running:
            running.stops += 1
            running.mailbox.fail(error)
        return running

    def _abort_waiting(self, error: Exception) -> None:
        ended, cause = list(self._waiting), cause_of(error)
        self._waiting.clear()
        for goal in ended:
            self._enter(goal, GoalState.EXECUTING)  # no goal is aborted before that
            self._end_waiting(goal, GoalState.ABORTED, cause)

    def _uncancelable(self, identity: str) -> CancelCode | None:
        goal = self._goals.get(identity)
        if goal is None:
            return CancelCode.UNKNOWN_GOAL_ID
        return None if goal.cancelable else CancelCode.GOAL_TERMINATED

    def _cancel(self, goal: Goal) -> None:
        self._enter(goal, GoalState.CANCELING)
        if goal is self._running:
            goal.stops += 1
            goal.mailbox.cancel()
        else:
            self._waiting.remove(goal)
            self._end_waiting(goal, GoalState.CANCELED, CANCELED_CAUSE)

    def _end_waiting(self, goal: Goal, state: GoalState, cause: Cause) -> None:
        spent = self._clock.now() - goal.accepted
        outcome = Outcome.of(goal.task, state, cause, duration=spent)
        _call(self._end(goal, outcome), outcome)

    def _end(self, goal: Goal, outcome: Outcome) -> list[Callable[[Outcome], None]]:
        goal.outcome, goal.ended = outcome, self._clock.now()
        goal.arguments = {}  # as large as their sender liked, and nobody needs them any more
        self._ended.append(goal)
        self._enter(goal, outcome.state)
        self._signal.notify()
        waiters, goal.waiters = goal.waiters, []
        return waiters

    def _enter(self, goal: Goal, state: GoalState) -> None:
        goal.enter(state)
        self._changed(goal.status)

    def _stamp(self, now: float) -> int:
        """The time of acceptance, another one for every goal [ns since 1970]."""
        self._last_ns = max(self._clock.epoch_ns() + round(now * 1e9), self._last_ns + 1)
        return self._last_ns

    def _forget(self) -> None:
        """Forget what was kept long enough, and the oldest of too many."""
        since = self._clock.now() - self.keep
        while self._ended and (len(self._ended) > KEPT or self._ended[0].ended <= since):
            del self._goals[self._ended.popleft().identity]


def _held(goal: Goal) -> ExecutorBlocked:
    cause = goal.outcome and goal.outcome.cause
    return ExecutorBlocked(goal.identity, goal.task, cause.node if cause else "")


def _call(waiters: list[Callable[[Outcome], None]], outcome: Outcome) -> None:
    for waiter in waiters:
        try:
            waiter(outcome)
        except Exception:  # somebody else's; the goal has ended all the same
            logger.exception("whoever waited for a result failed")
