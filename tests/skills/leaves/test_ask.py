"""The skill that asks the operator."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from py_trees.common import Status

from skills import BadQuestion, ConditionFails, Operator, Question, Unanswered
from skills.leaves.ask import Ask
from tests.conftest import Bench


class Desk:
    """An operator that keeps the questions."""

    def __init__(self) -> None:
        self.asked: list[Question] = []
        self.withdrawn: list[Question] = []

    def ask(self, question: Question) -> None:
        self.asked.append(question)

    def withdraw(self, question: Question) -> None:
        self.withdrawn.append(question)


def asking(bench: Bench, operator: Operator, **inputs: object) -> Ask:
    bench.context = replace(bench.context, operator=operator)
    given = {"question": "Free?", "choices": ["yes", "no"], "wanted": "", "within": 5.0}
    skill: Ask = bench.skill(Ask, **{**given, **inputs})
    return skill


def test_it_waits_for_the_answer_and_writes_it(bench: Bench) -> None:
    desk = Desk()
    skill = asking(bench, desk)
    skill.tick_once()
    assert (skill.status, skill.feedback_message) == (Status.RUNNING, "Free? [yes/no]")
    wakes = bench.wakes
    assert desk.asked[0].answer(" No ")
    assert bench.wakes == wakes + 1
    skill.tick_once()
    assert skill.status is Status.SUCCESS
    assert bench.output("answer") == "no"
    assert desk.withdrawn == desk.asked


def test_another_answer_than_wanted_fails(bench: Bench) -> None:
    desk = Desk()
    skill = asking(bench, desk, wanted="yes")
    skill.tick_once()
    desk.asked[0].answer("no")
    skill.tick_once()
    assert isinstance(skill.failure, ConditionFails)
    assert str(skill.failure) == "Free?: the answer is no; only yes succeeds"


def test_no_answer_in_time(bench: Bench) -> None:
    desk = Desk()
    skill = asking(bench, desk, within=0.0)
    skill.tick_once()
    assert isinstance(skill.failure, Unanswered)
    assert "no answer within 0 s" in str(skill.failure)
    assert desk.withdrawn == desk.asked


def test_time_stands_still_while_the_run_is_paused(bench: Bench) -> None:
    paused, now = 0.0, 0.0
    skill = asking(bench, Desk())
    clock = SimpleNamespace(now=lambda: now)
    skill.context = replace(skill.context, clock=clock, paused_time=lambda: paused)
    skill.tick_once()
    now, paused = 9.0, 5.0
    skill.tick_once()
    assert skill.status is Status.RUNNING
    now = 10.0
    skill.tick_once()
    assert isinstance(skill.failure, Unanswered)


def test_no_operator(bench: Bench) -> None:
    skill = bench.skill(Ask, question="Free?", choices=["yes"], wanted="", within=5.0)
    skill.tick_once()
    assert str(skill.failure) == "Free?: there is no operator here"


def test_a_halt_withdraws_the_question(bench: Bench) -> None:
    desk = Desk()
    skill = asking(bench, desk)
    skill.tick_once()
    assert not desk.withdrawn
    skill.stop(Status.INVALID)
    assert desk.withdrawn == desk.asked


@pytest.mark.parametrize(
    ("choices", "words", "answer"),
    [
        (("left", "level"), "LEFT", "left"),
        (("left", "level"), "lev", "level"),
        (("left", "level"), "le", None),
        (("in", "inside"), "in", "in"),
        (("left",), "", None),
        (("left",), "right", None),
        ((), " any words ", "any words"),
        ((), " ", None),
    ],
)
def test_what_counts_as_an_answer(choices: tuple[str, ...], words: str, answer: str | None) -> None:
    question = Question("Where?", choices, lambda: None)
    assert question.answer(words) is (answer is not None)
    assert question.answered == answer


def test_the_first_answer_counts() -> None:
    question = Question("Free?", ("yes", "no"), lambda: None)
    assert question.answer("yes")
    assert question.answer("no")
    assert question.answered == "yes"


def test_an_answer_that_cannot_be_given_is_refused_beforehand(bench: Bench) -> None:
    with pytest.raises(BadQuestion, match="maybe is wanted, but the choices are yes, no"):
        Ask.validate(bench.robot, {"wanted": "maybe", "choices": ["yes", "no"]})
    Ask.validate(bench.robot, {"wanted": "maybe", "choices": []})
