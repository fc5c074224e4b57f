"""Short requests of client commands to a server, and the output of their answers."""

import dataclasses
import json
import re
import shlex
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from executive.api import token_file
from executive.api.events import Status, Where
from executive.api.outcome import CancelCode, CancelResult
from executive.cli.settings import configured, environment_name
from executive.cli.terminal.streams import echo
from executive.client.synchronous import Client
from executive.errors import ClientError, NotEnded, NothingToStop, ServerUnreachable
from logs import goal_title

from .failures import Refusal, print_error
from .own_arms import own_runs, running_server, server_at_port

if TYPE_CHECKING:
    from hardware import Robot

_QUESTION_ID = re.compile("[0-9a-f]{8}")
_LONGEST_END = 10.0  # longest time in which a stopped command completes its recording [s]
_LATE = 2.0  # time after which a missing answer to a stop is shown [s]
_NO_ANSWER_YET = "No answer yet. If the arm moves, switch off its power"
_NO_QUESTION = "there is no open question"


def find_server(server: str | None) -> str | None:
    """Return the URL of the server that holds the arm, or None for an arm of this command.

    The server is the one that the command names, else the server on this machine. The result is
    None if the command names a port, or a robot without a driver that this server does not hold.

    Raises:
        Refusal: Several servers run on this machine, or the server does not hold the named robot.
        ClientError: The user names a robot, and the server does not answer.
    """
    context, named = click.get_current_context(), server
    if not server:
        if context.get_parameter_source("port") is ParameterSource.COMMANDLINE:
            return None
        server = running_server()
    if server and (given := context.params.get("robot")):
        from hardware import load_robot  # a stop does not need this import

        with Client(server) as client:
            robot = load_robot(given)
            if not (named or robot.has_driver or holds(client.robot(), robot)):
                return None  # without a driver, the robot moves only on the port virtual
            check_robot(client, given)
    return server


def check_robot(client: Client, given: Path | None) -> None:
    """Reject a server that does not hold the robot that the user names.

    Args:
        client: Client of the server.
        given: Robot file of an option or setting; None if there is none.

    Raises:
        Refusal: The server holds another robot.
        ClientError: The server does not answer.
    """
    if given is None:
        return
    from hardware import load_robot  # a stop does not need this import

    context = click.get_current_context()
    held, robot = client.robot(), load_robot(given)
    if holds(held, robot):
        return
    source, by = context.get_parameter_source("robot"), "--robot"
    if source is ParameterSource.ENVIRONMENT:
        by = environment_name("robot")
    elif source is not ParameterSource.COMMANDLINE:
        by = configured(context)["robot"].place
    other = " with other joints" if held["name"] == robot.name else ""
    ways = f"Start a server for that robot: `armtree serve --robot {shlex.quote(str(given))}`"
    if "port" in context.params:
        ways += ", or use an arm of this command: --port PORT, or --port virtual"
    why = f"the server {client.url} holds {held['name']}{other}, but {by} names {robot.name}"
    raise Refusal(f"{why}. {ways}")


def holds(held: Mapping[str, Any], robot: "Robot") -> bool:
    """Return True if a description from `Client.robot` has the name and joints of a robot."""
    joints = {joint["name"] for joint in held["joints"]}
    return held["name"] == robot.name and joints >= {joint.name for joint in robot.joints}


def stop_all(server: str | None, as_json: bool) -> int:
    """Stop arms at the same time, and print the result of each.

    Args:
        server: URL of the server whose arm is stopped. None for all arms of this user on this
            machine: of servers, and of commands such as `armtree run`. If there are none, the arm
            of the server at the port of the settings is stopped, even if another user started it.
        as_json: True to print JSON.

    Returns:
        The exit status: 0 if all arms have stopped.
    """
    if server:
        return _stop_servers([server], as_json)
    with own_runs() as runs:
        deadline = time.monotonic() + _LONGEST_END
        for run in runs:
            run.stop()
        urls = [info.url for info in token_file.running()]
        if not (runs or urls):
            return _stop_servers([server_at_port()], as_json, own=False)
        status = _stop_servers(urls, as_json)
        for run in runs:
            if not run.wait(deadline):
                status = print_error(NotEnded(f"{run.command} (process {run.pid})"))
            elif as_json:
                echo(json.dumps({"command": run.command, "process": run.pid}))
            else:
                echo(f"Stopped the arm of {run.command} (process {run.pid}), which has ended")
    return status


