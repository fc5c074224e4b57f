"""Sends goals to a server, and shows its goals and events like those of `armtree run`."""

import logging
import threading
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from datetime import datetime
from functools import partial

import logs
from executive.api.events import Event, QuestionStatus
from executive.api.move import Move, number_of
from executive.api.outcome import GoalState, GoalStatus, Outcome
from executive.cli.terminal.line_view import view_for
from executive.cli.terminal.streams import echo
from executive.cli.terminal.view import View
from executive.client.synchronous import Client
from executive.errors import ClientError, Refused, ServerClosing, ServerLost, ServerUnreachable
from hardware import RealClock, State
from trees.compile.arguments import read_arguments

from .interrupts import CANCELING, Interrupts

_ENDED = "the server has ended, or this client read too slowly"
_LAST_WORDS = "Ended at once. The goal may still run on the server: `armtree cancel` cancels it."
_SILENT = (
    "The server {} has not answered since {}, so the cancel waits. If the arm moves, switch off its"
    " power. Another Ctrl-C ends this command at once."
)
_HANGS = "The server has not answered since {}. If the arm moves, switch off its power."
_NOT_SENT = "The server {} does not answer yet. Nothing was sent; Ctrl-C ends this command"
_LATE = 2.0  # time after which a missing answer is shown [s]
_RETRY = 1.0  # time between two cancels [s]
_CHECK_PERIOD = 5.0  # time between two checks that the server answers [s]


def send_and_wait(
    client: Client,
    task: int | str | Move,
    settings: Sequence[str],
    deadman: bool,
    as_json: bool,
    verbose: bool,
) -> Outcome:
    """Run a task or a move on a server, and show it like `armtree run`. Ctrl-C cancels the goal.

    Args:
        client: Client of the server.
        task: Number or name of the task, or a move.
        settings: Values of the parameters of the task, each as NAME=VALUE.
        deadman: True to cancel the goal if this process dies.
        as_json: True to print JSON. A rejected goal is then an outcome, as in `armtree run`. A
            rejected move is always an outcome.
        verbose: True if the log is printed, so that lines are printed instead of a live picture.

    Raises:
        ClientError: The server cannot be reached, or it rejects the task and `as_json` is false.
    """
    goal_id, sent, ended = uuid.uuid4().hex, threading.Event(), threading.Event()
    canceling = threading.Event()
    if isinstance(task, Move):
        send = partial(client.send_move, task)
    else:
        send = partial(client.send, task, parameters(settings))
    with _if_late(lambda: echo(_NOT_SENT.format(client.url), err=True)):
        where = client.where()  # before the goal is sent, Ctrl-C ends the command
    with (
        client.events() as events,
        Interrupts(_LAST_WORDS) as interrupts,
        view_for(as_json, verbose) as view,
    ):
        interrupts.on_cancel(lambda: _cancel(client, goal_id, view, sent, ended, canceling))

        def work() -> Outcome:
            view.put(where)
            with client.hold(goal_id) if deadman else nullcontext():
                try:
                    send(goal_id=goal_id, deadman=deadman)
                except Refused as error:
                    if not (as_json or isinstance(task, Move)):
                        raise
                    numbers = {each.name: each.number for each in client.tasks()}
                    if isinstance(task, str) and task not in numbers:
                        raise
                    number = numbers[task] if isinstance(task, str) else number_of(task)
                    outcome = Outcome.of(number, GoalState.ABORTED, error.cause)
                    view.put(outcome)
                    return outcome
                sent.set()
                try:
                    with _silence_shown(client, view, canceling):
                        return _show_goal(events, goal_id, view)
                except ServerUnreachable as error:
                    raise ServerLost from error

        try:
            return interrupts.run(work)
        finally:
            ended.set()
            sent.set()


def parameters(settings: Sequence[str]) -> dict[str, str]:
    """Return the values of parameters as texts. The server reads them like `armtree run`.

    Raises:
        FileError: A setting is invalid.
    """
    read_arguments(settings)
    return dict(setting.split("=", 1) for setting in settings)


