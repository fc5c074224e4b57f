"""Requests of the client commands to a server, and how their answers are printed."""

import dataclasses
import json
import logging
import re
import uuid
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from functools import partial

import click

import logs
from executive.api.codes import CLOSING
from executive.api.events import Event, QuestionStatus, Status
from executive.api.move import Move, number_of
from executive.api.outcome import CancelCode, CancelResult, GoalState, GoalStatus, Outcome, cause_of
from executive.cli.terminal.streams import echo
from executive.cli.terminal.view import View
from executive.cli.terminal.views import view_for
from executive.client.synchronous import Client
from executive.errors import ClientError, Refused
from trees import TreeError
from trees.compile.arguments import read_arguments

from .failures import print_error
from .interrupts import CANCELING, Interrupts

_QUESTION_ID = re.compile("[0-9a-f]{8}")
_LAST_WORDS = "Ended at once. The goal may still run on the server: `armtree cancel` cancels it."
_NO_QUESTION = "there is no open question"

logger = logging.getLogger(__name__)


def send_and_wait(
    client: Client,
    task: int | str | Move,
    settings: Sequence[str],
    deadman: bool,
    as_json: bool,
    verbose: bool,
) -> Outcome:
    """Run a task or a move on a server, and show it as `armtree run` does. Ctrl-C cancels it.

    Args:
        client: Client of the server.
        task: Number or name of the task, or a move.
        settings: Values of its parameters, each as NAME=VALUE.
        deadman: True to cancel the goal if this process dies.
        as_json: True to print JSON. A rejected goal is then an outcome, as in `armtree run`.
        verbose: True if the log is printed, so that lines are printed instead of a live picture.

    Raises:
        ClientError: The server cannot be reached, or it rejects the goal and `as_json` is false.
    """
    goal_id = uuid.uuid4().hex
    if isinstance(task, Move):
        send = partial(client.send_move, task)
    else:
        send = partial(client.send, task, parameters(settings))
    with Interrupts(_LAST_WORDS) as interrupts, view_for(as_json, verbose) as view:

        def work() -> Outcome:
            hold = client.hold(goal_id) if deadman else nullcontext()
            with client.events() as events, hold:
                try:
                    send(goal_id=goal_id, deadman=deadman)
                except Refused as error:
                    if not as_json:
                        raise
                    numbers = {each.name: each.number for each in client.tasks()}
                    if isinstance(task, str) and task not in numbers:
                        raise
                    number = numbers[task] if isinstance(task, str) else number_of(task)
                    outcome = Outcome.of(number, GoalState.ABORTED, error.cause)
                    view.report(outcome)
                    return outcome
                interrupts.on_cancel(lambda: _cancel(client, goal_id, view))
                return _show_goal(events, goal_id, view)

        return interrupts.run(work)


def stop_all(urls: Sequence[str], as_json: bool) -> int:
    """Stop the arms of servers, all at the same time, and print what became of each.

    Args:
        urls: URLs of the servers; empty for the one that clients use by default.
        as_json: True to print JSON.

    Returns:
        The exit status: 0 if all have stopped.
    """

    def stop(url: str | None) -> tuple[str, CancelResult | ClientError]:
        with Client(url) as client:
            try:
                return client.url, client.stop()
            except ClientError as error:
                return client.url, error

    status = 0
    with ThreadPoolExecutor(len(urls) or 1, "stop") as threads:
        for url, answer in threads.map(stop, urls or [None]):
            if isinstance(answer, ClientError):
                with suppress(ClientError), errors_as_json(as_json):
                    raise answer
                status = print_error(answer)
            elif as_json:
                echo(json.dumps({"server": url, **answer.to_json()}))
            else:
                canceled = ", ".join(answer.goals)
                done = f"canceled {canceled}" if canceled else "no goal was under way"
                echo(f"Stopped the arm of {url}; {done}")
    return status


@contextmanager
def errors_as_json(as_json: bool) -> Iterator[None]:
    """Print an error as JSON if `as_json` is true, then raise it."""
    try:
        yield
    except (ClientError, TreeError) as error:
        if as_json:
            cause = error.cause if isinstance(error, Refused) else cause_of(error)
            event = {"event": "error", "code": cause.code, "message": cause.message}
            echo(json.dumps({**event, "cause": cause.to_json()}))
        raise


