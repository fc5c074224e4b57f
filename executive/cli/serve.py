"""`armtree serve`."""

from typing import Any

import click

from executive.api import ADDRESS, POOL

from .settings import configured, option
from .support.command_group import command
from .support.options import run_options, source_options


@command()
@source_options
@click.option("--activate", is_flag=True, help="Activate the arm at once. This may move the arm.")
@option("policy")
@click.option(
    "--bind",
    "address",
    metavar="ADDRESS",
    default=ADDRESS,
    show_default=True,
    help="Address to listen on.",
)
@option("tcp_port")
@option("result_timeout")
@click.option(
    "--host",
    "hosts",
    metavar="NAME",
    multiple=True,
    help="Another name of this server: NAME or NAME:PORT. May be repeated.",
)
@click.option(
    "--origin",
    "origins",
    metavar="URL",
    multiple=True,
    help="Origin of web pages that may connect: http://NAME:PORT. May be repeated.",
)
@click.option(
    "--expose",
    is_flag=True,
    help="Accept other machines. They need the token for everything except a stop.",
)
@option("fleet", "fleet_url")
@click.option(
    "--pool",
    metavar="POOL",
    default=POOL,
    show_default=True,
    help="With --fleet: pool whose jobs the arm runs.",
)
@click.option(
    "--name", metavar="NAME", help="With --fleet: name of the arm. Default: that of the machine."
)
@click.option("--rosbridge", is_flag=True, help="Also accept rosbridge clients, without a token.")
@run_options
def serve(
    address: str,
    tcp_port: int,
    hosts: tuple[str, ...],
    origins: tuple[str, ...],
    expose: bool,
    rosbridge: bool,
    fleet_url: str | None,
    pool: str,
    name: str | None,
    policy: str,
    **options: Any,
) -> None:
    """Run a server that executes goals of other programs, until Ctrl-C.

    The arm is inactive until --activate is given or a client activates it.

    \b
    Examples:
      armtree serve --port virtual --activate
      armtree serve --bind 0.0.0.0 --expose --policy queue
    """  # noqa: D301
    from executive.api import Policy
    from executive.fleet.worker_process import FleetPlace, machine_name
    from executive.server.server import ListenOptions
    from executive.setup import Setup

    from .support.run_server import serve as run_server

    if not fleet_url and (name or pool != POOL):
        raise click.UsageError("--name and --pool need --fleet URL")
    listen = ListenOptions(
        address=address,
        port=tcp_port,
        hosts=hosts,
        origins=origins,
        expose=expose,
        rosbridge=rosbridge,
    )
    fleet = FleetPlace(fleet_url, pool, name or machine_name()) if fleet_url else None
    later = configured(click.get_current_context()).get("trees")
    own_trees = later.value if later else Setup.own_trees
    run_server(Setup(policy=Policy(policy), own_trees=own_trees, **options), listen, fleet)
