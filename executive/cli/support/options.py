"""Options that several commands share."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from executive.cli.settings import F, Finite, configured, option
from executive.cli.terminal.streams import echo
from hardware.spelling import closest

from .names import Complete, complete_port, complete_robot

_NUMBER = re.compile(r"-\.?[0-9]")


class Drawing(click.Path):
    """A file for a drawing. Its suffix is the format; without a suffix it is PNG."""

    FORMATS = ("png", "svg", "pdf")

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path. Raise a usage error if it cannot be written."""
        path = Path(value)
        if path.suffix and path.suffix.lower()[1:] not in self.FORMATS:
            there = ", ".join(f".{each}" for each in self.FORMATS)
            self.fail(f"{path}: the name of a drawing ends with one of {there}", param, ctx)
        if path.is_dir():
            self.fail(f"{path} is a folder; name a file in it, such as plan.png", param, ctx)
        if not path.parent.is_dir():
            why = f"{path}: there is no folder {path.parent}; create it, or give another file"
            self.fail(why, param, ctx)
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            self.fail(f"{path} cannot be written to; give another file", param, ctx)
        return path


def drawing_option(meaning: str = "", **settings: Any) -> Callable[[F], F]:
    """Return a decorator that adds the option for the file of a drawing.

    Args:
        meaning: Sentence about the default, for the help; empty for none.
        settings: Further arguments of the option.
    """
    text = f"Drawing to write: PNG, SVG or PDF. {meaning}".rstrip()
    return click.option("-o", "--output", metavar="FILE", type=Drawing(), help=text, **settings)


def _local_server() -> str:
    """Return the URL of the running server of this user, else of a server at the set TCP port.

    Raises:
        Refusal: Several servers run, and none is at that port.
    """
    from .own_arms import running_server, server_at_port  # slow to import

    return running_server() or server_at_port()


robot_option = option("robot", shell_complete=complete_robot)
server_option = option("server", default=_local_server)
port_option = option("port", shell_complete=complete_port)
pose_option = click.option(
    "--pose",
    type=click.Choice(["boot", "last"]),
    help="Confirm the position of the arm: the pose in the robot file (boot), or the end of the "
    "last run (last). Needed if opening the port does not reset the board.",
)


def _existing(context: click.Context, _option: click.Parameter, folder: Path | None) -> Path | None:
    """Return the folder of tasks. Print a note if a file of settings names a missing folder."""
    by_file = context.get_parameter_source("trees") is ParameterSource.DEFAULT_MAP
    if folder is None or not by_file or folder.is_dir() or context.resilient_parsing:
        return folder
    place = configured(context)["trees"].place
    echo(f"note: {place}: there is no folder {folder} yet; armtree new creates it", err=True)
    return None


recordings_option, trees_option = option("recordings"), option("trees", callback=_existing)
own_trees_option = option(
    "trees",
    default=Path("trees"),
    show_default=True,
    help="Folder with your own tasks and poses. It is created if it does not exist.",
)
speed_option = click.option(
    "--speed",
    metavar="SHARE",
    type=Finite(0.01, 1.0),
    default=1.0,
    show_default=True,
    help="Share of the robot's speed, 0.01 to 1.",
)
set_option = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="Value of a parameter of the task. May be repeated.",
)


def _words_of_goal(
    context: click.Context, _argument: click.Parameter, words: tuple[str, ...]
) -> tuple[str, ...]:
    """Reject words that look like an option, except negative numbers."""
    for word in words:
        if word.startswith("-") and not _NUMBER.match(word):
            options = [name for option in context.command.params for name in option.opts]
            near = closest(word, [name for name in options if name.startswith("--")])
            raise click.NoSuchOption(word, possibilities=[near] if near else None, ctx=context)
    return words


def target_argument(name: str, complete: Complete) -> Callable[[F], F]:
    """Return a decorator that adds an argument for the words of a target.

    A word such as `-10` is read as a number, not as an option.

    Args:
        name: Name of the parameter.
        complete: Callback that completes a word.
    """
    return click.argument(
        name,
        metavar=f"{name.upper()}...",
        nargs=-1,
        required=True,
        callback=_words_of_goal,
        shell_complete=complete,
    )


def _load(context: click.Context, _option: click.Parameter, folder: Path | None) -> None:
    """Load the skills before the command runs. Warn of broken skills."""
    if context.resilient_parsing:  # a shell completes the command line
        return
    from skills.user_skills import load_skills
    from trees.nodes.kind import reserved_names

    if folder is not None and not folder.is_dir():
        raise click.BadParameter(f"{folder}: there is no such folder for skills")
    for wrong in load_skills(folder, reserved_names()):
        echo(f"Broken skills are left out: {wrong}", err=True)


skills_option = option("skills", callback=_load, expose_value=False)


def _together(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Return a decorator that adds several options, in this order."""

    def add(command: F) -> F:
        for each in reversed(options):
            command = each(command)
        return command

    return add


source_options = _together(
    port_option, robot_option, trees_option, skills_option, option("world"), recordings_option
)
run_options = _together(
    *map(
        option, ("seed", "workers", "planning_timeout", "recording_timeout", "keep_days", "keep_mb")
    ),
    pose_option,
)
