"""What the commands that talk to a server do."""

import dataclasses
import json
import logging
import re
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext

import click

import logs
from executive.client.errors import ClientError, Refused
from executive.client.synchronous import Client
from executive.codes import CLOSING
from executive.goals.events import Event, QuestionStatus, Status
from executive.goals.outcome import CancelCode, GoalState, GoalStatus, Outcome, cause_of
from hardware import RealClock
from trees import TreeError
from trees.compile.arguments import read_arguments

from .display import view_for
from .interrupts import Interrupts
from .view import View

# An id that is mistaken for words would answer another question.
_QUESTION_ID = re.compile("[0-9a-f]{8}")

logger = logging.getLogger(__name__)


def send_and_wait(
    client: Client, task: int, settings: Sequence[str], deadman: bool, as_json: bool, verbose: bool
) -> Outcome:
    """Run a task as `armtree run` does, on a server; Ctrl-C cancels it.

    Args:
        client: Of the server.
        task: Number of the task.
        settings: Values of its parameters, each as NAME=VALUE.
        deadman: Whether it is canceled when this process dies.
        as_json: Whether JSON is wanted.
        verbose: Whether the log is shown, so that no live picture may be in its way.

    Raises:
        ClientError: The server cannot be reached; or it refuses the goal, where no JSON is wanted,
            in which that is an outcome, as `run` has it.
    """
    arguments, goal_id = texts(settings, task), uuid.uuid4().hex
    with Interrupts() as interrupts, view_for(as_json, verbose) as view:

        def work() -> Outcome:
            held = client.hold(goal_id) if deadman else nullcontext()
            with client.events() as events, held:
                try:
                    client.send(task, arguments, goal_id, deadman)
                except Refused as error:
                    if not as_json:
                        raise
                    return _refused(task, error, view)
                interrupts.on_cancel(lambda: _aside(lambda: client.cancel(goal_id)))
                return _show(events, goal_id, view)

        return interrupts.run(work)


@contextmanager
def errors_told(as_json: bool) -> Iterator[None]:
    """Where JSON is wanted, tell in it, too, what a command ends with."""
    try:
        yield
    except (ClientError, TreeError) as error:
        if as_json:
            cause = error.cause if isinstance(error, Refused) else cause_of(error)
            told = {"code": cause.code, "message": cause.message}
            click.echo(json.dumps({"event": "error", **told, "cause": cause.to_json()}))
        raise


def texts(settings: Sequence[str], task: int) -> dict[str, str]:
    """Values of parameters as they were typed; the server reads them as `run` would.

    Raises:
        FileError: A setting is wrong.
    """
    read_arguments(settings, (task,))
    return dict(setting.split("=", 1) for setting in settings)


def watch(client: Client, as_json: bool, verbose: bool) -> None:
    """Show whatever a server does, until Ctrl-C.

    Raises:
        ClientError: The server cannot be reached, or has ended.
    """
    with view_for(as_json, verbose) as view, client.events() as events:
        for event in events:
            if not isinstance(event, GoalStatus):
                _see(event, view)
            elif event.outcome:
                view.report(event.outcome)
    raise _ended()


def reply(client: Client, words: Sequence[str], as_json: bool) -> str:
    """Answer a question, the only one where no id is given; without words, list what is asked.

    Returns:
        The answer that counts, or the list; as the server puts it where JSON is wanted.

    Raises:
        UsageError: It is not clear which is meant.
        ClientError: The server cannot be reached, or refuses the answer.
    """
    asked = client.questions()
    if not words:
        listed = "\n".join(map(str, asked)) or "nothing is asked"
        questions = [dataclasses.asdict(each) for each in asked]
        return json.dumps({"questions": questions}) if as_json else listed
    if _QUESTION_ID.fullmatch(words[0]):
        question, *words = words
    elif len(asked) == 1:
        question = asked[0].question_id
    else:
        there = "; ".join(map(str, asked))
        raise click.UsageError(f"give an id: {there}" if there else "nothing is asked")
    counts = client.answer(question, " ".join(words))
    return json.dumps({"question_id": question, "answer": counts}) if as_json else counts


def _refused(task: int, error: Refused, view: View) -> Outcome:
    outcome = Outcome.of(task, GoalState.ABORTED, error.cause)
    view.report(outcome)
    return outcome


def _show(events: Iterator[Event], goal_id: str, view: View) -> Outcome:
    """Show one goal to its end."""
    ours = False
    for event in events:
        if isinstance(event, GoalStatus):
            if event.identity == goal_id and event.outcome:
                view.report(event.outcome)
                return event.outcome
            continue
        if isinstance(event, logs.Goal):
            ours = event.goal_id == goal_id
        if ours or isinstance(event, logs.Transition):
            _see(event, view)
    raise _ended()


def _see(event: logs.Record | QuestionStatus, view: View) -> None:
    if isinstance(event, logs.LogLine) and event.level >= logging.WARNING:
        view.say(f"warning: {event.message}")
    view.watch(event)


def _ended() -> Refused:
    return Refused({"code": CLOSING, "message": "the server has ended, or dropped who is too slow"})


def _aside(act: Callable[[], object]) -> None:
    """Do it on a thread of its own; its failure shows where the events end."""

    def tried() -> None:
        try:
            act()
        except ClientError as error:
            logger.warning("%s", error)

    RealClock().spawn(tried, "aside")


def status_lines(status: Status) -> Iterator[str]:
    """What a server is at, for people."""
    yield f"Arm       {status.arm}, port {status.port or 'none'}"
    if fault := status.fault:
        yield f"Fault     {fault}"
        yield f"          -> {fault.hint}"
    if status.commanded:
        joints = ", ".join(f"{name} {q:.3f}" for name, q in status.commanded.items())
        yield f"Commanded {joints} rad"
    if status.goal:
        far = "" if status.percentage is None else f", {status.percentage} %"
        doing = "PAUSED" if status.paused else status.phase
        what = " ".join(filter(None, (doing, status.node)))
        yield f"Goal      task {status.goal.task}, {status.goal.state.name}{far}  {what}".rstrip()
        yield f"          {status.goal.identity}"
    else:
        yield "Goal      none"
    if status.waiting:
        yield f"Waiting   {len(status.waiting)}"
    if status.breakpoints:
        yield f"Breaks    {', '.join(status.breakpoints)}"
    yield f"Policy    {status.policy}"


def status_json(status: Status) -> str:
    """The same for programs."""
    return json.dumps(status.to_json())


CANCEL_WORDS = {
    CancelCode.NONE: "there is nothing to cancel",
    CancelCode.REJECTED: "the server will not cancel it",
    CancelCode.UNKNOWN_GOAL_ID: "no such goal is known",
    CancelCode.GOAL_TERMINATED: "that goal has ended, or is being canceled already",
}
