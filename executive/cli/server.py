"""`armtree serve`, and its clients."""

import json
import re
import sys
from pathlib import Path
from typing import Any

import click

from executive.codes import look_up

from .options import (
    Finite,
    keep_days_option,
    keep_mb_option,
    port_option,
    pose_option,
    recordings_option,
    robot_option,
    seed_option,
    skills_option,
    trees_option,
    workers_option,
)

TCP_PORT = 8765


@click.command()
@port_option
@robot_option
@trees_option
@skills_option
@recordings_option
@click.option("--activate", is_flag=True, help="Activate the arm at once; this moves it.")
@click.option(
    "--policy",
    type=click.Choice(["reject", "queue", "preempt"]),
    default="reject",
    show_default=True,
    help="What becomes of a goal while another one runs.",
)
@click.option(
    "--bind",
    "address",
    default="127.0.0.1",
    show_default=True,
    help="Address to listen on.",
)
@click.option(
    "--tcp-port",
    type=click.IntRange(0, 65535),
    envvar="ARMTREE_TCP_PORT",
    default=TCP_PORT,
    show_default=True,
    help="0 for any that is free.",
)
@click.option(
    "--result-timeout",
    type=Finite(-1),
    default=900.0,
    show_default=True,
    metavar="SECONDS",
    help="How long results are kept; 0: not at all, -1: until 1000 others have come.",
)
@click.option(
    "--host", "hosts", multiple=True, help="Another name of this server: NAME or NAME:PORT."
)
@click.option("--origin", "origins", multiple=True, help="A page that may ask: http://name:port.")
@click.option("--expose", is_flag=True, help="Let other machines in; all but a stop needs a token.")
@click.option("--rosbridge", is_flag=True, help="Serve rosbridge clients too, without a token.")
@pose_option
@seed_option
@workers_option
@keep_days_option
@keep_mb_option
def serve(
    port: str | None,
    robot: Path | None,
    trees: Path | None,
    skills: Path | None,
    recordings: Path,
    activate: bool,
    policy: str,
    result_timeout: float,
    pose: str | None,
    seed: int,
    workers: int,
    keep_days: float | None,
    keep_mb: float | None,
    **place: Any,
) -> None:
    """Take goals from other programs, until Ctrl-C. The arm is inactive at first."""
    from executive.goals.queue import Policy
    from executive.server.server import ListenOptions
    from executive.setup import Setup

    from .serve import serve as run

    setup = Setup(
        port=port,
        robot=robot,
        trees=trees,
        recordings=recordings,
        seed=seed,
        workers=workers,
        policy=Policy(policy),
        result_timeout=result_timeout,
        activate=activate,
        pose=pose,
        keep_days=keep_days,
        keep_mb=keep_mb,
    )
    run(setup, ListenOptions(port=place.pop("tcp_port"), **place))


def _url(context: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    if value and not value.startswith(("http://", "https://")):
        raise click.BadParameter(f"{value!r} is no URL of a server, which begins with http://")
    return value


server_option = click.option(
    "--server",
    metavar="URL",
    callback=_url,
    envvar="ARMTREE_SERVER",
    show_envvar=True,
    help="Where the server is; default: the one on this machine, on ARMTREE_TCP_PORT.",
)


def _identity(context: click.Context, parameter: click.Parameter, value: str) -> str:
    if value and not re.fullmatch("[0-9a-f]{32}", value):
        raise click.BadParameter(
            f"{value!r} is no goal's id, which is 32 digits, 0 to 9 and a to f"
        )
    return value


goal_argument = click.argument("goal_id", metavar="[GOAL]", default="", callback=_identity)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


def _verbose() -> bool:
    return bool(click.get_current_context().find_root().params["verbose"])


@click.command()
@click.argument("number", metavar="N", type=click.IntRange(0, 2**31 - 1))
@click.option("--wait", is_flag=True, help="Show the run until it ends; Ctrl-C cancels it.")
@click.option(
    "--deadman", is_flag=True, help="Cancel it if this command dies or stops answering; waits."
)
@click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="Value of a parameter of the task; may be given again.",
)
@json_option
@server_option
def send(
    number: int,
    wait: bool,
    deadman: bool,
    settings: tuple[str, ...],
    as_json: bool,
    server: str | None,
) -> None:
    """Have a server run task N. Prints the goal's id, or with --wait what `run` prints."""
    from executive.client.synchronous import Client

    from .remote import errors_told, send_and_wait, texts

    with errors_told(as_json), Client(server) as client:
        if wait or deadman:
            outcome = send_and_wait(client, number, settings, deadman, as_json, _verbose())
            sys.exit(look_up(outcome.code).exit_status)
        goal_id = client.send(number, texts(settings, number))
    click.echo(json.dumps({"goal_id": goal_id}) if as_json else goal_id)