def _stop_servers(urls: Sequence[str], as_json: bool, own: bool = True) -> int:
    """Stop the arms of servers at the same time, and print the result of each.

    Args:
        urls: URLs of the servers.
        as_json: True to print JSON.
        own: False if this user has started no server.

    Returns:
        The exit status: 0 if all arms have stopped.
    """

    def stop(url: str) -> tuple[str, CancelResult | ClientError]:
        with Client(url) as client:
            try:
                return client.url, client.stop()
            except ClientError as error:
                nothing = isinstance(error, ServerUnreachable) and not own
                folder = token_file.runtime_folder()
                return client.url, NothingToStop(folder) if nothing else error

    status = 0
    with ThreadPoolExecutor(len(urls) or 1, "stop") as threads:
        answers = [threads.submit(stop, url) for url in urls]
        if wait(answers, _LATE).not_done:
            echo(_NO_ANSWER_YET, err=True)
        for url, answer in (each.result() for each in answers):
            if isinstance(answer, ClientError):
                status = print_error(answer)
            elif as_json:
                echo(json.dumps({"server": url, **answer.to_json()}))
            else:
                canceled = ", ".join(answer.goals)
                done = f"canceled {canceled}" if canceled else "no goal was under way"
                whose = "" if own else ", which another user or session started"
                echo(f"Stopped the arm of {url}{whose}; {done}")
    return status


def answer_question(client: Client, words: Sequence[str], as_json: bool) -> Sequence[str]:
    """Answer a question of a server, or list the open questions.

    Args:
        client: Client of the server.
        words: The id of the question, and the answer. The id may be omitted if only one question
            is open. If there are no words, the questions are listed.
        as_json: True to return JSON.

    Returns:
        The answer that the server accepted, or a line per question.

    Raises:
        Refusal: An id is needed, or no question is open.
        ClientError: The server cannot be reached, or rejects the answer.
    """
    open_questions = client.questions()
    if not words:
        listed = [*map(str, open_questions)] or [_NO_QUESTION]
        questions = [dataclasses.asdict(question) for question in open_questions]
        return [json.dumps({"questions": questions})] if as_json else listed
    if _QUESTION_ID.fullmatch(words[0]):
        question, *words = words
    elif len(open_questions) == 1:
        question = open_questions[0].question_id
    else:
        ids = "; ".join(map(str, open_questions))
        raise Refusal(f"give an id: {ids}" if ids else _NO_QUESTION)
    accepted = client.answer(question, " ".join(words))
    return [json.dumps({"question_id": question, "answer": accepted}) if as_json else accepted]


def status_lines(status: Status, where: Where) -> Iterator[str]:
    """Yield the state of a server and the position of its arm, line by line."""
    yield f"Arm       {status.arm}, port {status.port or 'none'}"
    if fault := status.fault:
        yield f"Fault     {fault}"
        if fault.advice:
            yield f"          -> {fault.advice}"
    if where.commanded:
        yield f"Commanded {where.words(where.commanded)}"
    if where.measured:
        yield f"Measured  {where.words(where.measured)}"
    if where.tool:
        yield f"Tool      {where.tool_words}"
    if status.goal:
        percentage = "" if status.percentage is None else f", {status.percentage} %"
        phase = " ".join(filter(None, ("PAUSED" if status.paused else status.phase, status.node)))
        goal = f"{goal_title(status.goal.task)}, {status.goal.state.name}{percentage}"
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
    CancelCode.REJECTED: "the server rejects the cancel",
    CancelCode.UNKNOWN_GOAL_ID: "no such goal is known",
    CancelCode.GOAL_TERMINATED: "that goal has ended, or is already being canceled",
}
