"""The states of a goal are ROS 2's: every step of its table, and no other."""

import itertools

import pytest
from hypothesis import settings, strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from executive.api.outcome import GoalState, Outcome
from executive.goals.goal import NEXT, Goal
from executive.goals.mailbox import Mailbox
from hardware import SimulatedClock

TERMINAL = {GoalState.SUCCEEDED, GoalState.CANCELED, GoalState.ABORTED}

# The edges of rcl_action's goal state machine, by event.
STEPS = {
    (GoalState.ACCEPTED, GoalState.EXECUTING),
    (GoalState.ACCEPTED, GoalState.CANCELING),
    (GoalState.EXECUTING, GoalState.CANCELING),
    (GoalState.EXECUTING, GoalState.SUCCEEDED),
    (GoalState.EXECUTING, GoalState.ABORTED),
    (GoalState.CANCELING, GoalState.SUCCEEDED),
    (GoalState.CANCELING, GoalState.ABORTED),
    (GoalState.CANCELING, GoalState.CANCELED),
}


def new() -> Goal:
    return Goal("0" * 32, 1, {}, 0.0, 1, Mailbox(SimulatedClock()))


def goal(state: GoalState) -> Goal:
    made = new()
    made.state = state
    return made


def test_the_numbers_are_ros_2s() -> None:
    names = ["ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED"]
    assert [state.name for state in GoalState] == names
    assert [state.value for state in GoalState] == [1, 2, 3, 4, 5, 6]


def test_the_table() -> None:
    assert {(start, end) for start, ends in NEXT.items() for end in ends} == STEPS
    assert set(NEXT) == set(GoalState)


@pytest.mark.parametrize(("start", "end"), list(itertools.product(GoalState, repeat=2)))
def test_every_step(start: GoalState, end: GoalState) -> None:
    made = goal(start)
    if (start, end) in STEPS:
        made.enter(end)
        assert made.state is end
    else:
        with pytest.raises(ValueError, match=f"{start.name} cannot become {end.name}"):
            made.enter(end)
        assert made.state is start


class Goals(RuleBasedStateMachine):
    """Any wishes in any order: one terminal state, reached once."""

    def __init__(self) -> None:
        super().__init__()
        self.goal = new()
        self.been = [GoalState.ACCEPTED]

    @rule(state=st.sampled_from(GoalState))
    def wish(self, state: GoalState) -> None:
        try:
            self.goal.enter(state)
        except ValueError:
            return
        self.been.append(state)

    @invariant()
    def one_way(self) -> None:
        assert self.goal.state is self.been[-1]
        assert len(set(self.been)) == len(self.been) <= 4
        assert not TERMINAL & set(self.been[:-1])
        assert set(itertools.pairwise(self.been)) <= STEPS
        if GoalState.CANCELED in self.been:
            assert GoalState.CANCELING in self.been


TestGoals = Goals.TestCase
TestGoals.settings = settings(max_examples=50, stateful_step_count=12, deadline=None)


@pytest.mark.parametrize("state", sorted(TERMINAL, key=str))
def test_only_succeeded_is_success(state: GoalState) -> None:
    outcome = Outcome.of(1, state, None)
    assert outcome.success == (state is GoalState.SUCCEEDED)
