"""Loops, timeouts, guards and races, ticked on a clock that only the test advances."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from hardware import Robot, SimulatedClock
from skills import Context
from tests.conftest import Bench
from trees.nodes.composites import ReactiveSelector, ReactiveSequence
from trees.nodes.decorators import Timeout
from trees.nodes.guard import Guard
from trees.nodes.loops import LEAST_ROUND, Repeat, Retry, WaitFor
from trees.nodes.parallel import Race

S, F, R, INVALID = Status.SUCCESS, Status.FAILURE, Status.RUNNING, Status.INVALID


class Scripted(Behaviour):
    """Gives prepared answers, the last one again and again."""

    def __init__(self, *answers: Status) -> None:
        super().__init__("scripted")
        self.answers, self.begun, self.halted = list(answers), 0, 0

    def initialise(self) -> None:
        self.begun += 1

    def update(self) -> Status:
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]

    def terminate(self, new_status: Status) -> None:
        self.halted += self.status is R and new_status is INVALID


@pytest.fixture
def clock() -> SimulatedClock:
    return SimulatedClock()


@pytest.fixture
def context(robot: Robot, clock: SimulatedClock) -> Context:
    return Bench(robot, clock).context


def run(root: Behaviour, clock: SimulatedClock, context: Context, until: float = 60.0) -> Status:
    """Tick whenever the tree has asked for it, as the run loop does."""
    deadlines: list[float] = getattr(context.wake_at, "__self__")  # noqa: B009
    signal = clock.signal()
    with clock.working():
        root.tick_once()
        while root.status is R and deadlines and clock.now() < until:
            with signal:
                signal.wait(min(deadlines))
            deadlines.clear()
            root.tick_once()
    return root.status


def test_retry_pauses_and_doubles(clock: SimulatedClock, context: Context) -> None:
    child = Scripted(F, F, F, S)
    assert run(Retry("r", child, context, 5, 0.5), clock, context) is S
    assert child.begun == 4
    assert clock.now() == pytest.approx(0.5 + 1.0 + 2.0)


def test_retry_gives_up(clock: SimulatedClock, context: Context) -> None:
    retry = Retry("r", Scripted(F), context, 3, 0.0)
    assert run(retry, clock, context) is F
    assert retry.feedback_message == "3 of 3 attempts failed"
    assert clock.now() == pytest.approx(2 * LEAST_ROUND)


def test_repeat_counts(clock: SimulatedClock, context: Context) -> None:
    child = Scripted(S)
    assert run(Repeat("r", child, context, 3), clock, context) is S
    assert child.begun == 3


def test_repeat_ends_with_a_failure(clock: SimulatedClock, context: Context) -> None:
    assert run(Repeat("r", Scripted(S, S, F), context, None), clock, context) is F


def test_an_endless_repeat_lets_time_pass(clock: SimulatedClock, context: Context) -> None:
    endless = Timeout("t", Repeat("r", Scripted(S), context, None), context, 1.0)
    assert run(endless, clock, context) is F
    assert clock.now() == pytest.approx(1.0, abs=2 * LEAST_ROUND)


def test_a_timeout_halts(clock: SimulatedClock, context: Context) -> None:
    child = Scripted(R)
    timeout = Timeout("t", child, context, 2.0)
    assert run(timeout, clock, context) is F
    assert (clock.now(), child.halted) == (2.0, 1)
    assert timeout.failure
    assert timeout.failure.code == "task.timeout"


def test_a_timeout_in_time(clock: SimulatedClock, context: Context) -> None:
    timeout = Timeout("t", Scripted(S), context, 2.0)
    assert run(timeout, clock, context) is S
    assert timeout.failure is None


def test_wait_for(clock: SimulatedClock, context: Context) -> None:
    assert run(WaitFor("w", Scripted(F, F, S), context, 0.25), clock, context) is S
    assert clock.now() == pytest.approx(0.5)


def test_a_guard_pauses_and_begins_anew(clock: SimulatedClock, context: Context) -> None:
    child, condition = Scripted(R, R, S), Scripted(S, F, F, S)
    guard = Guard("g", [child, condition], context, "pause", 0.1)
    assert run(guard, clock, context) is S
    assert (child.begun, child.halted) == (2, 1)


def test_a_guard_fails(clock: SimulatedClock, context: Context) -> None:
    child = Scripted(R)
    guard = Guard("g", [child, Scripted(S, F)], context, "fail", 0.1)
    assert run(guard, clock, context) is F
    assert child.halted == 1


def test_a_guard_that_never_lets_in(clock: SimulatedClock, context: Context) -> None:
    child = Scripted(S)
    assert run(Guard("g", [child, Scripted(F)], context, "fail", 0.1), clock, context) is F
    assert child.begun == 0


def test_a_race_halts_the_others(clock: SimulatedClock, context: Context) -> None:
    slow = Scripted(R)
    assert run(Race("r", [slow, Scripted(F), Scripted(S)]), clock, context) is S
    assert slow.halted == 1


def test_a_race_that_all_lose(clock: SimulatedClock, context: Context) -> None:
    assert run(Race("r", [Scripted(F), Scripted(F)]), clock, context) is F


def test_reactive_nodes_ask_again(clock: SimulatedClock, context: Context) -> None:
    child = Scripted(R)
    sequence = ReactiveSequence("s", [Scripted(S, S, F), child], context)
    assert run(sequence, clock, context) is F
    assert child.halted == 1
    other = Scripted(R)
    assert run(ReactiveSelector("s", [Scripted(F, F, S), other], context), clock, context) is S
    assert other.halted == 1
