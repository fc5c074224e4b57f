"""An arm in a Python program or a notebook, without a server.

with armtree.Arm() as arm:
    result = arm.run("pick")
"""

import json
import uuid
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from threading import Lock
from types import MappingProxyType
from typing import Any, Self

from hardware import State
from trees import Located

from .codes import OK
from .errors import GoalFailed, ResultTimeout, UnknownGoal
from .executive import Executive
from .goals.outcome import CANCELED_CAUSE, GoalState, Outcome
from .session import finish_recording, open_executive
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
        seed: Seed of planning.
        pose: Confirmed position of the arm, `boot` or `last`; needed if opening the port does not
            reset the board.

    Attributes:
        executive: Runs the tasks; it can also pause, resume and report.

    Raises:
        HardwareError: The robot file is wrong or names no driver, or the pose is not confirmed.
        TreeError: The folder of tasks cannot be read.
        ValueError: A skill is broken.
    """

    def __init__(
        self,
        port: str = "virtual",
        robot: str | Path | None = None,
        trees: str | Path | None = None,
        skills: str | Path | None = None,
        recordings: str | Path = "recordings",
        seed: int = 1,
        pose: str | None = None,
    ) -> None:
        setup = Setup(
            port=port,
            robot=_path(robot),
            trees=_path(trees) or (OWN_TREES if OWN_TREES.is_dir() else None),
            skills=_path(skills),
            recordings=Path(recordings),
            seed=seed,
            pose=pose,
            single_user=True,
        )
        resources = ExitStack()
        executive = resources.enter_context(open_executive(setup))
        self._use(executive, weakref.finalize(self, resources.close))  # closes at exit, too

    @classmethod
    def on(cls, executive: Executive) -> Self:
        """Return an arm on an executive that was not started. The caller closes the executive."""
        arm = cls.__new__(cls)
        arm._use(executive, lambda: None)
        return arm

    def _use(self, executive: Executive, close: Callable[[], object]) -> None:
        self.executive, self._close = executive, close
        self._lock = Lock()
        self._started = self._canceled = False

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
        with self._lock:
            self._canceled = False
            goal = uuid.uuid4().hex
            try:
                return finish_recording(self.executive, self._wait(number, texts, goal))
            except KeyboardInterrupt:
                self.executive.cancel()
                with suppress(UnknownGoal):
                    finish_recording(self.executive, self.executive.result(goal))
                raise

    def run_all(
        self,
        tasks: Sequence[int],
        report: Callable[[Outcome], None],
        arguments: Mapping[str, str | Located] = MappingProxyType({}),
    ) -> list[Outcome]:
        """Run tasks in turn up to the first that fails, then close.

        Every task is validated first, as far as this is possible without the arm. The arm shuts
        down before the last recording ends, so that the recording shows it.

        Args:
            tasks: Numbers of the tasks.
            report: Receives each outcome when its recording is complete.
            arguments: Values of the parameters, by name.

        Returns:
            The outcomes of the tasks that began or were rejected.
        """
        rejected = self.executive.find_invalid(tasks, arguments) if len(tasks) > 1 else None
        remaining = list(tasks) if rejected is None else [rejected]
        outcomes: list[Outcome] = []
        try:
            while remaining and (not outcomes or outcomes[-1].success):
                outcome = self._wait(remaining.pop(0), arguments, uuid.uuid4().hex)
                active = self.executive.status().arm is not State.UNCONFIGURED
                if active and not (remaining and outcome.success):
                    self.executive.arm_to("shutdown")
                outcomes.append(finish_recording(self.executive, outcome))
                report(outcomes[-1])
        finally:
            self.executive.close()
        return outcomes

    def stop(self) -> None:
        """Stop the arm and cancel the task that runs, and those of `run_all` that follow.

        Any thread may call.
        """
        self._canceled = True
        self.executive.cancel()

    def _wait(self, task: int, arguments: Mapping[str, str | Located], goal: str) -> Outcome:
        if not self._started:
            self._started = True
            self.executive.start()
        if self._canceled:
            return Outcome.of(task, GoalState.CANCELED, CANCELED_CAUSE)
        answer = self.executive.send(task, arguments, goal)
        if not answer.accepted:
            return Outcome.of(task, GoalState.ABORTED, answer.cause)
        if self._canceled:  # canceled before the goal was sent
            self.executive.cancel(goal)
        while True:
            # A Ctrl-C just before the wait does not end the wait: the next slice raises it.
            with suppress(ResultTimeout):
                return self.executive.result(goal, _SLICE)


def _text(name: str, value: object) -> str:
    """Return an argument as a task file would have it."""
    try:
        return value if isinstance(value, str) else json.dumps(value)
    except TypeError as error:
        raise TypeError(f"argument {name} = {value!r}: {error}") from None


def _path(path: str | Path | None) -> Path | None:
    return None if path is None else Path(path)
