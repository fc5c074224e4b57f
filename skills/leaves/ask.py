"""A leaf that asks the operator."""

from collections.abc import Mapping, Sequence
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills.base import Skill
from skills.errors import BadQuestion, ConditionFails, Unanswered, refuse
from skills.ports import Port
from skills.question import Question

_CHOICES = ["yes", "no"]


class Ask(Skill):
    """Ask the operator and wait for the answer. Fail if there is none, or not the wanted one."""

    validates_partial = True
    phase = "asking"

    INPUT_PORTS = {
        "question": Port(str, description="question to ask"),
        "choices": PortInformation(
            list[str], default_value=_CHOICES, description="allowed answers; [] for any text"
        ),
        "wanted": Port(
            str, description="the only answer that succeeds; empty for any", default_value=""
        ),
        "within": Port(
            float,
            description="longest time to wait [s]",
            unit="s",
            least=0.001,
            most=86_400.0,
            default_value=60.0,
        ),
    }
    OUTPUT_PORTS = {"answer": Port(str, description="the answer")}

    _question: Question | None = None
    _deadline = 0.0

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check that the question is valid and that the wanted answer is possible."""
        errors = list[BadQuestion]()
        if not inputs.get("question", "?").strip():
            errors.append(BadQuestion("there is no question").at("question"))
        wanted, choices = inputs.get("wanted", ""), inputs.get("choices", [])
        for index, choice in enumerate(choices):
            if choice is not None and (why := _choice_error(choice, choices[:index])):
                errors.append(BadQuestion(why).at("choices", index))
        if wanted and choices and wanted not in choices and None not in choices:
            why = f"{wanted} is wanted, but the choices are {', '.join(choices)}"
            errors.append(BadQuestion(why).at("wanted"))
        refuse(errors)

    def on_start(self) -> Status:
        """Ask the question."""
        self._deadline = self.context.now() + self.get_input("within")
        choices = tuple(self.get_input("choices"))
        self._question = Question(self.get_input("question"), choices, self.context.wake)
        self.feedback_message = str(self._question)
        self.context.operator.ask(self._question)
        return self.on_running()

    def on_running(self) -> Status:
        """Process the answer if there is one. Fail if the deadline has passed."""
        question = self._question
        assert question
        if question.answered is not None:
            return self._finish(question.answered)
        if question.rejected:
            raise Unanswered(f"{question.text}: {question.rejected}")
        if self.context.now() >= self._deadline:
            self.on_halt()
            within = self.get_input("within")
            raise Unanswered(f"{question.text}: no answer within {within:g} s")
        self.context.wake_at(self._deadline)
        return Status.RUNNING

    def on_halt(self) -> None:
        """Remove the question from the operator's view."""
        if self._question:
            self.context.operator.withdraw(self._question)

    def _finish(self, answer: str) -> Status:
        self.on_halt()
        self._set_output("answer", answer)
        self.feedback_message = f"{self.get_input('question')}: {answer}"
        if (wanted := self.get_input("wanted")) and answer != wanted:
            why = f"the answer is {answer}; only {wanted} succeeds"
            raise ConditionFails(f"{self.get_input('question')}: {why}")
        return Status.SUCCESS


def _choice_error(choice: str, before: Sequence[str | None]) -> str:
    """Return the error of a choice, or "" if it is valid."""
    if not choice.strip():
        return "a choice is empty"
    return f"the choice {choice} is given twice" if choice in before else ""
