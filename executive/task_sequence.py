"""Tasks one after the other, on an executive of one's own: what `armtree run` does."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from hardware import State
from logs import LogError
from trees import Located

from .executive import Executive
from .goals.outcome import CANCELED_CAUSE, GoalState, Outcome


class TaskSequence:
    """Runs tasks in turn, up to the first that is not done.

    Args:
        executive: A solo one that was not started.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive = executive
        self._canceled = False

    def cancel(self) -> None:
        """Cancel the one that runs and those that would follow. From any thread."""
        self._canceled = True
        self._executive.cancel()

    def run(
        self,
        tasks: Sequence[int],
        report: Callable[[Outcome], None],
        arguments: Mapping[str, str | Located] = MappingProxyType({}),
    ) -> list[Outcome]:
        """Run them, and shut the arm down.

        What can be judged without the arm is judged for all of them before it is activated.

        Args:
            tasks: Their numbers.
            report: Told of every outcome as soon as its recording is closed.
            arguments: Values of the tasks' parameters, by name.

        Returns:
            The outcomes of those that were begun or refused.
        """
        refused = self._executive.refused(tasks, arguments) if len(tasks) > 1 else None
        outcomes: list[Outcome] = []
        self._executive.start()
        try:
            left = list(tasks) if refused is None else [refused]
            while left:
                outcomes.append(self._one(left.pop(0), arguments, not left))
                report(outcomes[-1])
                if not outcomes[-1].success:
                    break
        finally:
            self._executive.close()
        return outcomes

    def _one(self, task: int, arguments: Mapping[str, str | Located], last: bool) -> Outcome:
        if self._canceled:
            return Outcome.of(task, GoalState.CANCELED, CANCELED_CAUSE)
        identity = self._executive.send(task, arguments).identity
        if self._canceled:  # in between
            self._executive.cancel(identity)
        outcome = self._executive.result(identity)
        active = self._executive.status().arm is not State.UNCONFIGURED
        if active and (last or not outcome.success):
            self._executive.arm_to("shutdown")  # before its recording closes, so that it is in it
        return self._recorded(outcome)

    def _recorded(self, outcome: Outcome) -> Outcome:
        """The outcome, once its recording is closed, and whatever is wrong with that."""
        try:
            self._executive.finish_recording()
        except LogError as error:
            if outcome.success:
                return dataclasses.replace(outcome, code=error.code, message=str(error))
            return _with(outcome, str(error))
        return outcome


def _with(outcome: Outcome, words: str) -> Outcome:
    """An outcome of which more is to be told."""
    cause = outcome.cause
    if cause and words not in cause.message:
        cause = dataclasses.replace(cause, message=f"{cause.message}; {words}")
    message = outcome.message if words in outcome.message else f"{outcome.message}; {words}"
    return dataclasses.replace(outcome, message=message, cause=cause)
