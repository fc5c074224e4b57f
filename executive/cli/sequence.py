"""Runs tasks in turn, up to the first that fails or whose recording is incomplete."""

from collections.abc import Callable, Mapping, Sequence

from executive.codes import OK
from executive.executive import Executive
from executive.goals.outcome import CANCELED_CAUSE, GoalState, Outcome
from executive.session import finish_recording
from hardware import State
from trees import Located


class TaskSequence:
    """Tasks that one executive runs in turn, before it closes.

    Args:
        executive: Runs the tasks. It was not started, and has a single user.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive, self._canceled = executive, False

    def stop(self) -> None:
        """Stop the arm; cancel the task that runs and those that follow. Any thread may call."""
        self._canceled = True
        self._executive.cancel()

    def run(
        self,
        tasks: Sequence[int],
        report: Callable[[Outcome], None],
        arguments: Mapping[str, str | Located],
    ) -> list[Outcome]:
        """Run the tasks, then close the executive.

        Every task is validated first, as far as this is possible without the arm. The arm shuts
        down before the last recording ends, so that the recording shows it.

        Args:
            tasks: Numbers of the tasks.
            report: Receives each outcome when its recording is complete.
            arguments: Values of the parameters, by name.

        Returns:
            The outcomes of the tasks that began or were rejected.
        """
        executive = self._executive
        rejected = executive.find_invalid(tasks, arguments) if len(tasks) > 1 else None
        remaining = list(tasks) if rejected is None else [rejected]
        outcomes: list[Outcome] = []
        try:
            executive.start()
            while remaining and (not outcomes or outcomes[-1].code == OK):
                outcome = self._outcome(remaining.pop(0), arguments)
                active = executive.status().arm is not State.UNCONFIGURED
                if active and not (remaining and outcome.success):
                    executive.arm_to("shutdown")
                outcomes.append(finish_recording(executive, outcome))
                report(outcomes[-1])
        finally:
            executive.close()
        return outcomes

    def _outcome(self, task: int, arguments: Mapping[str, str | Located]) -> Outcome:
        if self._canceled:
            return Outcome.of(task, GoalState.CANCELED, CANCELED_CAUSE)
        answer = self._executive.send(task, arguments)
        if answer.cause:
            return Outcome.of(task, GoalState.ABORTED, answer.cause)
        if self._canceled:  # canceled before the goal was sent
            self._executive.cancel(answer.identity)
        return self._executive.result(answer.identity)
