"""The queue of goals, compared with a simple model for random sequences of calls."""

from dataclasses import dataclass

import pytest
from hypothesis import settings, strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from executive.api import Policy
from executive.api.outcome import CancelCode, GoalState
from executive.errors import ResultTimeout
from tests.support.generated.goals_table import Table

S, C = GoalState, CancelCode
UNKNOWN_ID = "0" * 32
UNKNOWN = "f" * 32


@dataclass
class Known:
    state: GoalState
    stamp_ns: int
    ended: float = 0.0

    @property
    def over(self) -> bool:
        return self.state.value >= 4


KEEP = 30.0


class Model(RuleBasedStateMachine):
    """Random calls: the queue answers as the model does."""

    policy = Policy.QUEUE

    def __init__(self) -> None:
        super().__init__()
        self.table = Table(self.policy, KEEP)
        self.known: dict[str, Known] = {}
        self.waiting: list[str] = []
        self.running = ""
        self.names = 0

    def forget(self) -> None:
        now = self.table.clock.now()
        self.known = {
            name: goal
            for name, goal in self.known.items()
            if not (goal.over and now - goal.ended >= KEEP)
        }

    def close_one(self, name: str, state: GoalState) -> None:
        self.known[name].state, self.known[name].ended = state, self.table.clock.now()

    @rule(again=st.booleans())
    def send(self, again: bool) -> None:
        self.forget()
        self.names += not (again and self.names)
        name = f"{self.names:032x}"
        refused = name in self.known
        busy = self.policy is Policy.REJECT and bool(self.running or self.waiting)
        answer = self.table.send(name)
        assert answer.accepted == (not refused and not busy)
        if refused:
            assert answer.code == "goal.duplicate"
        if not answer.accepted:
            assert answer.stamp_ns == 0
            return
        if self.policy is Policy.PREEMPT:
            for other in self.waiting:
                self.close_one(other, S.ABORTED)
            self.waiting = []
        assert answer.stamp_ns > max((goal.stamp_ns for goal in self.known.values()), default=0)
        self.known[name] = Known(S.ACCEPTED, answer.stamp_ns)
        self.waiting.append(name)

    @precondition(lambda self: self.waiting and not self.running)
    @rule()
    def begin(self) -> None:
        self.running = self.waiting.pop(0)
        assert self.table.begin().identity == self.running
        self.known[self.running].state = S.EXECUTING

    @precondition(lambda self: self.running)
    @rule(state=st.sampled_from((S.SUCCEEDED, S.ABORTED, S.CANCELED)))
    def end(self, state: GoalState) -> None:
        canceling = self.known[self.running].state is S.CANCELING
        if state is S.CANCELED and not canceling:
            return
        self.table.end(state)
        self.close_one(self.running, state)
        self.running = ""

    @rule(data=st.data(), by_time=st.booleans(), off=st.integers(-1, 1))
    def cancel(self, data: st.DataObject, by_time: bool, off: int) -> None:
        self.forget()
        names = ["", UNKNOWN_ID, UNKNOWN, *self.known]
        name = data.draw(st.sampled_from(names))
        stamps = [goal.stamp_ns + off for goal in self.known.values()]
        stamp = data.draw(st.sampled_from(stamps)) if by_time and stamps else 0
        wanted = "" if name == UNKNOWN_ID else name
        code, listed = C.NONE, []
        if wanted and not stamp:
            goal = self.known.get(wanted)
            if goal is None:
                code = C.UNKNOWN_GOAL_ID
            elif goal.over or goal.state is S.CANCELING:
                code = C.GOAL_TERMINATED
            else:
                listed = [wanted]
        else:
            listed = [
                other
                for other, goal in self.known.items()
                if goal.state in (S.ACCEPTED, S.EXECUTING)
                and (not (wanted or stamp) or other == wanted or goal.stamp_ns <= stamp)
            ]
        assert self.table.cancel(name, stamp) == (code, listed)
        for other in listed:
            if other == self.running:
                self.known[other].state = S.CANCELING
            else:
                self.waiting.remove(other)
                self.close_one(other, S.CANCELED)

    @rule(seconds=st.sampled_from((1.0, 10.0, 40.0)))
    def pass_time(self, seconds: float) -> None:
        self.table.pass_time(seconds)

    @invariant()
    def the_same(self) -> None:
        self.forget()
        reported = [(s.identity, s.state, s.stamp_ns) for s in self.table.goals.all()]
        assert reported == [(name, goal.state, goal.stamp_ns) for name, goal in self.known.items()]
        current, *behind = [self.running, *self.waiting] if self.running else [*self.waiting, ""]
        found = self.table.goals.current
        assert (found.identity if found else "") == current
        assert list(self.table.goals.waiting) == [name for name in behind if name]
        running = self.table.goals.running
        assert (running.identity if running else "") == self.running
        for name, goal in self.known.items():
            if goal.over:
                assert self.table.goals.result(name, 0.0).state is goal.state
            else:
                with pytest.raises(ResultTimeout):
                    self.table.goals.result(name, 0.0)
        for past in self.table.history.values():
            assert sum(state >= 4 for state in past) <= 1


class Rejecting(Model):
    policy = Policy.REJECT


class Preempting(Model):
    policy = Policy.PREEMPT


TestQueue, TestReject, TestPreempt = Model.TestCase, Rejecting.TestCase, Preempting.TestCase
for case in (TestQueue, TestReject, TestPreempt):
    case.settings = settings(max_examples=40, stateful_step_count=30, deadline=None)
del case
