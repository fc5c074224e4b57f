"""`armtree mcp`."""

import signal
import sys
from pathlib import Path

import click

from .settings import Whole
from .support.command_group import command
from .support.options import robot_option, server_option
from .support.process import end_process, signal_status
from .terminal.streams import echo


@command()
@click.option(
    "--http",
    "port",
    type=Whole(1, 65535),
    metavar="PORT",
    help="Serve HTTP at http://127.0.0.1:PORT/mcp. Clients send the token of the server.",
)
@click.option(
    "--allow-move", is_flag=True, help="Also offer `move`, to move joints or the tool of the arm."
)
@robot_option
@server_option
def mcp(port: int | None, allow_move: bool, robot: Path | None, server: str) -> None:
    """Offer the tasks of a server to language models, as tools (MCP).

    Start `armtree serve` first. The client starts this command, and talks to it over standard input
    and output. Put these lines into the configuration of the client:

    \b
      {"mcpServers": {"armtree":
        {"command": "armtree", "args": ["mcp"]}}}

    The tools list, check, plan and run tasks. A tool can stop the arm at any time. Only a person
    activates the arm. Goals are canceled if this command ends. This command needs the extra `mcp`:
    type `make mcp` in the repository, or install the wheel again with [mcp] behind its name.

    \b
    Examples:
      armtree mcp
      armtree mcp --http 8766
    """  # noqa: D301
    import asyncio
    from functools import partial

    from hardware import load_robot

    try:
        from executive.mcp.mcp_server import listen, make_server, serve_http, serve_stdio
    except ModuleNotFoundError as error:
        if not str(error.name).startswith("mcp"):
            raise
        raise click.UsageError(
            "the packages of the extra mcp are missing: type `make mcp` in the repository, "
            "or install the wheel again with [mcp] behind its name"
        ) from error
    make = partial(make_server, server, load_robot(robot), allow_move)
    listener = listen(port) if port else None
    if port:
        echo(f"Clients connect to http://127.0.0.1:{port}/mcp. Ctrl-C ends this command.", err=True)
    elif sys.stdin.isatty():
        echo(_TERMINAL, err=True)
    for each in (signal.SIGINT, signal.SIGTERM):
        # A thread that reads standard input never ends by itself. The server of the arm detects the
        # end of the connections, and cancels the goals.
        signal.signal(each, lambda number, _: end_process(signal_status(number)))
    asyncio.run(serve_http(make, server, listener) if listener else serve_stdio(make()))


_TERMINAL = (
    "A client of the Model Context Protocol starts this command, and talks to it over standard "
    "input. armtree mcp --help shows how to configure a client. Ctrl-C ends this command."
)
