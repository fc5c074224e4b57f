"""`armtree fleet`: commands for many arms and their jobs."""

import json
import logging
import sys
from collections.abc import Callable, Coroutine, Sequence
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.api import ADDRESS, NATS_PORT, POOL
from executive.code_table import exit_status

from .settings import ABOVE_0, PATH, FleetUrl, Url, Whole, option
from .support.command_group import CommandGroup
from .support.names import TASK, check_goal_id
from .support.options import server_option, set_option
from .terminal.log_printer import LogPrinter
from .terminal.streams import echo, echo_result

if TYPE_CHECKING:
    from executive.fleet.errors import Confirmation
    from executive.fleet.fleet_client import FleetClient
    from executive.fleet.programs import Act
    from executive.fleet.values import Job, JobRecord

_HERE = f"nats://{ADDRESS}:{NATS_PORT}"
_IDENTITY = click.argument("identity", metavar="JOB", callback=check_goal_id)
_WHOM = click.argument("whom", metavar="[POOL|ARM]...", nargs=-1)
_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON: an object per line.")
_FLEET = option("fleet", "url", default=_HERE)


def _run(url: str, act: "Act", interrupted: "Act | None" = None) -> None:
    """Call a function with a client of the fleet. After Ctrl-C, also call `interrupted`."""
    from executive.fleet.programs import run

    run(url, act, interrupted)


def _with_fleet(function: "Callable[..., Coroutine[Any, Any, None]]") -> Callable[..., None]:
    """Add the option of the fleet to a command. Call the command with a client of the fleet."""

    @_FLEET
    @wraps(function)
    def command(url: str, **options: Any) -> None:
        _run(url, lambda client: function(client, **options))

    return command


def _print_log() -> None:
    logging.getLogger().addHandler(LogPrinter())
    # asyncio warns of each refused TLS connection.
    logging.getLogger("asyncio").setLevel(logging.ERROR)


@click.group(cls=CommandGroup)
def fleet() -> None:
    """Run many arms: send jobs to pools of them, watch them, and stop them all.

    \b
    Start here:
      armtree fleet up
      armtree serve --port virtual --activate --fleet URL
      armtree fleet send 0 --wait
      armtree fleet ls
    """  # noqa: D301


@fleet.command()
@click.option(
    "--data",
    metavar="FOLDER",
    type=PATH,
    default=Path("fleet"),
    show_default=True,
    help="Folder for jobs and their records. It is created if it does not exist.",
)
@click.option(
    "--bind",
    "address",
    metavar="ADDRESS",
    default=ADDRESS,
    show_default=True,
    help="Address to listen on. An address that other machines can reach needs TLS and --nkeys.",
)
@click.option(
    "--nats-port",
    "port",
    metavar="PORT",
    type=Whole(1, 65535),
    default=NATS_PORT,
    show_default=True,
    help="TCP port.",
)
@click.option(
    "--http-port",
    metavar="PORT",
    type=Whole(0, 65535),
    default=8770,
    show_default=True,
    help="TCP port of the page and of the metrics for Prometheus; 0 for any free one.",
)
@click.option(
    "--use",
    "existing",
    type=FleetUrl(),
    metavar="URL",
    help="Use this NATS server, and start none. Its setting `sync_interval` must be `always`.",
)
@click.option("--tls-cert", metavar="FILE", type=PATH, help="TLS certificate of the fleet.")
@click.option("--tls-key", metavar="FILE", type=PATH, help="Private key of the certificate.")
@click.option(
    "--nkeys",
    metavar="FILE",
    type=PATH,
    help="Public keys that may connect: lines with `operator KEY` or `arm KEY POOL.NAME`.",
)
def up(
    data: Path,
    address: str,
    port: int,
    http_port: int,
    existing: str | None,
    tls_cert: Path | None,
    tls_key: Path | None,
    nkeys: Path | None,
) -> None:
    """Start the NATS server of a fleet, until Ctrl-C.

    If an arm is lost, its job fails. If the task file has `retry: safe`, another arm gets the job
    instead. The command also serves a page with all arms, for browsers on this machine. By default
    only programs of this user on this machine can connect to the fleet.
    """
    from executive.fleet.programs import NatsOptions, up as run_up

    _print_log()
    own = NatsOptions(data, address, port, tls_cert, tls_key, nkeys)
    run_up(existing or own.url, http_port, None if existing else own)


