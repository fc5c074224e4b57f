"""The commands that talk to a server: send, cancel, answer, pause, status and others."""

import functools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.code_table import exit_status

from .settings import Whole
from .support.command_group import command, diagnostics
from .support.names import RECORDING, TASK, check_goal_id, complete_node
from .support.options import pose_option, robot_option, server_option, set_option
from .terminal.streams import echo, echo_result

if TYPE_CHECKING:
    from executive.client.synchronous import Client


def _check_goal(context: click.Context, parameter: click.Parameter, value: str) -> str:
    """Return the id of a goal. Raise a usage error for any other text."""
    if value.partition(":")[0] == "latest":
        way = f"for the running goal, type `{context.command_path}`"
        raise click.BadParameter(f"{value!r} names a recording, not a goal; {way}")
    return check_goal_id(context, parameter, value)


_goal_argument = click.argument("goal_id", metavar="[GOAL]", default="", callback=_check_goal)


def _with_client(function: Callable[..., None]) -> Callable[..., None]:
    """Add --json and --server to a command. Call the command with a client and `as_json`."""

    @click.option("--json", "as_json", is_flag=True, help="Print JSON.")
    @server_option
    @functools.wraps(function)
    def command(server: str, as_json: bool, **options: Any) -> None:
        from executive.client.synchronous import Client

        with Client(server) as client:
            function(client, as_json, **options)

    return command


@command()
@click.argument("task", type=TASK)
@click.option("--wait", is_flag=True, help="Show the run until it ends. Ctrl-C cancels the goal.")
@click.option(
    "--deadman",
    is_flag=True,
    help="Like --wait. The server cancels the goal if this command dies or stops responding.",
)
@set_option
@robot_option
@_with_client
def send(
    client: "Client",
    as_json: bool,
    task: int | str,
    wait: bool,
    deadman: bool,
    settings: tuple[str, ...],
    robot: Path | None,
) -> None:
    """Run TASK on a server. TASK is the number or the name of a task.

    Prints the id of the goal at once. With --wait, shows the run as `armtree run` does.
    """
    from .support.server_goals import parameters, send_and_wait
    from .support.server_requests import check_robot

    check_robot(client, robot)
    if wait or deadman:
        outcome = send_and_wait(client, task, settings, deadman, as_json, diagnostics().verbose)
        sys.exit(exit_status(outcome.code))
    goal_id = client.send(task, parameters(settings))
    echo_result(as_json, {"goal_id": goal_id}, goal_id)


@command()
@_goal_argument
@click.option(
    "--until",
    "stamp_ns",
    type=Whole(1, 2**63 - 1),
    metavar="NS",
    help="Cancel all goals accepted at or before this time [ns since 1970].",
)
@_with_client
def cancel(client: "Client", as_json: bool, goal_id: str, stamp_ns: int | None) -> None:
    """Cancel GOAL on a server. Without GOAL, stop the arm and cancel all goals.

    The exit status is 4 if there is nothing to cancel.
    """
    from executive.errors import GoalError

    from .support.server_requests import CANCEL_MESSAGES

    some = goal_id or stamp_ns
    answer = client.cancel(goal_id, stamp_ns or 0) if some else client.stop()
    if as_json:
        echo(json.dumps(answer.to_json()))
    else:
        canceled = [f"canceling {goal}" for goal in answer.goals]
        echo(*(canceled or [CANCEL_MESSAGES[answer.code]]))
    sys.exit(GoalError.exit_status if answer.code.value else 0)


@command()
@robot_option
@_with_client
def status(client: "Client", as_json: bool, robot: Path | None) -> None:
    """Print the state of a server: its arm, goals and breakpoints."""
    from .support.server_requests import check_robot, status_lines

    check_robot(client, robot)
    found = client.status()
    lines = [] if as_json else status_lines(found, client.where())
    echo_result(as_json, found.to_json(), *lines)


