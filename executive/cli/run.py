"""Runs tasks for `armtree run` and `armtree replay --on`, on their own executive."""

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial

from executive.goals.events import Event
from executive.goals.outcome import GoalState, GoalStatus, Outcome, cause_of
from executive.session import open_executive, port_line
from executive.setup import Setup
from hardware import HardwareError
from trees import TreeError
from trees.compile.arguments import read_arguments

from .interrupts import Interrupts
from .log_handler import recorded_log
from .sequence import TaskSequence
from .streams import LastingStream
from .terminal import Terminal
from .view import View, view_for


def execute(
    setup: Setup,
    numbers: Sequence[int],
    settings: Sequence[str] = (),
    as_json: bool = False,
    verbose: bool = False,
) -> list[Outcome]:
    """Run tasks from the command line.

    Args:
        setup: Set-up of the executive.
        numbers: Numbers of the tasks.
        settings: Parameters of the tasks, each as NAME=VALUE.
        as_json: True to print JSON.
        verbose: True if the log is printed, so that lines are printed instead of a live picture.

    Returns:
        The outcomes of the tasks that ran, at least one.
    """
    with Interrupts() as interrupts, view_for(as_json, verbose) as view, ExitStack() as stack:
        try:
            arguments = read_arguments(settings, numbers)
            executive = stack.enter_context(
                open_executive(
                    setup,
                    operator=Terminal(_to_errors if as_json else view.say),
                    subscriber=partial(_show, view),
                    report=view.say,
                )
            )
        except (HardwareError, TreeError) as error:
            outcome = Outcome.of(numbers[0], GoalState.ABORTED, cause_of(error))
            view.report(outcome)
            return [outcome]
        view.say(port_line(executive))
        sequence = TaskSequence(executive)
        interrupts.on_cancel(sequence.stop)
        with recorded_log(executive):
            return interrupts.run(lambda: sequence.run(numbers, view.report, arguments))


def _show(view: View, event: Event) -> None:
    if not isinstance(event, GoalStatus):
        view.watch(event)


def _to_errors(text: str) -> None:
    errors = LastingStream(sys.stderr)
    errors.write(f"{text}\n")
    errors.flush()
