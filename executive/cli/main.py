"""The command line. It imports only the typed command, and slow libraries when the command runs."""

import logging
import os
import sys
import traceback

import click

from executive.api.codes import INTERRUPTED_EXIT, READER_ENDED_EXIT
from hardware.printable import printable

from .support.command_group import COMPLETION_VARIABLE, CommandGroup, Diagnostics
from .support.process import protected_process
from .terminal.streams import discard, echo, open_closed_streams

SECTIONS = {
    "Run and move": "run.run move.move move.home move.where move.stop jog.jog "
    "teleop.teleop pose.pose plan.plan",
    "Tasks": "tasks.tasks tasks.check tasks.schema tasks.skills tasks.show tasks.new teach.teach",
    "Server": "serve.serve server_commands.send server_commands.cancel server_commands.answer "
    "server_commands.pause server_commands.resume server_commands.step server_commands.break_ "
    "server_commands.status server_commands.view server_commands.watch server_commands.arm "
    "mcp.mcp ros2.ros2 service.service",
    "Many arms": "fleet.fleet",
    "Recordings": "replay.replay log.log",
    "Robot and board": "doctor.doctor calibrate.calibrate new_arm.robots new_arm.new_arm",
    "Settings": "config.config completion.completion",
}


@click.group(
    cls=CommandGroup,
    sections=SECTIONS,
    package=__package__,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="armtree")
def cli() -> None:
    """Run numbered tasks on a small robot arm.

    \b
    Start here:
      armtree doctor           check what a run needs
      armtree tasks            list the tasks
      armtree run 0            run task 0
      armtree move folded      move to a pose

    \b
    Exit status:
      0 done                   8 timed out
      1 a bug in armtree       9 port busy
      2 wrong usage           10 recording incomplete
      3 invalid file          11 the task's tree failed
      4 goal rejected         12 a replay differs
      5 planning failed       13 no server, or it ended
      6 hardware fault       130 ended by Ctrl-C
      7 canceled             141 broken pipe
    """  # noqa: D301
    root = logging.getLogger()
    root.setLevel(logging.INFO)
    root.addHandler(logging.NullHandler())
    logging.getLogger("transitions").setLevel(logging.WARNING)


def main() -> None:
    """Entry point of `armtree`."""
    open_closed_streams()
    output, wanted = sys.stdout, Diagnostics()
    if COMPLETION_VARIABLE in os.environ:
        from . import completion  # noqa: F401  replaces click's completion for bash and zsh

        discard(sys.stderr)  # a shell would print its text into the line that the user edits
    try:
        with protected_process():
            cli.main(prog_name="armtree", standalone_mode=False, obj=wanted)
    except (click.Abort, KeyboardInterrupt):
        sys.exit(INTERRUPTED_EXIT)
    except SystemExit:
        # If the reader of the output has ended, click replaces sys.stdout, and exits with 1.
        if sys.stdout is not output:
            sys.exit(READER_ENDED_EXIT)
        raise
    except Exception as error:
        if wanted.debug and not isinstance(error, click.ClickException):
            echo(printable(traceback.format_exc()), nl=False, err=True, whole=True)
        from .support.failures import print_error

        sys.exit(print_error(error))
