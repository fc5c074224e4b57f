"""The command line. It imports only the typed command, and slow libraries when the command runs."""

import os
import sys

import click

from executive.api.codes import INTERRUPTED_EXIT, READER_ENDED_EXIT
from hardware.printable import printable

from .support.command_group import COMPLETION_VARIABLE, CommandGroup, Diagnostics
from .support.process import protected_process
from .terminal.streams import discard, echo, open_closed_streams, settle

# The commands by section: the module and function of each, and the first sentence of its help.
SECTIONS = {
    "Run and move": {
        "run.run": "Run tasks, one after the other, and record each run.",
        "move.move": "Move joints, or the tool to a point, and record the move.",
        "move.home": "Move to the home pose of the robot.",
        "move.where": (
            "Print where the arm is: joints in degrees, the tool and the width of the "
            "gripper in mm."
        ),
        "move.stop": "Stop the arm at once, and cancel all goals.",
        "jog.jog": "Move joints and tool in small steps, by keys.",
        "teleop.teleop": "Move an arm by moving another arm, the leader, by hand.",
        "pose.pose": "Save, list, show and remove poses.",
        "plan.plan": "Plan a motion without an arm; explain it and draw it.",
    },
    "Tasks": {
        "tasks.tasks": "List the tasks of a robot, their parameters and their last outcomes.",
        "tasks.check": "Check task files and report every mistake with its line.",
        "tasks.schema": "Print the JSON Schema of task files.",
        "tasks.skills": "List the skills, with their ports.",
        "tasks.show": "Draw the tree of a task or of a recorded run.",
        "tasks.new": "Write a new task file: a commented example that runs.",
        "teach.teach": "Teach a task: jog the arm from pose to pose, and take each pose as a step.",
    },
    "Server": {
        "serve.serve": "Run a server that executes goals of other programs, until Ctrl-C.",
        "server_commands.send": "Run TASK on a server.",
        "server_commands.cancel": "Cancel GOAL on a server.",
        "server_commands.answer": "Answer a question of a running task on a server.",
        "server_commands.pause": "Pause GOAL on a server and stop the arm.",
        "server_commands.resume": "Resume a paused GOAL on a server.",
        "server_commands.step": "Resume a paused GOAL on a server until its next skill starts.",
        "server_commands.break_": (
            "Set or remove a breakpoint on a server, or list the breakpoints."
        ),
        "server_commands.status": "Print the state of a server: its arm, goals and breakpoints.",
        "server_commands.view": "Open the page of a server in a browser, signed in.",
        "server_commands.watch": "Show everything that a server does, until Ctrl-C.",
        "server_commands.arm": "Change the lifecycle state of a server's arm.",
        "mcp.mcp": "Offer the tasks of a server to language models, as tools (MCP).",
        "ros2.ros2": "Offer a server to ROS 2, as the node `armtree`.",
        "service.service": (
            "Start `armtree serve` when the computer starts, as a service of systemd."
        ),
    },
    "Many arms": {
        "fleet.fleet": "Run many arms: send jobs to pools of them, watch them, and stop them all.",
    },
    "Recordings": {
        "replay.replay": "Verify recorded runs, show a recorded run, or send its frames again.",
        "log.log": "List, show, compare, draw, recover and delete recordings.",
    },
    "Robot and board": {
        "doctor.doctor": "Check everything that a run needs.",
        "calibrate.calibrate": (
            "Calibrate an arm with bus servos: turn every joint by hand from end to end."
        ),
        "new_arm.robots": "List the shipped robots, for --robot, and the firmware for an Arduino.",
        "new_arm.new_arm": "Make a robot file for an arm from its URDF.",
    },
    "Settings": {
        "config.config": "Show each setting, its value, and where the value comes from.",
        "completion.completion": (
            "Print the script with which a shell completes commands, options and names."
        ),
    },
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
    import logging  # --help does not need it

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
            import traceback

            echo(printable(traceback.format_exc()), nl=False, err=True, whole=True)
        from .support.failures import print_error

        status = print_error(error)
        settle(output)
        settle(sys.stderr)
        sys.exit(status)
