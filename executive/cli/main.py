"""The command line. What is heavy is loaded by the command that needs it."""

import logging
import os
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from executive.codes import INTERRUPTED_EXIT, look_up

from .failures import tell
from .log import log
from .options import (
    DRAWING,
    PATH,
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
@click.option("--json", is_flag=True, help="Print one JSON object per event.")
def run(**options: Any) -> None:
    """Run tasks N in turn. Ctrl-C cancels and stops the arm; a second one leaves at once."""
    from .wiring import Options, execute

    verbose = click.get_current_context().find_root().params["verbose"]
    outcomes = execute(Options(**options, verbose=verbose))
    sys.exit(look_up(outcomes[-1].code).exit_status)


@cli.command()
@port_option
@robot_option
@trees_option
@recordings_option
@click.option(
    "--open", "really_open", is_flag=True, help="Open the port too: this may move the arm."
)
@click.pass_context
def doctor(
    context: click.Context,
    port: str | None,
    robot: Path | None,
    trees: Path | None,
    recordings: Path,
    really_open: bool,
) -> None:
    """Look whether all is there that a run needs. Opens no port unless told to."""
    from hardware import serial_ports

    from .doctor import examine

    wrong = []
    for check in examine(robot, port, trees, recordings, really_open):
        wrong += [] if check.ok else [check.code]
        click.echo(f"{'ok' if check.ok else 'NO':<4}{check.name:<12}{check.detail}")
        if not check.ok and check.remedy:
            click.echo(f"{'':<16}-> {check.remedy}")
    found = serial_ports()
    click.echo(f"\nSerial ports: {'' if found else 'none'}")
    for each in found:
        click.echo("  " + "  ".join(filter(None, (each.device, each.usb, each.name, each.by_id))))
    command = shlex.join(
        ["armtree", "run", "0", *_given(context, "port", "robot", "trees", "recordings")]
    )
    click.echo("\nMend what says NO." if wrong else f"\nNext, type: {command}")
    sys.exit(look_up(wrong[0]).exit_status if wrong else 0)


def _given(context: click.Context, *names: str) -> Iterator[str]:
    """The options of these names, as far as they stand on the command line, spelled out."""
    for name in names:
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            yield from (f"--{name}", str(context.params[name]))


cli.add_command(replay)
cli.add_command(log)


for command in (*TASK_COMMANDS, *SERVER_COMMANDS):
    cli.add_command(command)


@cli.command(context_settings={"ignore_unknown_options": True})  # -0.1 is a number
@click.argument("goal", metavar="GOAL...", nargs=-1, required=True)
@robot_option
@trees_option
@click.option("--start", multiple=True, help="As GOAL but no task, in quotes; default: boot pose.")
@click.option("--via", multiple=True, help="A point on the way, as --start; repeatable.")
@click.option("--relative", is_flag=True, help="Let x y z count from where the tool is.")
@click.option("--direction", nargs=3, metavar="X Y Z", help="Where the tool is to point.")
@click.option("--tool", help="Link that is to go there; default: the robot file's tool.")
@click.option("--offset", nargs=3, metavar="X Y Z", help="The tool on its link [m].")
@click.option("--axis", nargs=3, metavar="X Y Z", help="The tool's axis on its link.")
@click.option("--world", type=PATH, help="JSON file of bodies around the arm; see above.")
@click.option("--group", help="Group that moves; default: that of the joints named, else the arm.")
@click.option("--seed", type=click.IntRange(1), default=1, show_default=True, help="Of planning.")
@click.option(
    "-o",
    "--output",
    type=DRAWING,
    default=Path("plan.png"),
    show_default=True,
    help="PNG, SVG or PDF file to draw it to.",
)
def plan(
    goal: tuple[str, ...],
    robot: Path | None,
    trees: Path | None,
    start: tuple[str, ...],
    via: tuple[str, ...],
    relative: bool,
    direction: tuple[str, str, str] | None,
    tool: str | None,
    offset: tuple[str, str, str] | None,
    axis: tuple[str, str, str] | None,
    world: Path | None,
    group: str | None,
    seed: int,
    output: Path,
) -> None:
    r"""Plan to GOAL, say why it takes as long as it does, and draw it. Nothing moves.

    GOAL is JOINT=VALUE and JOINT+=CHANGE ... such as joint_1=70deg joint_2+=0.1, a pose such as
    right, x y z of the tool such as 0.1 0.05 8cm, or the number of a task that spells out where
    it goes. Around the arm is what --world says, and what the task has put there by then. Numbers
    without a unit are in rad and m.

    \b
    A file for --world, of which the README tells more:
    [{"name": "post", "box": {"size": [0.03, 0.03, 0.2]},
      "position": [0.115, 0.115, 0.1]}]
    """
    from executive.planning.goals import Goal
    from hardware import load_robot
    from trees import Library

    from .plan import explain

    of_point = {"direction": direction, "offset": offset, "axis": axis}
    point = {port: f"[{', '.join(words)}]" for port, words in of_point.items() if words}
    point |= ({"relative": "true"} if relative else {}) | ({"tool": tool} if tool else {})
    words = " ".join(start).split()
    asked = Goal(load_robot(robot), Library(trees), goal, group, seed, words, via, point)
    for line in explain(asked, world, output):
        click.echo(line)


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
