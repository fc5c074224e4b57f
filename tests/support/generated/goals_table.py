"""A queue of goals, and an executor that a test controls."""

from executive.api import Policy
from executive.api.outcome import Acceptance, CancelCode, GoalState, GoalStatus, Outcome
from executive.goals.goal import Goal
from executive.goals.queue import GoalQueue
from hardware import SimulatedClock


class Table:
    """A queue of goals, and an executor that the test controls."""

    def __init__(self, policy: Policy = Policy.QUEUE, keep: float = 900.0) -> None:
        self.clock = SimulatedClock()
        self.history: dict[str, list[int]] = {}
        self.goals = GoalQueue(self.clock, policy, keep, self._changed)

    def _changed(self, status: GoalStatus) -> None:
        if status.state is GoalState.ACCEPTED:  # a forgotten identity may be used again
            self.history[status.identity] = []
        self.history[status.identity].append(status.state.value)

    def pass_time(self, seconds: float) -> None:
        signal, until = self.clock.signal(), self.clock.now() + seconds
        with self.clock.working(), signal:
            while self.clock.now() < until:
                signal.wait(until)

    def send(self, identity: str = "") -> Acceptance:
        acceptance, preempted = self.goals.send(1, {}, identity)
        if preempted:
            self.goals.stopped(preempted)
        return acceptance

    def cancel(self, identity: str = "", stamp_ns: int = 0) -> tuple[CancelCode, list[str]]:
        answer, _, running = self.goals.cancel(identity, stamp_ns)
        if running:
            self.goals.stopped(running)
        return answer.code, list(answer.goals)

    def begin(self) -> Goal:
        goal = self.goals.take()
        assert goal
        return goal

    def end(self, state: GoalState) -> None:
        goal = self.goals.running
        assert goal
        self.goals.finish(goal, outcome(state))


def outcome(state: GoalState) -> Outcome:
    return Outcome.of(1, state, None)
