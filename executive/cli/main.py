"""The command line. Each command imports slow libraries only when it runs."""

import io
import logging
import sys
from typing import Any

import click

from executive.codes import INTERRUPTED_EXIT, READER_ENDED_EXIT, look_up
from executive.server import PORT

from .client import COMMANDS as CLIENT_COMMANDS
from .doctor import doctor
from .failures import print_error
from .log import log
from .options import Finite, run_options, set_option, source_options
from .plan import plan
from .process_end import forbid_exit
from .replay import replay
from .streams import LogFormatter, echo, open_closed_streams
from .tasks import COMMANDS as TASK_COMMANDS, task_number


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="armtree")
@click.option("-v", "--verbose", is_flag=True, help="Print the log to standard error.")
@click.option("--debug", is_flag=True, help="Print the traceback of an error.")
def cli(verbose: bool, debug: bool) -> None:
    """Run numbered tasks on a small robot arm.

    \b
    Start here:
      armtree doctor           check what a run needs
      armtree tasks            list the tasks
      armtree run 0            run task 0

    \b
    Exit status:
      0 done                   8 timed out
      1 a bug in armtree       9 port busy
      2 wrong usage           10 recording incomplete
      3 invalid file          11 the task failed by its own tree
      4 goal rejected         12 a replay differs
      5 planning failed       13 no server, or it ended
      6 hardware fault       130 Ctrl-C before a goal started, or a second Ctrl-C
      7 canceled             141 the reader of the output ended
    """  # noqa: D301
    root = logging.getLogger()
    root.setLevel(logging.INFO)
    root.addHandler(logging.StreamHandler(sys.stderr) if verbose else logging.NullHandler())
    root.handlers[-1].setFormatter(LogFormatter("%(levelname)s %(name)s: %(message)s"))
    logging.getLogger("transitions").setLevel(logging.WARNING)


@cli.command()
@click.argument("tasks", metavar="TASK...", nargs=-1, required=True)
@source_options
@set_option
@run_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per event.")
def run(
    tasks: tuple[str, ...],
    settings: tuple[str, ...],
    as_json: bool,
    **options: Any,
) -> None:
    """Run tasks, one after the other, and record each run.

    A TASK is the number or the name of a task. The first Ctrl-C cancels the task and stops the arm,
    the second one exits at once. The exit status is that of the last task that ran.

    \b
    Examples:
      armtree run pick --port virtual
      armtree run 3 --port /dev/ttyACM0 --set swing="30 deg"
    """  # noqa: D301
    from executive.setup import Setup

    from .run import execute

    numbers = [task_number(task, options["trees"]) for task in tasks]
    setup = Setup(**options, reload=False, single_user=True)
    verbose = click.get_current_context().find_root().params["verbose"]
    outcomes = execute(setup, numbers, settings, as_json, verbose)
    sys.exit(look_up(outcomes[-1].code).exit_status)


@cli.command()
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
    from executive.goals.queue import Policy
    from executive.server.server import ListenOptions
    from executive.setup import Setup

    from .serve import serve as run_server

    listen = ListenOptions(
        address=address,
        port=tcp_port,
        hosts=hosts,
        origins=origins,
        expose=expose,
        rosbridge=rosbridge,
    )
    run_server(Setup(policy=Policy(policy), **options), listen)


for command in (doctor, plan, replay, log, *TASK_COMMANDS, *CLIENT_COMMANDS):
    cli.add_command(command)


def main() -> None:
    """Entry point of `armtree`."""
    open_closed_streams()
    forbid_exit()
    output = sys.stdout
    try:
        cli.main(prog_name="armtree", standalone_mode=False)
    except click.ClickException as error:
        error.show(shown := io.StringIO())
        echo(shown.getvalue(), err=True, nl=False)
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        sys.exit(INTERRUPTED_EXIT)
    except SystemExit:
        if sys.stdout is not output:  # click replaces it if its reader has ended, and exits with 1
            sys.exit(READER_ENDED_EXIT)
        raise
    except Exception as error:
        if "--debug" in sys.argv:
            raise
        sys.exit(print_error(error))
