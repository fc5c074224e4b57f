"""Values that only the clients return; the others are in `executive.api`."""

from collections.abc import Mapping
from typing import Any

from executive.api.events import Event, event_from_json
from hardware.loading.dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Task:
    """A task of a server.

    Attributes:
        number: Number of the task.
        name: Name of the task.
        description: One sentence.
        source: `shipped`, or the path of its file.
        parameters: Types of its parameters, by name.
        inputs: Properties of each parameter for a form, by name, as in `GET /api/tasks`.
        wrong: Mistakes of its file, in words; empty if the file is valid.
        retry_safe: True if the task may run again after a run with an unknown end.
    """

    number: int
    name: str
    description: str
    source: str
    parameters: Mapping[str, str]
    inputs: Mapping[str, Mapping[str, Any]]
    wrong: str
    retry_safe: bool = False

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "Task":
        """Return the task from the server's JSON."""
        first = ("task", "name", "description", "source", "parameters", "inputs")
        return cls(*(plain[key] for key in (*first, "wrong", "retry_safe")))


@dataclass(frozen=True, slots=True)
class OpenQuestion:
    """A question of a task that waits for an answer.

    Attributes:
        question_id: 8 hexadecimal digits.
        text: The question.
        choices: The possible answers; empty if any text is accepted.
    """

    question_id: str
    text: str
    choices: tuple[str, ...]

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "OpenQuestion":
        """Return the question from the server's JSON."""
        return cls(plain["question_id"], plain["text"], tuple(plain["choices"]))

    def __str__(self) -> str:
        choices = f" [{'/'.join(self.choices)}]" if self.choices else ""
        return f"{self.question_id}  {self.text}{choices}"


@dataclass(frozen=True, slots=True)
class PlannedTask:
    """A task that was checked and planned, without a motion of the arm.

    Attributes:
        events: The events of a run. The last event has the outcome.
        unknown: A message for each motion that is known only in a run.
    """

    events: tuple[Event, ...]
    unknown: tuple[str, ...]

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "PlannedTask":
        """Return the planned task from the server's JSON."""
        return cls(tuple(map(event_from_json, plain["events"])), tuple(plain["unknown"]))