@fleet.command()
@click.argument("file", metavar="FILE", type=PATH)
def key(file: Path) -> None:
    """Write a new private key to FILE, and print its public key.

    The public key is for `fleet up --nkeys`. Programs read the path of FILE from the environment
    variable ARMTREE_FLEET_NKEY.
    """
    from executive.fleet.programs import make_key

    echo(make_key(file))


@fleet.command()
@server_option
@_FLEET
@click.option("--pool", metavar="POOL", required=True, help="Pool whose jobs the arm runs.")
@click.option("--name", metavar="NAME", required=True, help="Name of the arm in the pool.")
@click.option(
    "--page",
    type=Url(),
    metavar="URL",
    help="URL of the page of the arm, for other machines. Default: the URL of --server.",
)
@click.option("--child", is_flag=True, hidden=True, help="End when standard input ends.")
def join(server: str, url: str, pool: str, name: str, page: str | None, child: bool) -> None:
    """Let the arm of a server run the jobs of a pool, until Ctrl-C.

    `armtree serve --fleet URL` does this for its own arm.
    """
    import asyncio

    from executive.fleet.programs import join as run_join
    from executive.fleet.worker_process import FleetPlace

    _print_log()
    asyncio.run(run_join(server, FleetPlace(url, pool, name), page or "", child))


@fleet.command()
@click.argument("task", type=TASK)
@click.option("--pool", metavar="POOL", default=POOL, show_default=True, help="Pool for TASK.")
@set_option
@click.option(
    "--id",
    "identity",
    metavar="ID",
    default="",
    callback=check_goal_id,
    help="Id of the job: 32 digits, 0 to 9, a to f. Default: a random id.",
)
@click.option(
    "--priority",
    type=click.Choice(["high", "normal", "low"]),
    default="normal",
    show_default=True,
    help="Arms take jobs of a higher priority first.",
)
@click.option(
    "--start-within",
    metavar="SECONDS",
    type=ABOVE_0,
    help="The job fails if no arm starts it within this time [s].",
)
@click.option(
    "--end-within",
    metavar="SECONDS",
    type=ABOVE_0,
    help="Cancel the job if it does not end within this time [s].",
)
@click.option(
    "--wait",
    is_flag=True,
    help="Wait for the end of the job, and exit with the status of its run. Ctrl-C cancels the "
    "job.",
)
@_JSON
@_FLEET
def send(
    url: str,
    as_json: bool,
    task: int | str,
    pool: str,
    settings: tuple[str, ...],
    identity: str,
    priority: str,
    start_within: float | None,
    end_within: float | None,
    wait: bool,
) -> None:
    """Send TASK to a pool of arms. A free arm of the pool runs it once.

    Prints the id of the job when the job is on disk. A second job with the same id is refused, so
    it is safe to repeat this command with --id.
    """
    import asyncio

    from .support.server_goals import parameters

    sending: list[asyncio.Task[Job]] = []
    ended: list[JobRecord] = []

    async def act(client: "FleetClient") -> None:
        limits = (start_within, end_within)
        send = client.send(task, pool, parameters(settings), identity, priority, *limits)
        sending.append(asyncio.create_task(send))
        job = await asyncio.shield(sending[0])
        echo_result(as_json, {"event": "queued", "job": job.identity}, job.identity)
        if why := (await client.waiting()).get(pool):
            echo(why, err=True)
        if wait:
            async for record in client.wait(job.identity):
                _print_job(record, as_json)
                ended[:] = [record]

    async def interrupted(client: "FleetClient") -> None:
        for each in sending if wait else ():
            record, _ = await client.cancel((await each).identity)
            _print_job(record, as_json)

    _run(url, act, interrupted)
    if ended and ended[0].result:
        sys.exit(exit_status(ended[0].result.code))


def _print_job(found: "Job | JobRecord", as_json: bool) -> None:
    from .terminal.fleet_tables import job_row, job_text

    echo_result(as_json, job_row(found), job_text(found))


