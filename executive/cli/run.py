"""`armtree run`."""

import sys
from typing import Any

import click

from executive.code_table import exit_status

from .support.command_group import command, diagnostics
from .support.names import TASK, load_library
from .support.options import run_options, set_option, source_options


@command()
@click.argument("tasks", metavar="TASK...", nargs=-1, required=True, type=TASK)
@source_options
@set_option
@run_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per event.")
def run(
    tasks: tuple[int | str, ...],
    settings: tuple[str, ...],
    as_json: bool,
    **options: Any,
) -> None:
    """Run tasks, one after the other, and record each run.

    A TASK is the number or the name of a task. Ctrl-C cancels the task and stops the arm. A second
    Ctrl-C, at least 0.5 s later, exits at once. The exit status is that of the last task that ran.
    If a server on this machine has the arm, `armtree send` runs a task on that server; --port
    virtual runs it on a virtual arm instead.

    \b
    Examples:
      armtree run pick --port virtual
      armtree run 3 --port /dev/ttyACM0 --set swing="30 deg"
    """  # noqa: D301
    from executive.setup import Setup

    from .support.run_tasks import execute

    setup = Setup(**options, reload=False, single_user=True)
    numbers = [task for task in tasks if isinstance(task, int)]
    if len(numbers) < len(tasks):
        _, library = load_library(setup.trees, options["robot"])
        numbers = [task if isinstance(task, int) else library.number(task) for task in tasks]
    outcomes = execute(setup, numbers, settings, as_json, diagnostics().verbose)
    sys.exit(exit_status(outcomes[-1].code))
