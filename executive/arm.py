"""An arm in a Python program or a notebook, without a server.

with armtree.Arm() as arm:
    result = arm.run("pick")
"""

import json
import uuid
import weakref
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Lock
from typing import Any, Self

from hardware import VIRTUAL, SerialLink, load_robot
from skills import Operator

from .codes import OK
from .errors import GoalFailed, ResultTimeout, UnknownGoal
from .executive import Executive
from .goals.outcome import GoalState, Outcome
from .session import finish_recording, load_own_skills, open_executive
from .setup import Setup

OWN_TREES = Path("trees")  # as on the command line
_SLICE = 0.5  # longest single wait for an outcome, so that Ctrl-C is noticed [s]


class Arm:
    """An arm that runs tasks. The first task activates it; `close` shuts it down.

    Args:
        port: Serial port such as `/dev/ttyACM0`; default: a virtual Arduino, which moves nothing.
        robot: Robot file; default: the shipped Arduinobot.
        trees: Folder with task files of your own; default: `./trees`, if it exists.
        skills: Folder with Python files of skills of your own.
        recordings: Folder for recordings.
        seed: Seed of planning, from 1.
        pose: Confirmed position of the arm, `boot` or `last`; needed if opening the port does not
            reset the board.
        operator: Answers the questions of tasks (`Ask`); default: none does.

    Attributes:
        executive: Runs the tasks; it can also pause, resume and report.

    Raises:
        ValueError: An argument is invalid, or a skill is broken.
        HardwareError: The robot file is wrong or names no driver, the port cannot be opened, or the
            pose is not confirmed.
        TreeError: The folder of tasks cannot be read.
    """

    def __init__(
        self,
        port: str = VIRTUAL,
        robot: str | Path | None = None,
        trees: str | Path | None = None,
        skills: str | Path | None = None,
        recordings: str | Path = "recordings",
        seed: int = 1,
        pose: str | None = None,
        operator: Operator | None = None,
    ) -> None:
        _check("port", port, isinstance(port, str) and port, f"a serial port, or {VIRTUAL}")
        _check("seed", seed, type(seed) is int and seed > 0, "a whole number from 1")
        _check("pose", pose, pose in (None, "boot", "last"), "boot, last or None")
        own_trees = OWN_TREES if OWN_TREES.is_dir() else None
        if skills is not None:
            load_own_skills(Path(skills))
        setup = Setup(
            port=port,
            robot=load_robot(None if robot is None else Path(robot)),
            trees=own_trees if trees is None else Path(trees),
            recordings=Path(recordings),
            seed=seed,
            pose=pose,
            single_user=True,
        )
        link = setup.load_robot().link(port)
        if isinstance(link, SerialLink):
            link.check()
        resources = ExitStack()
        executive = resources.enter_context(open_executive(setup, link=link, operator=operator))
        self._use(executive, weakref.finalize(self, resources.close))  # closes at exit, too

    @classmethod
    def on(cls, executive: Executive) -> Self:
        """Return an arm on an executive that was not started. The caller closes the executive."""
        arm = cls.__new__(cls)
        arm._use(executive, lambda: None)
        return arm

    def _use(self, executive: Executive, close: Callable[[], object]) -> None:
        self.executive, self._close, self._lock = executive, close, Lock()
        executive.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Cancel what runs, shut the arm down and end the planners. The arm cannot be used again.

        Raises:
            LogError: A recording could not be finished.
        """
        self._close()

    def run(self, task: int | str, /, **arguments: Any) -> Outcome:
        """Run a task and wait for its end. Ctrl-C cancels it and stops the arm.

        Args:
            task: Number or name of the task.
            arguments: Values of its parameters, such as `swing="30 deg"`.

        Raises:
            UnknownTask: No task has that number or name.
            TypeError: A value is of a type that no parameter has.
            GoalFailed: The task failed, was canceled or was rejected; `cause` says why.
            KeyboardInterrupt: Ctrl-C was pressed. The goal has ended, and the arm has stopped.
        """
        outcome = self.attempt(task, **arguments)
        if outcome.code != OK:
            raise GoalFailed(outcome)
        return outcome

    def attempt(self, task: int | str, /, **arguments: Any) -> Outcome:
        """Run a task as `run` does, but return the outcome of one that fails, too."""
        number = self.executive.library.number(task)
        texts = {name: _text(name, value) for name, value in arguments.items()}
        goal = uuid.uuid4().hex
        with self._lock:
            try:
                answer = self.executive.send(number, texts, goal)
                rejected = Outcome.of(number, GoalState.ABORTED, answer.cause)
                outcome = self._wait(goal) if answer.accepted else rejected
            except KeyboardInterrupt:
                self.executive.cancel()
                with suppress(UnknownGoal):
                    finish_recording(self.executive, self.executive.result(goal))
                raise
            return finish_recording(self.executive, outcome)

    def stop(self) -> None:
        """Stop the arm and cancel the task that runs. Any thread may call."""
        self.executive.cancel()

    def _wait(self, goal: str) -> Outcome:
        while True:
            # A Ctrl-C just before the wait does not end the wait: the next slice raises it.
            with suppress(ResultTimeout):
                return self.executive.result(goal, _SLICE)


def _check(name: str, value: object, valid: object, wanted: str) -> None:
    if not valid:
        raise ValueError(f"{name} = {value!r} is invalid; give {wanted}")


def _text(name: str, value: object) -> str:
    """Return an argument as a task file would have it."""
    try:
        return value if isinstance(value, str) else json.dumps(value)
    except TypeError as error:
        raise TypeError(f"argument {name} = {value!r}: {error}") from None
