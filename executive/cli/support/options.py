"""Options of several commands."""

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from executive.cli.terminal.streams import echo

F = TypeVar("F", bound=Callable[..., Any])

PATH = click.Path(path_type=Path)
OWN_TREES = Path("trees")


class Finite(click.FloatRange):
    """A number in a range. NaN, which no comparison excludes, and infinity are rejected."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number; raise a usage error for anything else."""
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is no finite number", param, ctx)
        return number


AT_LEAST_0 = Finite(0)
ABOVE_0 = Finite(0, min_open=True)


class Drawing(click.Path):
    """A file for a drawing. Its suffix is the format; without a suffix it is PNG."""

    FORMATS = ("png", "svg", "pdf")

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path; raise a usage error if it cannot be written."""
        path = Path(value)
        if path.suffix and path.suffix.lower()[1:] not in self.FORMATS:
            there = ", ".join(f".{each}" for each in self.FORMATS)
            self.fail(f"{path}: a drawing is one of {there}", param, ctx)
        if path.is_dir():
            self.fail(f"{path} is a folder; name a file in it, such as plan.png", param, ctx)
        if not path.parent.is_dir():
            why = f"{path}: there is no folder {path.parent}; create it, or give another"
            self.fail(why, param, ctx)
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            self.fail(f"{path} cannot be written to; give another file", param, ctx)
        return path


DRAWING = Drawing()


def _own_trees() -> Path | None:
    return OWN_TREES if OWN_TREES.is_dir() else None


robot_option = click.option(
    "--robot", type=PATH, envvar="ARMTREE_ROBOT", help="Robot file. Default: the Arduinobot."
)
port_option = click.option(
    "--port",
    envvar="ARMTREE_PORT",
    help="Serial port, or virtual. Default: the port of the robot file.",
)
pose_option = click.option(
    "--pose",
    type=click.Choice(["boot", "last"]),
    help="Confirm the pose of the arm: the boot pose, or the last commanded one. Needed if opening "
    "the port does not reset the board.",
)
recordings_option = click.option(
    "--recordings",
    type=PATH,
    envvar="ARMTREE_RECORDINGS",
    default=Path("recordings"),
    show_default=True,
    help="Folder for recordings.",
)
set_option = click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="Value of a parameter of the task. May be repeated.",
)
seed_option = click.option(
    "--seed", type=click.IntRange(1), default=1, show_default=True, help="Seed of the planner."
)
trees_option = click.option(
    "--trees",
    type=PATH,
    envvar="ARMTREE_TREES",
    default=_own_trees,
    help="Folder with your own task files. Default: ./trees, if it exists.",
)


def _load(_context: click.Context, _option: click.Parameter, folder: Path | None) -> None:
    """Load the skills before the command runs; warn of broken ones."""
    from trees.compile.plugins import load_skills

    if folder is not None and not folder.is_dir():
        raise click.BadParameter(f"{folder}: there is no such folder for skills")
    for wrong in load_skills(folder):
        echo(f"Broken skills are left out: {wrong}", err=True)


skills_option = click.option(
    "--skills",
    type=PATH,
    envvar="ARMTREE_SKILLS",
    callback=_load,
    expose_value=False,
    help="Folder with your own skills: Python files.",
)


def _together(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Return a decorator that adds several options, in this order."""

    def add(command: F) -> F:
        for option in reversed(options):
            command = option(command)
        return command

    return add


source_options = _together(
    port_option, robot_option, trees_option, skills_option, recordings_option
)
run_options = _together(
    seed_option,
    click.option(
        "--workers",
        type=click.IntRange(1),
        envvar="ARMTREE_WORKERS",
        default=1,
        show_default=True,
        help="Number of planner processes.",
    ),
    click.option(
        "--recording-timeout",
        type=ABOVE_0,
        envvar="ARMTREE_RECORDING_TIMEOUT",
        default=5.0,
        show_default=True,
        metavar="SECONDS",
        help="Longest time that a frame waits until the one before it is recorded [s]. Then the "
        "motion ends.",
    ),
    click.option(
        "--keep-days",
        type=AT_LEAST_0,
        envvar="ARMTREE_KEEP_DAYS",
        help="Delete recordings older than this [days].",
    ),
    click.option(
        "--keep-mb",
        type=AT_LEAST_0,
        envvar="ARMTREE_KEEP_MB",
        help="Delete the oldest recordings beyond this total size [MB].",
    ),
    pose_option,
)
