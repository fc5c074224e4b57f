"""Runs tasks one by one: for the command line, `armtree.Arm` and tests."""

import json
import uuid
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import logs
from hardware import State
from trees import Located

from .api.codes import OK
from .api.move import Move, number_of
from .api.outcome import GoalState, Outcome, cause_of
from .errors import GoalCanceled, ResultTimeout, UnknownGoal
from .executive import Executive

_SLICE = 0.5  # longest single wait for an outcome, to notice Ctrl-C [s]
_NO_ARGUMENTS: Mapping[str, Any] = MappingProxyType({})


class TaskRunner:
    """Runs tasks and moves, and finishes the recording of each.

    Args:
        executive: Runs the tasks. Its set-up has `single_user`.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive, self._stopped = executive, False

    def stop(self) -> None:
        """Stop the arm, and cancel the running and the remaining tasks. Any thread may call."""
        self._stopped = True
        self._executive.cancel()

    def run(
        self,
        task: int | str | Move,
        arguments: Mapping[str, Any] = _NO_ARGUMENTS,
        accepted: Callable[[], None] = lambda: None,
    ) -> Outcome:
        """Run a task or a move on a started executive, and wait for its end. Ctrl-C cancels it.

        Args:
            task: Number or name of the task, or a move.
            arguments: Values of its parameters, by name.
            accepted: Callback when the goal is accepted.

        Returns:
            The outcome, also of a rejected goal.

        Raises:
            UnknownTask: No task has that number or name.
            TypeError: A value has a type that no parameter accepts.
            KeyboardInterrupt: Ctrl-C was pressed. The goal has ended, and the arm has stopped.
        """
        number = task if isinstance(task, Move) else self._executive.library.latest.number(task)
        texts = {name: _text(name, value) for name, value in arguments.items()}
        goal = uuid.uuid4().hex
        try:
            return self._finish(self._outcome(number, texts, goal, accepted))
        except KeyboardInterrupt:
            self._executive.cancel()
            with suppress(UnknownGoal):
                self._finish(self._executive.result(goal))
            raise

    def run_all(
        self,
        tasks: Sequence[int | Move],
        arguments: Mapping[str, str | Located],
        report: Callable[[Outcome], None],
    ) -> list[Outcome]:
        """Start the executive, run tasks until one fails, and close the executive.

        Every task is first validated, as far as possible without the arm. The arm shuts down before
        the last recording ends, so that the recording shows the shutdown.

        Args:
            tasks: Numbers of the tasks, or moves.
            arguments: Values of the parameters, by name.
            report: Callback for each outcome, after its recording is complete.

        Returns:
            The outcomes of the tasks that began or were rejected.
        """
        executive = self._executive
        rejected = executive.find_invalid(tasks, arguments) if len(tasks) > 1 else None
        remaining: list[int | Move] = list(tasks) if rejected is None else [rejected]
        outcomes: list[Outcome] = []
        try:
            executive.start()
            while remaining and all(outcome.code == OK for outcome in outcomes):
                outcome = self._outcome(remaining.pop(0), arguments)
                active = executive.status().arm is not State.UNCONFIGURED
                if active and not (remaining and outcome.success):
                    executive.arm_to("shutdown")
                outcomes.append(self._finish(outcome))
                report(outcomes[-1])
        finally:
            executive.close()
        return outcomes

    def _outcome(
        self,
        task: int | Move,
        arguments: Mapping[str, str | Located],
        goal: str = "",
        accepted: Callable[[], None] = lambda: None,
    ) -> Outcome:
        if self._stopped:
            return Outcome.of(number_of(task), GoalState.CANCELED, cause_of(GoalCanceled()))
        answer = self._executive.send(task, arguments, goal, strict=True)
        if answer.cause:
            return Outcome.of(number_of(task), GoalState.ABORTED, answer.cause)
        accepted()
        if self._stopped:  # Ctrl-C came before the goal was sent
            self._executive.cancel(answer.identity)
        while True:
            # A Ctrl-C just before the wait does not end the wait. The next wait raises it.
            with suppress(ResultTimeout):
                return self._executive.result(answer.identity, _SLICE)

    def _finish(self, outcome: Outcome) -> Outcome:
        """Finish the recording of a goal. Return the outcome, with the error of the file if any."""
        try:
            self._executive.finish_recording()
        except logs.LogError as error:
            if outcome.success:
                return replace(outcome, code=error.code, message=str(error))
            cause, words = outcome.cause, str(error)
            if cause and cause.code == error.code:  # the same error, now with the end of the file
                return replace(outcome, message=words, cause=replace(cause, message=words))
            if cause and words not in cause.message:
                cause = replace(cause, message=f"{cause.message}; {words}")
            message = outcome.message if words in outcome.message else f"{outcome.message}; {words}"
            return replace(outcome, message=message, cause=cause)
        return outcome


def _text(name: str, value: object) -> str:
    """Return the value of an argument as it is written in a task file."""
    try:
        return value if isinstance(value, str) else json.dumps(value)
    except TypeError as error:
        raise TypeError(f"argument {name} = {value!r}: {error}") from None
