"""The goals that are known: against the answers of a real action server, and against a model."""

import math
import threading
from dataclasses import dataclass

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from executive.errors import ResultTimeout, UnknownGoal
from executive.goal import Goal, GoalState, GoalStatus, Outcome
from executive.goals import Acceptance, CancelCode, Goals, Policy
from hardware import SimulatedClock

S, C = GoalState, CancelCode
NOBODY = "0" * 32
UNKNOWN = "f" * 32


class Table:
    """Goals, and somebody who executes them when the test says so."""

    def __init__(self, policy: Policy = Policy.QUEUE, keep: float = 900.0) -> None:
        self.clock = SimulatedClock()
        self.history: dict[str, list[int]] = {}
        self.goals = Goals(self.clock, policy, keep, self._changed)

    def _changed(self, status: GoalStatus) -> None:
        if status.state is S.ACCEPTED:  # a name that is forgotten may be used again
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
        answer, running = self.goals.cancel(identity, stamp_ns)
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
    return Outcome(1, state, "ok", "", 0, 0.0, "")


# What a real server (rclpy) answers, one after the other


def test_a_short_goal() -> None:
    table = Table()
    answer = table.send("a" * 32)
    assert answer.accepted
    assert answer.stamp_ns == table.clock.epoch_ns()
    table.begin()
    table.end(S.SUCCEEDED)
    assert table.goals.result("a" * 32, None).state.value == 4
    assert table.history["a" * 32] == [1, 2, 4]


def test_the_same_name_again_is_refused_also_after_the_end() -> None:
    table = Table()
    table.send("a" * 32)
    assert refused_as_duplicate(table.send("a" * 32))
    table.begin()
    table.end(S.SUCCEEDED)
    assert refused_as_duplicate(table.send("a" * 32))


def refused_as_duplicate(answer: Acceptance) -> bool:
    return (answer.accepted, answer.stamp_ns, answer.code) == (False, 0, "goal.duplicate")


def test_a_result_of_nobody() -> None:
    with pytest.raises(UnknownGoal):
        Table().goals.result(UNKNOWN, None)
    with pytest.raises(UnknownGoal):
        Table().goals.on_result(UNKNOWN, print)


def test_cancels_that_cancel_nothing() -> None:
    table = Table()
    assert table.cancel(UNKNOWN) == (C.UNKNOWN_GOAL_ID, [])
    assert table.cancel() == (C.NONE, [])
    assert table.cancel(NOBODY) == (C.NONE, [])
    done = table.send().identity
    table.begin()
    table.end(S.SUCCEEDED)
    assert table.cancel(done) == (C.GOAL_TERMINATED, [])
    assert table.cancel() == (C.NONE, [])
    assert table.cancel(UNKNOWN, 5) == (C.NONE, [])
    assert [code.value for code in C] == [0, 1, 2, 3]


def test_cancel_all() -> None:
    table = Table()
    one, other = table.send().identity, table.send().identity
    table.begin()
    assert table.cancel() == (C.NONE, [one, other])
    table.end(S.CANCELED)
    assert [table.goals.result(g, None).state.value for g in (one, other)] == [5, 5]
    assert table.history == {one: [1, 2, 3, 5], other: [1, 3, 5]}


def test_cancel_by_time_compares_the_stamp_that_was_answered() -> None:
    table = Table()
    a, b, c = (table.send() for _ in range(3))
    table.begin()
    assert table.cancel(stamp_ns=a.stamp_ns - 1) == (C.NONE, [])
    assert table.cancel(stamp_ns=a.stamp_ns) == (C.NONE, [a.identity])
    assert table.cancel(c.identity, a.stamp_ns) == (C.NONE, [c.identity])
    table.end(S.CANCELED)
    table.begin()
    table.end(S.SUCCEEDED)
    ends = [table.goals.result(goal.identity, None).state.value for goal in (a, b, c)]
    assert ends == [5, 4, 5]


def test_cancel_by_time_takes_the_one_of_that_time_too() -> None:
    table = Table()
    a, b, c = (table.send() for _ in range(3))
    assert table.cancel(stamp_ns=b.stamp_ns) == (C.NONE, [a.identity, b.identity])
    assert table.cancel(a.identity, c.stamp_ns) == (C.NONE, [c.identity])


def test_cancel_twice() -> None:
    table = Table()
    goal = table.send().identity
    table.begin()
    assert table.cancel(goal) == (C.NONE, [goal])
    assert table.cancel(goal) == (C.GOAL_TERMINATED, [])
    assert table.cancel() == (C.NONE, [])
    table.end(S.CANCELED)
    assert table.goals.result(goal, None).state.value == 5


@pytest.mark.parametrize("end", [S.SUCCEEDED, S.ABORTED, S.CANCELED])
def test_a_goal_that_is_being_canceled_may_end_in_any_way(end: GoalState) -> None:
    table = Table()
    goal = table.send().identity
    table.begin()
    table.cancel()
    table.end(end)
    assert table.history[goal] == [1, 2, 3, end.value]


def test_two_askers_before_the_end_and_one_after() -> None:
    table = Table()
    goal = table.send().identity
    told: list[Outcome] = []
    table.begin()

    def ask() -> None:
        told.append(table.goals.result(goal, None))

    with table.clock.working():
        askers = [table.clock.spawn(ask, "asker") for _ in range(2)]
        table.goals.on_result(goal, told.append)
        assert told == []
        table.end(S.SUCCEEDED)
        for asker in askers:
            asker.join()
    ask()
    table.goals.on_result(goal, told.append)
    assert [one.state.value for one in told] == [4] * 5


