"""A parallel waits for all its children, whatever they answer."""

import itertools

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from trees.nodes.parallel import Join

S, F, R, INVALID = Status.SUCCESS, Status.FAILURE, Status.RUNNING, Status.INVALID


class Scripted(Behaviour):
    """Gives prepared answers, and notes what is done to it."""

    def __init__(self, *answers: Status) -> None:
        super().__init__("scripted")
        self.answers = list(answers)
        self.done: list[str] = []

    def initialise(self) -> None:
        self.done.append("initialise")

    def update(self) -> Status:
        self.done.append("update")
        return self.answers.pop(0)

    def terminate(self, new_status: Status) -> None:
        self.done.append(f"terminate {new_status.name}")


def tick(join: Join) -> Status:
    join.tick_once()
    return join.status


@pytest.mark.parametrize("ends", list(itertools.product((S, F), repeat=3)))
def test_all_end_before_it_is_judged(ends: tuple[Status, ...]) -> None:
    children = [Scripted(*[R] * wait, end) for wait, end in enumerate(ends)]
    join = Join("join", children)
    assert [tick(join), tick(join)] == [R, R]
    assert tick(join) is (F if F in ends else S)
    assert [child.status for child in children] == list(ends)
    assert [child.done.count("update") for child in children] == [1, 2, 3]


def test_who_has_ended_is_left_alone() -> None:
    first, second = Scripted(F), Scripted(R, R, S)
    join = Join("join", [first, second])
    assert [tick(join) for _ in range(3)] == [R, R, F]
    assert first.done == ["initialise", "update", "terminate FAILURE"]
    assert second.done == ["initialise", "update", "update", "update", "terminate SUCCESS"]


def test_interrupted() -> None:
    ended, running = Scripted(S), Scripted(R)
    join = Join("join", [ended, running])
    tick(join)
    join.stop(INVALID)
    assert {join.status, ended.status, running.status} == {INVALID}
    assert running.done[-1] == "terminate INVALID"


def test_again_after_it_ended() -> None:
    children = [Scripted(F, S), Scripted(S, R, S)]
    join = Join("join", children)
    assert [tick(join) for _ in range(3)] == [F, R, S]


def test_again_after_an_interrupt() -> None:
    children = [Scripted(S, S), Scripted(R, S)]
    join = Join("join", children)
    tick(join)
    join.stop(INVALID)
    assert tick(join) is S
    assert children[1].done.count("initialise") == 2


def test_a_child_without_an_answer_is_no_success() -> None:
    assert tick(Join("join", [Scripted(S), Scripted(INVALID)])) is F


def test_within_each_other() -> None:
    inner = Join("inner", [Scripted(R, F), Scripted(S)])
    outer = Join("outer", [inner, Scripted(R, R, S)])
    assert [tick(outer) for _ in range(3)] == [R, R, F]


def test_without_children() -> None:
    assert tick(Join("join", [])) is S


def test_the_tip_is_a_child() -> None:
    running = Scripted(R)
    join = Join("join", [Scripted(S), running])
    tick(join)
    assert join.tip() is running
