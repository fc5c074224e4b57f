"""PlanningSkill the person beside the arm."""

from collections.abc import Mapping, Sequence
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills.base import Skill
from skills.errors import BadQuestion, ConditionFails, Unanswered, refuse
from skills.operator import Question
from skills.ports import Port

_CHOICES = ["yes", "no"]


def _bad_choice(choice: str, before: Sequence[str | None]) -> str:
    """Why there is no such choice; empty where there may be."""
    if not choice.strip():
        return "a choice is empty"
    return f"the choice {choice} is given twice" if choice in before else ""


class Ask(Skill):
    """Ask the operator, and wait for the answer; fail without one, or with another than wanted."""

    validates_partial = True
    doing = "asking"

    INPUT_PORTS = {
        "question": Port(str, description="what to ask"),
        "choices": PortInformation(
            list[str], default_value=_CHOICES, description="answers; [] for any words"
        ),
        "wanted": Port(str, description="the answer that succeeds; any if empty", default_value=""),
        "within": Port(
            float,
            description="how long to wait [s]",
            unit="s",
            least=0.001,
            most=86_400.0,
            default_value=60.0,
        ),
    }
    OUTPUT_PORTS = {"answer": Port(str, description="what was answered")}

    _question: Question | None = None
    _until = 0.0

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Refuse what cannot be asked, and a wanted answer that cannot be given."""
        wrong = list[BadQuestion]()
        if not inputs.get("question", "?").strip():
            wrong.append(BadQuestion("there is no question").at("question"))
        wanted, there = inputs.get("wanted", ""), inputs.get("choices", [])
        for number, choice in enumerate(there):
            if choice is not None and (why := _bad_choice(choice, there[:number])):
                wrong.append(BadQuestion(why).at("choices", number))
        if wanted and there and wanted not in there and None not in there:
            why = f"{wanted} is wanted, but the choices are {', '.join(there)}"
            wrong.append(BadQuestion(why).at("wanted"))
        refuse(wrong)

    def on_start(self) -> Status:
        """Put the question."""
        within = self.get_input("within")
        self._until = self.context.now() + within
        choices = tuple(self.get_input("choices"))
        self._question = Question(self.get_input("question"), choices, self.context.wake)
        self.feedback_message = str(self._question)
        self.context.operator.ask(self._question)
        return self.on_running()

    def on_running(self) -> Status:
        """Look for the answer, then at the clock."""
        question = self._question
        assert question
        if question.answered is not None:
            return self._take(question.answered)
        if question.rejected:
            raise Unanswered(f"{question.text}: {question.rejected}")
        if self.context.now() >= self._until:
            self.on_halt()
            within = self.get_input("within")
            raise Unanswered(f"{question.text}: nobody answered within {within:g} s")
        self.context.wake_at(self._until)
        return Status.RUNNING

    def on_halt(self) -> None:
        """Withdraw the question."""
        if self._question:
            self.context.operator.withdraw(self._question)

    def _take(self, answer: str) -> Status:
        self.on_halt()
        self._set_output("answer", answer)
        self.feedback_message = f"{self.get_input('question')}: {answer}"
        if (wanted := self.get_input("wanted")) and answer != wanted:
            raise ConditionFails(f"{self.get_input('question')}: {answer}, and not {wanted}")
        return Status.SUCCESS