def activate(client: Client, pose: str | None, stops: int, verbose: bool) -> str:
    """Activate the arm of a server, and show the remaining boot time of its board.

    Args:
        client: Client of the server.
        pose: Confirmed start pose, or None.
        stops: Number of stops that the caller knows. After a later stop, the arm is not activated.
        verbose: True if the log is printed.

    Returns:
        The new state.

    Raises:
        ClientError: The server cannot be reached, or it rejects the request.
    """
    with view_for(False, verbose) as view:
        view.put(where := client.where())
        view.put(logs.Transition(RealClock().now(), "activate", where.arm, State.ACTIVATING))
        return client.arm("activate", pose, stops)


def watch(client: Client, as_json: bool, verbose: bool) -> None:
    """Show every event of a server, until Ctrl-C.

    Raises:
        ClientError: The server cannot be reached.
        ServerClosing: The server has ended.
    """
    with (
        view_for(as_json, verbose) as view,
        client.events() as events,
        _silence_shown(client, view, threading.Event()),
    ):
        view.put(client.where())
        for event in events:
            if not isinstance(event, GoalStatus):
                _watch(event, view)
            elif event.outcome:
                view.put(event.outcome)
    raise ServerClosing(_ENDED)


def _show_goal(events: Iterator[Event], goal_id: str, view: View) -> Outcome:
    """Show the events of one goal until it ends. Return its outcome."""
    belongs = False
    for event in events:
        if isinstance(event, GoalStatus):
            if event.identity == goal_id and event.outcome:
                view.put(event.outcome)
                return event.outcome
            continue
        if isinstance(event, logs.Goal):
            belongs = event.goal_id == goal_id
        if belongs or isinstance(event, logs.Transition):
            _watch(event, view)
    raise ServerClosing(_ENDED)


def _watch(event: logs.Record | QuestionStatus, view: View) -> None:
    if isinstance(event, logs.LogLine) and event.level >= logging.WARNING:
        view.put(f"warning: {event.message}")
    view.put(event)


def _cancel(
    client: Client,
    goal_id: str,
    view: View,
    sent: threading.Event,
    ended: threading.Event,
    canceling: threading.Event,
) -> None:
    """Cancel a goal as soon as the server answers. Show a message if it does not answer soon.

    Args:
        client: Client of the server.
        goal_id: Id of the goal.
        view: View that shows the goal.
        sent: Set when the server has accepted the goal, or the command ends.
        ended: Set when the command ends.
        canceling: Event to set.
    """
    canceling.set()
    words = _SILENT.format(client.url, f"{datetime.now():%H:%M:%S}")
    with _if_late(lambda: view.put(words)):
        sent.wait()
        while not ended.is_set():
            try:
                client.cancel(goal_id)
            except ServerUnreachable:
                ended.wait(_RETRY)
                continue
            except ClientError as error:
                view.put(f"warning: {error}")
            else:
                view.put(CANCELING)
            return


@contextmanager
def _silence_shown(client: Client, view: View, canceling: threading.Event) -> Iterator[None]:
    """During this context, show a message each time that the server stops answering.

    Not while `canceling` is set: the view shows only the last message, and that of a cancel that
    waits says more.
    """
    ended = threading.Event()

    def show(words: str) -> None:
        if not canceling.is_set():
            view.put(words)

    def check() -> None:
        answers = True
        while not ended.wait(_CHECK_PERIOD):
            words = _HANGS.format(f"{datetime.now():%H:%M:%S}")
            with _if_late(partial(show, words)) if answers else nullcontext():
                try:
                    client.status()
                    answers = True
                except ClientError as error:
                    answers = not isinstance(error, ServerUnreachable)

    thread = RealClock().spawn(check, "check")
    try:
        yield
    finally:
        ended.set()
        thread.join(_LATE)  # a check of a silent server takes longer


@contextmanager
def _if_late(act: Callable[[], None]) -> Iterator[None]:
    """Call a function if this context takes longer than `_LATE`."""
    timer = threading.Timer(_LATE, act)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