def parameters(settings: Sequence[str]) -> dict[str, str]:
    """Return the values of parameters as texts. The server reads them as `armtree run` does.

    Raises:
        FileError: A setting is invalid.
    """
    read_arguments(settings)
    return dict(setting.split("=", 1) for setting in settings)


def watch(client: Client, as_json: bool, verbose: bool) -> None:
    """Show every event of a server, until Ctrl-C.

    Raises:
        ClientError: The server cannot be reached, or has ended.
    """
    with view_for(as_json, verbose) as view, client.events() as events:
        for event in events:
            if not isinstance(event, GoalStatus):
                _watch(event, view)
            elif event.outcome:
                view.report(event.outcome)
    raise _ended()


def answer_question(client: Client, words: Sequence[str], as_json: bool) -> str:
    """Answer a question of a server, or list the open ones.

    Args:
        client: Client of the server.
        words: The answer. The id of the question comes first; it may be omitted if only one
            question is open. No words: list the questions.
        as_json: True to return JSON.

    Returns:
        The answer that the server accepted, or the list of questions.

    Raises:
        UsageError: An id is needed, or no question is open.
        ClientError: The server cannot be reached, or rejects the answer.
    """
    open_questions = client.questions()
    if not words:
        listed = "\n".join(map(str, open_questions)) or _NO_QUESTION
        questions = [dataclasses.asdict(question) for question in open_questions]
        return json.dumps({"questions": questions}) if as_json else listed
    if _QUESTION_ID.fullmatch(words[0]):
        question, *words = words
    elif len(open_questions) == 1:
        question = open_questions[0].question_id
    else:
        listed = "; ".join(map(str, open_questions))
        raise click.UsageError(f"give an id: {listed}" if listed else _NO_QUESTION)
    accepted = client.answer(question, " ".join(words))
    return json.dumps({"question_id": question, "answer": accepted}) if as_json else accepted


def _show_goal(events: Iterator[Event], goal_id: str, view: View) -> Outcome:
    """Show the events of one goal until it ends."""
    belongs = False
    for event in events:
        if isinstance(event, GoalStatus):
            if event.identity == goal_id and event.outcome:
                view.report(event.outcome)
                return event.outcome
            continue
        if isinstance(event, logs.Goal):
            belongs = event.goal_id == goal_id
        if belongs or isinstance(event, logs.Transition):
            _watch(event, view)
    raise _ended()


def _watch(event: logs.Record | QuestionStatus, view: View) -> None:
    if isinstance(event, logs.LogLine) and event.level >= logging.WARNING:
        view.say(f"warning: {event.message}")
    view.watch(event)


def _ended() -> Refused:
    return Refused(
        {"code": CLOSING, "message": "the server has ended, or this client read too slowly"}
    )


def _cancel(client: Client, goal_id: str, view: View) -> None:
    try:
        client.cancel(goal_id)
        view.say(CANCELING)
    except ClientError as error:
        logger.warning("%s", error)


def status_lines(status: Status) -> Iterator[str]:
    """Yield the state of a server, line by line."""
    yield f"Arm       {status.arm}, port {status.port or 'none'}"
    if fault := status.fault:
        yield f"Fault     {fault}"
        yield f"          -> {fault.hint}"
    if status.commanded:
        joints = ", ".join(f"{name} {q:.3f}" for name, q in status.commanded.items())
        yield f"Commanded {joints} rad"
    if status.goal:
        percentage = "" if status.percentage is None else f", {status.percentage} %"
        phase = " ".join(filter(None, ("PAUSED" if status.paused else status.phase, status.node)))
        goal = f"{logs.goal_title(status.goal.task)}, {status.goal.state.name}{percentage}"
        yield f"Goal      {goal}  {phase}".rstrip()
        yield f"          {status.goal.identity}"
    else:
        yield "Goal      none"
    if status.waiting:
        yield f"Waiting   {len(status.waiting)}"
    if status.breakpoints:
        yield f"Breaks    {', '.join(status.breakpoints)}"
    yield f"Policy    {status.policy}"


CANCEL_MESSAGES = {
    CancelCode.NONE: "there is nothing to cancel",
    CancelCode.REJECTED: "the server does not cancel it",
    CancelCode.UNKNOWN_GOAL_ID: "no such goal is known",
    CancelCode.GOAL_TERMINATED: "that goal has ended, or is already being canceled",
}
