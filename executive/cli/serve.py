"""`armtree serve`."""

from typing import Any

import click

from executive.api import PORT

from .support.options import Finite, run_options, source_options


@click.command()
@source_options
@click.option("--activate", is_flag=True, help="Activate the arm at once. This may move it.")
@click.option(
    "--policy",
    type=click.Choice(["reject", "queue", "preempt"]),
    default="reject",
    show_default=True,
    help="What happens to a goal while another one runs.",
)
@click.option(
    "--bind", "address", default="127.0.0.1", show_default=True, help="Address to listen on."
)
@click.option(
    "--tcp-port",
    type=click.IntRange(0, 65535),
    envvar="ARMTREE_TCP_PORT",
    default=PORT,
    show_default=True,
    help="Port to listen on; 0 for any free one.",
)
@click.option(
    "--result-timeout",
    type=Finite(-1),
    default=900.0,
    show_default=True,
    metavar="SECONDS",
    help="How long a result is kept [s]; -1: until there are 1000 newer ones.",
)
@click.option(
    "--host", "hosts", multiple=True, help="Further name of this server: NAME or NAME:PORT."
)
@click.option(
    "--origin", "origins", multiple=True, help="Web page that may connect: http://NAME:PORT."
)
@click.option(
    "--expose",
    is_flag=True,
    help="Accept other machines. Everything but a stop needs the token.",
)
@click.option("--rosbridge", is_flag=True, help="Accept rosbridge clients too, without a token.")
@run_options
def serve(
    address: str,
    tcp_port: int,
    hosts: tuple[str, ...],
    origins: tuple[str, ...],
    expose: bool,
    rosbridge: bool,
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
    from executive.api.events import Policy
    from executive.server.server import ListenOptions
    from executive.setup import Setup

    from .support.run_server import serve as run_server

    listen = ListenOptions(
        address=address,
        port=tcp_port,
        hosts=hosts,
        origins=origins,
        expose=expose,
        rosbridge=rosbridge,
    )
    run_server(Setup(policy=Policy(policy), **options), listen)