@command()
@click.argument("recording", required=False, type=RECORDING)
@click.option("--print", "only_print", is_flag=True, help="Print the link. Open no browser.")
@_with_client
def view(client: "Client", as_json: bool, recording: Path | None, only_print: bool) -> None:
    """Open the page of a server in a browser, signed in.

    With RECORDING, show recordings without an arm and without a server, until Ctrl-C. RECORDING is
    a file, `latest`, or a folder.

    The link works once. It is also printed, for another browser.

    \b
    Examples:
      armtree view
      armtree view latest
      armtree view recordings
    """  # noqa: D301
    import webbrowser

    def show(link: str) -> None:
        echo_result(as_json, {"url": link}, link)
        if not (only_print or as_json):
            webbrowser.open(link)

    if recording is None:
        show(client.page_link())
        return
    from .support.run_server import view_recordings

    view_recordings(recording, show)


@command()
@_with_client
def watch(client: "Client", as_json: bool) -> None:
    """Show everything that a server does, until Ctrl-C. Goals are not affected."""
    from .support.server_goals import watch as watch_server

    watch_server(client, as_json, diagnostics().verbose)


@command()
@click.argument(
    "transition",
    metavar="TRANSITION",
    type=click.Choice(["configure", "activate", "deactivate", "cleanup", "shutdown"]),
)
@pose_option
@_with_client
def arm(client: "Client", as_json: bool, transition: str, pose: str | None) -> None:
    """Change the lifecycle state of a server's arm.

    TRANSITION is configure, activate, deactivate, cleanup or shutdown. activate opens the serial
    port, which may move the arm.
    """
    from .support.server_goals import activate

    stops = client.status().stops  # a stop that overtakes this command ends it
    if transition == "activate" and not as_json:
        echo(activate(client, pose, stops, diagnostics().verbose))
        return
    state = client.arm(transition, pose, stops)
    echo_result(as_json, {"arm": state}, state)


def _goal_command(change: str, meaning: str) -> click.Command:
    """Return a command that calls a method of the client with a goal or the running goal."""

    @command(change, help=meaning)
    @_goal_argument
    @_with_client
    def run(client: "Client", as_json: bool, goal_id: str) -> None:
        from executive.api.outcome import cause_of
        from executive.errors import NotExecuting, Refused
        from logs import goal_title

        running = client.status().goal
        if not goal_id and running is None:
            raise Refused(cause_of(NotExecuting()))
        goal = getattr(client, change)(goal_id or (running and running.identity))
        title = f"{goal_title(goal.task)} ({goal.identity})"
        echo_result(as_json, goal.to_json(), title)

    return run


pause = _goal_command(
    "pause", "Pause GOAL on a server and stop the arm. Without GOAL, pause the running goal."
)
resume = _goal_command(
    "resume", "Resume a paused GOAL on a server. Without GOAL, resume the paused goal."
)
step = _goal_command(
    "step",
    "Resume a paused GOAL on a server until its next skill starts. Without GOAL, resume the "
    "paused goal.",
)


@command("break")
@click.argument("node", required=False, shell_complete=complete_node)
@click.option("--off", is_flag=True, help="Remove the breakpoint.")
@_with_client
def break_(client: "Client", as_json: bool, node: str | None, off: bool) -> None:
    """Set or remove a breakpoint on a server, or list the breakpoints.

    Each goal pauses before it starts NODE. NODE is a path that `armtree watch` prints. Without
    NODE, list all breakpoints.
    """
    if off and not node:
        raise click.UsageError("--off needs a NODE")
    breakpoints = client.break_at(node, not off) if node else client.status().breakpoints
    lines = breakpoints or ["no breakpoints"]
    echo_result(as_json, {"breakpoints": breakpoints}, *lines)


@command()
@click.argument("words", nargs=-1, metavar="[ID] [WORDS]...")
@_with_client
def answer(client: "Client", as_json: bool, words: tuple[str, ...]) -> None:
    """Answer a question of a running task on a server.

    Without WORDS, list the open questions. ID is needed if several questions are open.
    """
    from .support.server_requests import answer_question

    echo(*answer_question(client, words, as_json))