def test_whoever_fails_to_be_told_keeps_it_from_nobody() -> None:
    table = Table()
    goal = table.send().identity
    told: list[Outcome] = []
    table.begin()
    table.goals.on_result(goal, lambda _: 1 // 0)  # type: ignore[arg-type]
    table.goals.on_result(goal, told.append)
    table.end(S.SUCCEEDED)
    assert len(told) == 1


def test_the_all_zero_name_is_one_like_any_other() -> None:
    assert Table().send(NOBODY).accepted


def test_a_late_joiner_gets_all_goals() -> None:
    table = Table()
    sent = [table.send().identity for _ in range(9)]
    for _ in range(5):
        table.begin()
        table.end(S.SUCCEEDED)
    assert [status.identity for status in table.goals.all()] == sent
    assert [status.state.value for status in table.goals.all()] == [4] * 5 + [1] * 4


def test_results_are_forgotten_in_time() -> None:
    table = Table(keep=10.0)
    goal = table.send().identity
    table.begin()
    table.pass_time(60.0)  # only the end counts
    table.end(S.SUCCEEDED)
    for _ in range(3):
        table.pass_time(3.0)
        assert table.goals.result(goal, None).state is S.SUCCEEDED
    table.pass_time(1.0)
    with pytest.raises(UnknownGoal):
        table.goals.result(goal, None)
    assert table.cancel(goal)[0] is C.UNKNOWN_GOAL_ID
    assert table.goals.all() == ()


@pytest.mark.parametrize(("keep", "known"), [(0.0, 0), (math.inf, 1)])
def test_results_can_be_kept_for_ever_or_not_at_all(keep: float, known: int) -> None:
    table = Table(keep=keep)
    goal = table.send().identity
    table.begin()
    told: list[Outcome] = []
    table.goals.on_result(goal, told.append)
    table.end(S.SUCCEEDED)
    table.pass_time(1e6)
    assert len(told) == 1  # who has asked before is told in any case
    assert len(table.goals.all()) == known


def test_asking_ends_in_time() -> None:
    table = Table()
    goal = table.send().identity
    with table.clock.working(), pytest.raises(ResultTimeout, match="within 2 s") as caught:
        table.goals.result(goal, 2.0)
    assert isinstance(caught.value, TimeoutError)
    assert table.clock.now() == pytest.approx(2.0)


@pytest.mark.parametrize("name", ["1", "A" * 32, "a" * 33, "g" * 32, "a" * 31 + "\n", " " * 32])
def test_a_name_is_32_digits(name: str) -> None:
    answer = Table().send(name)
    assert (answer.accepted, answer.code) == (False, "goal.bad_id")


# A second goal


def test_a_second_goal_is_refused() -> None:
    table = Table(Policy.REJECT)
    first = table.send().identity
    second = table.send()  # while the first waits to begin
    assert (second.accepted, second.stamp_ns, second.code) == (False, 0, "goal.busy")
    assert first in second.message
    table.begin()
    assert table.send().code == "goal.busy"
    table.cancel()
    assert table.send().code == "goal.busy"  # not before the arm stands
    table.end(S.CANCELED)
    assert table.send().accepted


def test_a_second_goal_takes_the_place_of_those_before() -> None:
    table = Table(Policy.PREEMPT)
    first = table.send().identity
    running = table.begin()
    second, third = table.send().identity, table.send().identity
    assert getattr(running.mailbox.fault, "code", "") == "goal.preempted"
    assert table.goals.result(second, None).code == "goal.preempted"
    assert table.history[second] == [1, 2, 6]
    table.end(S.ABORTED)
    assert table.begin().identity == third
    assert table.history[first] == [1, 2, 6]


def test_what_is_preempted_first_stays_so() -> None:
    table = Table(Policy.PREEMPT)
    table.send()
    running = table.begin()
    second = table.send().identity
    table.send()
    assert second in str(running.mailbox.fault)


def test_no_goal_begins_before_the_stop_for_the_last_one_is_done() -> None:
    table = Table()
    table.send()
    table.begin()
    _, running = table.goals.cancel("", 0)
    assert running
    ended = threading.Event()

    def end() -> None:
        table.end(S.CANCELED)
        ended.set()

    with table.clock.working():
        thread = table.clock.spawn(end, "owner")
        assert not ended.wait(0.05)
        table.goals.stopped(running)
        thread.join()


def test_closed() -> None:
    table = Table()
    table.goals.close()
    assert table.send().code == "server.closing"
    assert table.goals.take() is None


# A model of it


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
    """Anything in any order: what the table says is what a few lines say."""

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
        names = ["", NOBODY, UNKNOWN, *self.known]
        name = data.draw(st.sampled_from(names))
        stamps = [goal.stamp_ns + off for goal in self.known.values()]
        stamp = data.draw(st.sampled_from(stamps)) if by_time and stamps else 0
        wanted = "" if name == NOBODY else name
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
        told = [(s.identity, s.state, s.stamp_ns) for s in self.table.goals.all()]
        assert told == [(name, goal.state, goal.stamp_ns) for name, goal in self.known.items()]
        assert list(self.table.goals.waiting) == self.waiting
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
