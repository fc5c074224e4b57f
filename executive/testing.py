"""Test tasks and skills on the virtual board in simulated time, in a few lines of pytest.

with SimulatedArm(trees=Path("trees"), skills=Path("skills")) as arm:
    arm.replace("door_closed", lambda: True)
    assert arm.run(3, swing="10 deg").success
    assert arm.said("greet") == ["done"]
"""

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import logs
from hardware import SimulatedClock, load_robot
from skills import Question
from skills.motion import Pool
from trees.compile.port_types import known_skills

from .api.events import Event, QuestionStatus
from .api.outcome import GoalStatus, Outcome
from .session import load_own_skills, open_executive
from .setup import Setup
from .task_runner import TaskRunner


class SharedPool(Pool):
    """Planners for several executives, one after the other. Only the first `start` starts them."""

    _started = False

    def start(self) -> None:
        """Start the planners, if they are not started."""
        if not self._started:
            self._started = True
            super().start()


class _Script:
    """An operator that gives prepared answers."""

    def __init__(self, answers: list[str]) -> None:
        self._answers = answers

    def ask(self, question: Question) -> None:
        """Give the next answer, if there is one."""
        if self._answers:
            words = self._answers.pop(0)
            assert question.answer(words), f"{words} is not an answer to: {question}"

    def withdraw(self, question: Question) -> None:
        """Do nothing."""


class SimulatedArm:
    """An arm on the virtual board, in simulated time, which jumps when all threads wait.

    Args:
        trees: Folder with task files of your own; None for the shipped tasks only.
        skills: Folder with skills of your own; None for the shipped and installed skills only.
        robot: Robot file; None for the shipped robot.

    Attributes:
        answers: Answers of the operator, one per question. Further questions stay unanswered.
        records: All records, in order.
        clock: The simulated clock.

    Raises:
        ValueError: A skill in the folder is broken.
    """

    def __init__(
        self, trees: Path | None = None, skills: Path | None = None, robot: Path | None = None
    ) -> None:
        load_own_skills(skills)
        self._setup = Setup(robot=load_robot(robot), trees=trees, reload=False, single_user=True)
        self._replaced: list[tuple[Any, Callable[..., Any]]] = []
        self.clock = SimulatedClock()
        self.records: list[logs.Record] = []
        self.answers: list[str] = []

    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory()
        self._setup = dataclasses.replace(self._setup, recordings=Path(self._folder.name))
        self._pool = SharedPool(self._setup.load_robot(), 1, self.clock)
        return self

    def __exit__(self, *raised: object) -> None:
        for kind, function in self._replaced:
            kind.function = staticmethod(function)
        with self.clock.working():
            self._pool.close()
        self._folder.cleanup()

    def replace(self, name: str, function: Callable[..., Any]) -> None:
        """Replace a registered function until the end of the context.

        Raises:
            KeyError: No function is registered under that name.
        """
        kind: Any = known_skills().get(name)
        if not hasattr(kind, "function"):
            raise KeyError(f"{name} is not a registered function")
        self._replaced.append((kind, kind.function))
        kind.function = staticmethod(function)

    def run(self, task: int | str, /, **arguments: Any) -> Outcome:
        """Run a task in simulated time and return its outcome.

        Args:
            task: Number or name of the task.
            arguments: Values of its parameters, as in a task file.

        Raises:
            UnknownTask: No task has that number or name.
        """
        link = self._setup.load_robot().simulated_link(self.clock)
        with (
            self.clock.working(),
            open_executive(
                self._setup,
                clock=self.clock,
                link=link,
                pool=self._pool,
                operator=_Script(self.answers),
                subscriber=self._watch,
            ) as executive,
        ):
            executive.start()
            return TaskRunner(executive).run(task, arguments)

    def _watch(self, event: Event) -> None:
        if not isinstance(event, GoalStatus | QuestionStatus):
            self.records.append(event)

    def said(self, name: str) -> list[str]:
        """Return the messages of the nodes with that name: one each time such a node ended."""
        nodes = [record for record in self.records if isinstance(record, logs.NodeStatus)]
        done = ("SUCCESS", "FAILURE")
        ended = [node for node in nodes if node.name == name and node.status in done]
        return [node.message for node in ended]

    @property
    def frames(self) -> list[str]:
        """The sent frames as text; binary frames in hexadecimal digits."""
        return [record.text for record in self.records if isinstance(record, logs.Sent)]