@click.command()
@goal_argument
@click.option(
    "--until",
    "stamp_ns",
    type=click.IntRange(1, 2**63 - 1),
    metavar="NS",
    help="All that were accepted at or before this time [ns since 1970].",
)
@json_option
@server_option
def cancel(goal_id: str, stamp_ns: int | None, as_json: bool, server: str | None) -> None:
    """Cancel a goal of a server, by its id; without one stop the arm and cancel all."""
    from executive.client.synchronous import Client
    from executive.errors import GoalError

    from .remote import CANCEL_WORDS, errors_told

    with errors_told(as_json), Client(server) as client:
        some = goal_id or stamp_ns
        answer = client.cancel(goal_id, stamp_ns or 0) if some else client.stop()
    if as_json:
        click.echo(json.dumps({"return_code": answer.code.value, "goals": answer.goals}))
    else:
        click.echo(
            "\n".join(f"canceling {goal}" for goal in answer.goals) or CANCEL_WORDS[answer.code]
        )
    sys.exit(GoalError.exit_status if answer.code.value else 0)


@click.command()
@json_option
@server_option
def status(as_json: bool, server: str | None) -> None:
    """Say what a server, its arm and its goals are at."""
    from executive.client.synchronous import Client

    from .remote import errors_told, status_json, status_lines

    with errors_told(as_json), Client(server) as client:
        found = client.status()
    click.echo(status_json(found) if as_json else "\n".join(status_lines(found)))


@click.command()
@json_option
@server_option
def watch(as_json: bool, server: str | None) -> None:
    """Show whatever a server does, until Ctrl-C; goals go on."""
    from executive.client.synchronous import Client

    from .remote import errors_told
    from .remote import watch as look_on

    with errors_told(as_json), Client(server) as client:
        look_on(client, as_json, _verbose())


@click.command()
@click.argument(
    "transition",
    type=click.Choice(["configure", "activate", "deactivate", "cleanup", "shutdown"]),
)
@pose_option
@json_option
@server_option
def arm(transition: str, pose: str | None, as_json: bool, server: str | None) -> None:
    """Take a server's arm through its lifecycle; activate opens the port, which moves the arm."""
    from executive.client.synchronous import Client

    from .remote import errors_told

    with errors_told(as_json), Client(server) as client:
        state = client.arm(transition, pose)
    click.echo(json.dumps({"arm": state}) if as_json else state)


def _change(verb: str, goal_id: str, as_json: bool, server: str | None) -> None:
    from executive.client.errors import Refused
    from executive.client.synchronous import Client

    from .remote import errors_told

    with errors_told(as_json), Client(server) as client:
        running = client.status().goal
        if not goal_id and running is None:
            raise Refused({"code": "goal.not_executing", "message": "no goal is under way"})
        goal = getattr(client, verb)(goal_id or (running and running.identity))
    click.echo(json.dumps(goal.to_json()) if as_json else f"task {goal.task} ({goal.identity})")


@click.command()
@goal_argument
@json_option
@server_option
def pause(goal_id: str, as_json: bool, server: str | None) -> None:
    """Stop a server's arm and keep the goal; without GOAL the one under way."""
    _change("pause", goal_id, as_json, server)


@click.command()
@goal_argument
@json_option
@server_option
def resume(goal_id: str, as_json: bool, server: str | None) -> None:
    """Go on with a paused goal; without GOAL the one under way."""
    _change("resume", goal_id, as_json, server)


@click.command()
@goal_argument
@json_option
@server_option
def step(goal_id: str, as_json: bool, server: str | None) -> None:
    """Go on with a paused goal up to the next skill; without GOAL the one under way."""
    _change("step", goal_id, as_json, server)


@click.command("break")
@click.argument("node", required=False)
@click.option("--off", is_flag=True, help="Have it no longer.")
@json_option
@server_option
def break_at(node: str | None, off: bool, as_json: bool, server: str | None) -> None:
    """Have goals of a server pause before NODE, such as pick/Execute; without NODE list all."""
    from executive.client.synchronous import Client

    from .remote import errors_told

    if off and not node:
        raise click.UsageError("--off wants the NODE")
    with errors_told(as_json), Client(server) as client:
        marked = client.break_at(node, not off) if node else client.status().breakpoints
    told = "\n".join(marked) or "no breakpoints"
    click.echo(json.dumps({"breakpoints": marked}) if as_json else told)


@click.command()
@click.argument("words", nargs=-1, metavar="[ID] [WORDS]...")
@json_option
@server_option
def answer(words: tuple[str, ...], as_json: bool, server: str | None) -> None:
    """Answer what a server's task asks; without ID the only question, without WORDS list all."""
    from executive.client.synchronous import Client

    from .remote import errors_told, reply

    with errors_told(as_json), Client(server) as client:
        click.echo(reply(client, words, as_json))


COMMANDS = (serve, send, cancel, answer, pause, resume, step, break_at, status, watch, arm)
