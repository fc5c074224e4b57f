"""The command line. What is heavy is loaded by the command that needs it."""

import logging
import os
import sys
from typing import Any

import click

from executive.codes import INTERRUPTED_EXIT, look_up

from .doctor import doctor
from .failures import tell
from .log import log
from .options import (
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
from .plan import plan
from .replay import replay
from .server import COMMANDS as SERVER_COMMANDS
from .tasks import COMMANDS as TASK_COMMANDS


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="armtree")
@click.option("-v", "--verbose", is_flag=True, help="Show the log, as plain lines.")
@click.option("--debug", is_flag=True, help="Show tracebacks.")
def cli(verbose: bool, debug: bool) -> None:
    """Pick a task number, and the arm does it.

    Exit codes: 0 done, 1 a bug of ours, 2 usage, 3 bad file, 4 goal refused, 5 planning failed,
    6 hardware fault, 7 canceled, 8 timed out, 9 port busy, 10 recording incomplete, 11 the task
    failed by its own tree, 12 a replay differs, 13 no server, or it ended, 130 left by Ctrl-C
    before a goal had begun, or by a second one.
    """
    root = logging.getLogger()
    root.setLevel(logging.INFO)
    root.addHandler(logging.StreamHandler(sys.stderr) if verbose else logging.NullHandler())
    root.handlers[-1].setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))
    logging.getLogger("transitions").setLevel(logging.WARNING)


@cli.command()
@click.argument("numbers", metavar="N...", nargs=-1, required=True, type=int)
@port_option
@robot_option
@trees_option
@skills_option
@recordings_option
@click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="Value of a parameter of the task; may be given again.",
)
@seed_option
@workers_option
@keep_days_option
@keep_mb_option
@pose_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per event.")
def run(
    numbers: tuple[int, ...],
    settings: tuple[str, ...],
    as_json: bool,
    skills: object,  # its option has loaded them
    **options: Any,
) -> None:
    """Run tasks N in turn. Ctrl-C cancels and stops the arm; a second one leaves at once."""
    from executive.setup import Setup

    from .run import execute

    setup = Setup(**options, single_user=True)
    verbose = click.get_current_context().find_root().params["verbose"]
    outcomes = execute(setup, numbers, settings, as_json, verbose)
    sys.exit(look_up(outcomes[-1].code).exit_status)


for command in (doctor, plan, replay, log, *TASK_COMMANDS, *SERVER_COMMANDS):
    cli.add_command(command)


def main() -> None:
    """Entry point of `armtree`."""
    try:
        cli.main(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        sys.exit(INTERRUPTED_EXIT)
    except BrokenPipeError:  # nobody reads any more
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except Exception as error:
        if "--debug" in sys.argv:
            raise
        sys.exit(tell(error))
