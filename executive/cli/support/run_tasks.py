"""Runs tasks for `armtree run` and `armtree replay --on`, on their own executive."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import click
from click.core import ParameterSource

import logs
from executive.api import token_file
from executive.api.codes import OK
from executive.api.events import Event
from executive.api.move import Move, number_of
from executive.api.outcome import CANCELED_CAUSE, GoalState, GoalStatus, Outcome, cause_of
from executive.cli.terminal.line_view import view_for
from executive.cli.terminal.question_prompt import Terminal
from executive.cli.terminal.streams import echo
from executive.cli.terminal.view import Prompt, View
from executive.errors import ClientError
from executive.executive import Executive
from executive.session import finish_recording, open_executive, port_line
from executive.setup import Setup
from hardware import VIRTUAL, HardwareError, State
from hardware.errors import PortBusy
from hardware.link.serial_ports import owner_of
from trees import Located, TreeError
from trees.compile.arguments import read_arguments

from .failures import Refusal
from .interrupts import CANCELING, Interrupts
from .log_handler import recorded_log
from .process import raise_priority


def execute(
    setup: Setup,
    tasks: Sequence[int | Move],
    settings: Sequence[str] = (),
    as_json: bool = False,
    verbose: bool = False,
    known: bool = True,
) -> list[Outcome]:
    """Run tasks or moves from the command line.

    Args:
        setup: Set-up of the executive.
        tasks: Numbers of the tasks, or moves.
        settings: Parameters of the tasks, each as NAME=VALUE.
        as_json: True to print JSON.
        verbose: True if the log is printed, so that lines are printed instead of a live picture.
        known: True if a server may have these tasks, too.

    Returns:
        The outcomes of the tasks that ran, at least one.

    Raises:
        Refusal: A server holds the arm, and the user has not asked for another one by --port.
    """
    raise_priority()
    with Interrupts() as interrupts, view_for(as_json, verbose) as view, ExitStack() as stack:
        try:
            arguments = read_arguments(settings, [number_of(task) for task in tasks])
            executive = stack.enter_context(
                open_executive(
                    setup,
                    operator=Terminal(_to_errors if as_json else _prompt(view)),
                    subscriber=partial(_show, view),
                    report=view.put,
                )
            )
        except (HardwareError, TreeError) as error:
            outcome = Outcome.of(number_of(tasks[0]), GoalState.ABORTED, cause_of(error))
            view.put(outcome)
            return [outcome]
        view.put(executive.where())
        view.put(port_line(executive))
        source = click.get_current_context().get_parameter_source("port")
        if known and executive.port == VIRTUAL and source is not ParameterSource.COMMANDLINE:
            for server in token_file.running():
                if held := _held_by(server, executive, number_of(tasks[0]), settings):
                    raise Refusal(f"{held}; or give --port virtual for another, virtual arm")
        sequence = TaskSequence(executive)

        def cancel() -> None:
            sequence.stop()
            view.put(CANCELING)

        interrupts.on_cancel(cancel)
        with recorded_log(executive):
            report = partial(_report, view, executive, settings) if known else view.put
            outcomes = interrupts.run(lambda: sequence.run(tasks, report, arguments))
        remaining = [number_of(task) for task in tasks]
        for outcome in outcomes:
            remaining.remove(outcome.task)
        if remaining:
            view.put(f"not started: {', '.join(map(logs.goal_title, remaining))}")
        return outcomes


def _show(view: View, event: Event) -> None:
    if not isinstance(event, GoalStatus):
        view.put(event)


def _report(view: View, executive: Executive, settings: Sequence[str], outcome: Outcome) -> None:
    """Report an outcome; if a server has the arm, with the command that sends the task to it."""
    cause = outcome.cause
    if cause and cause.code == PortBusy.code and (server := _server_with(executive.port)):
        hint = _held_by(server, executive, outcome.task, settings) or cause.hint
        outcome = replace(outcome, cause=replace(cause, hint=hint))
    view.put(outcome)


def _held_by(
    server: token_file.ServerInfo, executive: Executive, task: int, settings: Sequence[str]
) -> str:
    """Return that a server has the arm, and what to type, so that it runs a task or a move.

    Returns:
        The words; empty if the server does not answer, or holds another robot.
    """
    from executive.client.synchronous import Client  # only where a server runs

    from .server_requests import holds

    name = {number: name for name, number in executive.library.latest.names().items()}.get(task)
    try:
        with Client(server.url) as client:
            there = {(each.number, each.name) for each in client.tasks()} | {(logs.MOVE, None)}
            if not holds(client.robot(), executive.robot):
                return ""
    except ClientError:
        return ""
    if (task, name) not in there:
        way = f"end it, or serve this task: {server.url}"
        return f"an armtree server has the arm, but not this task; {way}"
    words = ["--server", server.url]
    if task != logs.MOVE:
        parameters = [word for setting in settings for word in ("--set", setting)]
        words = ["armtree", "send", str(task), "--wait", *parameters, *words]
    return f"an armtree server has the arm; give {shlex.join(words)}"


def _server_with(port: str) -> token_file.ServerInfo | None:
    """Return the server of this user that has locked a port."""
    owner = owner_of(port)
    return next((server for server in token_file.running() if server.pid == owner), None)


def _prompt(view: View) -> Callable[[str], None]:
    return lambda text: view.put(Prompt(text))


def _to_errors(text: str) -> None:
    if text:
        echo(text, err=True)


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
        tasks: Sequence[int | Move],
        report: Callable[[Outcome], None],
        arguments: Mapping[str, str | Located],
    ) -> list[Outcome]:
        """Run the tasks, then close the executive.

        Every task is validated first, as far as this is possible without the arm. The arm shuts
        down before the last recording ends, so that the recording shows it.

        Args:
            tasks: Numbers of the tasks, or moves.
            report: Receives each outcome when its recording is complete.
            arguments: Values of the parameters, by name.

        Returns:
            The outcomes of the tasks that began or were rejected.
        """
        executive = self._executive
        rejected = executive.find_invalid(tasks, arguments) if len(tasks) > 1 else None
        remaining: list[int | Move] = list(tasks) if rejected is None else [rejected]
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

    def _outcome(self, task: int | Move, arguments: Mapping[str, str | Located]) -> Outcome:
        if self._canceled:
            return Outcome.of(number_of(task), GoalState.CANCELED, CANCELED_CAUSE)
        answer = self._executive.send(task, arguments, strict=True)
        if answer.cause:
            return Outcome.of(number_of(task), GoalState.ABORTED, answer.cause)
        if self._canceled:  # canceled before the goal was sent
            self._executive.cancel(answer.identity)
        return self._executive.result(answer.identity)
