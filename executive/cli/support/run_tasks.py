"""Runs tasks and moves for commands such as `armtree run`, on an executive of the command."""

import logging
import shlex
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import click
from click.core import ParameterSource

import logs
from executive.api import token_file
from executive.api.events import Event
from executive.api.move import Move, number_of
from executive.api.outcome import GoalState, GoalStatus, Outcome, cause_of
from executive.cli.terminal.line_view import view_for
from executive.cli.terminal.question_prompt import Terminal
from executive.cli.terminal.streams import echo
from executive.cli.terminal.view import Prompt, View
from executive.errors import ClientError
from executive.executive import Executive
from executive.session import open_executive, port_line
from executive.setup import Setup
from executive.task_runner import TaskRunner
from hardware import VIRTUAL, HardwareError
from hardware.errors import ACTIVATE_AGAIN, PortBusy
from hardware.link.serial_ports import owner_of
from trees import TreeError
from trees.compile.arguments import read_arguments

from .failures import Refusal
from .interrupts import CANCELING, Interrupts
from .log_handler import recorded_log
from .own_arms import stoppable
from .process import make_punctual


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
        known: True if a server may also have these tasks.

    Returns:
        The outcomes of the executed tasks, at least one.

    Raises:
        Refusal: A server holds the arm, and the user has not chosen another arm with --port.
    """
    make_punctual()
    with Interrupts() as interrupts, view_for(as_json, verbose) as view, ExitStack() as stack:
        stack.enter_context(stoppable(view.put))
        start = list[str]()  # lines to print when the first goal is accepted
        try:
            arguments = read_arguments(settings, [number_of(task) for task in tasks])
            executive = stack.enter_context(
                open_executive(
                    setup,
                    operator=Terminal(
                        _to_errors if as_json else lambda text: view.put(Prompt(text))
                    ),
                    subscriber=partial(_show, view, start, verbose),
                )
            )
        except (HardwareError, TreeError) as error:
            outcome = Outcome.of(number_of(tasks[0]), GoalState.ABORTED, cause_of(error))
            view.put(outcome)
            return [outcome]
        view.put(executive.where())
        start.append(port_line(executive))
        reported = executive.robot.firmware.reports_pose and executive.port != VIRTUAL
        if isinstance(tasks[0], Move) and not reported:
            start.append(_start_line(executive))
        for server in perhaps_meant(executive.port) if known else ():
            if held := _held_by(server, executive, number_of(tasks[0]), settings):
                raise Refusal(f"{held}; to run on a virtual arm instead, add --port virtual")
        runner = TaskRunner(executive)

        def cancel() -> None:
            runner.stop()
            view.put(CANCELING)

        interrupts.on_cancel(cancel)
        with recorded_log(executive):
            report = partial(_report, view, executive, settings) if known else view.put
            outcomes = interrupts.run(
                lambda: runner.run_all(tasks, arguments, lambda each: report(without_server(each)))
            )
        remaining = [number_of(task) for task in tasks]
        for outcome in outcomes:
            remaining.remove(outcome.task)
        if remaining:
            view.put(f"not started: {', '.join(map(logs.goal_title, remaining))}")
        return outcomes


def _start_line(executive: Executive) -> str:
    """Return a line with the start pose of a move, and a way to keep the pose between moves."""
    robot = executive.robot
    pose = robot.words(robot.by_joint(executive.start_pose.find()))
    return f"Starts at {pose}; `armtree serve --activate` keeps the pose between moves"


def _show(view: View, start: list[str], verbose: bool, event: Event) -> None:
    """Show an event. Before the first accepted goal, show the lines in `start`.

    A warning becomes a line, unless the log is printed.
    """
    if isinstance(event, logs.LogLine) and event.level == logging.WARNING and not verbose:
        view.put(f"warning: {event.message}")
    if not isinstance(event, GoalStatus):
        view.put(event)
        return
    while start:
        view.put(start.pop(0))


def _report(view: View, executive: Executive, settings: Sequence[str], outcome: Outcome) -> None:
    """Report an outcome. If a server has the arm, add the command that sends the task to it."""
    hint = partial(_held_by, executive=executive, task=outcome.task, settings=settings)
    view.put(with_holder(outcome, executive.port, hint))


def without_server(outcome: Outcome, again: str = "run again") -> Outcome:
    """Return an outcome with `again` in its hint, instead of the advice to activate the arm."""
    if not (cause := outcome.cause):
        return outcome
    hint = cause.hint.replace(ACTIVATE_AGAIN, again)
    return replace(outcome, cause=replace(cause, hint=hint))


def _held_by(
    server: token_file.ServerInfo, executive: Executive, task: int, settings: Sequence[str]
) -> str:
    """Return a hint that a server holds the arm, with the command that sends it the task.

    Returns:
        The message; empty if the server does not answer, or holds another robot.
    """
    from executive.client.synchronous import Client  # imported only if a server runs

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
        way = f"end it, or make it serve this task: {server.url}"
        return f"an armtree server has the arm, but not this task; {way}"
    words = ["--server", server.url]
    if task != logs.MOVE:
        parameters = [word for setting in settings for word in ("--set", setting)]
        words = ["armtree", "send", str(task), "--wait", *parameters, *words]
    return f"an armtree server has the arm; give {shlex.join(words)}"


def perhaps_meant(port: str) -> Sequence[token_file.ServerInfo]:
    """Return the running servers whose arm the user may mean.

    There are none if the port is a real port, or is given as an option.
    """
    source = click.get_current_context().get_parameter_source("port")
    chosen = port != VIRTUAL or source is ParameterSource.COMMANDLINE
    return () if chosen else token_file.running()


def with_holder(
    outcome: Outcome, port: str, hint: Callable[[token_file.ServerInfo], str]
) -> Outcome:
    """Return an outcome. If a server of this user has the busy port, change the hint.

    Args:
        outcome: The outcome.
        port: The port.
        hint: Callback that gets the server and returns the hint; empty to keep the earlier hint.
    """
    cause = outcome.cause
    if not cause or cause.code != PortBusy.code:
        return outcome
    owner = owner_of(port)
    hints = (hint(server) for server in token_file.running() if server.pid == owner)
    return replace(outcome, cause=replace(cause, hint=next(hints, "") or cause.hint))


def _to_errors(text: str) -> None:
    if text:
        echo(text, err=True)