@fleet.command()
@_IDENTITY
@_JSON
@_with_fleet
async def cancel(client: "FleetClient", as_json: bool, identity: str) -> None:
    """Cancel JOB: a queued job ends at once, a running job when its arm has stopped."""
    record, had_ended = await client.cancel(identity)
    if had_ended:
        echo("the job had ended before the cancel", err=True)
    _print_job(record, as_json)


@fleet.command()
@_JSON
@_with_fleet
async def ls(client: "FleetClient", as_json: bool) -> None:
    """List the arms, with state, job, last outcome and the URL of their pages."""
    from .terminal.fleet_tables import arms_table

    rows = await client.arms()
    if as_json:
        for row in rows:
            echo(json.dumps(row.to_json()))
    else:
        echo(*arms_table(rows))


@fleet.command()
@click.argument("identity", metavar="[JOB]", default="", callback=check_goal_id)
@click.option(
    "--last", metavar="N", type=Whole(1), default=20, show_default=True, help="Only the newest N."
)
@_JSON
@_with_fleet
async def jobs(client: "FleetClient", as_json: bool, identity: str, last: int) -> None:
    """List the jobs, the newest last, or show JOB."""
    found: list[JobRecord | Job] = []
    if identity:
        found.append(await client.job(identity))
    else:
        number, queued = await client.queued(last)
        echo(f"Queued jobs: {number}", err=True)
        found += await client.records()
        found += queued
    for each in found[-last:]:
        _print_job(each, as_json)


@fleet.command()
@_WHOM
@_JSON
@_with_fleet
async def stop(client: "FleetClient", as_json: bool, whom: tuple[str, ...]) -> None:
    """Stop all arms, those of a POOL, or an ARM such as arms.arm-7. It is not an emergency stop.

    The arms take no jobs until `armtree fleet resume`. Each arm confirms the stop. If an arm does
    not, the command names it, and the exit status is 13.
    """
    await _confirmed(client, as_json, "stop", whom)


@fleet.command()
@_WHOM
@_JSON
@_with_fleet
async def resume(client: "FleetClient", as_json: bool, whom: tuple[str, ...]) -> None:
    """Let arms take jobs again after a stop: all arms, those of a POOL, or an ARM."""
    await _confirmed(client, as_json, "resume", whom)


async def _confirmed(
    client: "FleetClient", as_json: bool, request: str, whom: tuple[str, ...]
) -> None:
    from executive.fleet.errors import NotConfirmed

    def show(confirmed: "Sequence[Confirmation]") -> None:
        for each in confirmed:
            row = {"arm": each.arm, "goals": each.goals, "ms": round(1000 * each.seconds, 1)}
            echo_result(as_json, row, f"{each.arm}  {request} confirmed after {row['ms']} ms")

    try:
        confirmed = await getattr(client, request)(whom)
    except NotConfirmed as error:
        show(error.confirmed)
        raise
    show(confirmed)
    if not confirmed:
        echo(f"no arm has joined, so none confirmed the {request}", err=True)


@fleet.command()
@click.argument("arm", metavar="ARM")
@_with_fleet
async def forget(client: "FleetClient", arm: str) -> None:
    """Remove ARM from the list of arms. For an arm that does not exist any more."""
    await client.forget(arm)


@fleet.command()
@_IDENTITY
@click.option(
    "-o",
    "--output",
    metavar="FOLDER",
    type=PATH,
    default=Path(),
    help="Folder for the file. Default: the working directory.",
)
@click.option(
    "--from",
    "server",
    type=Url(),
    metavar="URL",
    help="URL of the arm's server, if the URL in `fleet jobs` is not reachable, or if the server "
    "needs its token. Only this server gets ARMTREE_TOKEN.",
)
@_JSON
@_with_fleet
async def logs(
    client: "FleetClient", as_json: bool, identity: str, output: Path, server: str | None
) -> None:
    """Fetch the recording of JOB from the server of its arm, and print the path of the file.

    Servers on other machines need their token: see --from.
    """
    from executive.fleet.programs import fetch_recording

    path = await fetch_recording(client, identity, output, server)
    echo_result(as_json, {"file": str(path)}, str(path))


@fleet.command()
@_with_fleet
async def top(client: "FleetClient") -> None:
    """Show the arms and the queue once a second, until Ctrl-C."""
    from .terminal.fleet_tables import top as show

    await show(client)
