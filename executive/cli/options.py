"""Options that several commands have."""

import math
import os
from pathlib import Path
from typing import Any

import click

PATH = click.Path(path_type=Path)
OWN_TREES = Path("trees")


class Finite(click.FloatRange):
    """A number in a range, never NaN or infinite: no comparison would refuse a NaN."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number; anything else is a wrong usage."""
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is no finite number", param, ctx)
        return number


AT_LEAST_0 = Finite(0)
ABOVE_0 = Finite(0, min_open=True)


class Drawing(click.Path):
    """A file for a drawing; its suffix says the format, without one it is PNG."""

    FORMATS = ("png", "svg", "pdf")

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path; one that cannot be drawn to is a wrong usage, told before anything is done."""
        path = Path(value)
        if path.suffix and path.suffix.lower()[1:] not in self.FORMATS:
            there = ", ".join(f".{each}" for each in self.FORMATS)
            self.fail(f"{path}: a drawing is one of {there}", param, ctx)
        if path.is_dir():
            self.fail(f"{path} is a folder; name a file in it, such as plan.png", param, ctx)
        if not path.parent.is_dir():
            why = f"{path}: there is no folder {path.parent}; make it, or give another"
            self.fail(why, param, ctx)
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            self.fail(f"{path} cannot be written to; give another file", param, ctx)
        return path


DRAWING = Drawing()


def _own_trees() -> Path | None:
    return OWN_TREES if OWN_TREES.is_dir() else None


robot_option = click.option(
    "--robot", type=PATH, envvar="ARMTREE_ROBOT", help="Robot file; default: the Arduinobot."
)
port_option = click.option("--port", envvar="ARMTREE_PORT", help="Serial port, or: virtual.")
pose_option = click.option(
    "--pose",
    type=click.Choice(["boot", "last"]),
    help="Where the arm stands, for a board that opening the port does not reset: in its boot "
    "pose, or where it was commanded to last.",
)
recordings_option = click.option(
    "--recordings",
    type=PATH,
    envvar="ARMTREE_RECORDINGS",
    default=Path("recordings"),
    show_default=True,
    help="Folder for recordings.",
)
seed_option = click.option(
    "--seed", type=click.IntRange(1), default=1, show_default=True, help="Of planning."
)
workers_option = click.option(
    "--workers",
    type=click.IntRange(1),
    envvar="ARMTREE_WORKERS",
    default=1,
    show_default=True,
    help="Planner processes.",
)
keep_days_option = click.option(
    "--keep-days", type=AT_LEAST_0, envvar="ARMTREE_KEEP_DAYS", help="Delete older recordings."
)
keep_mb_option = click.option(
    "--keep-mb",
    type=AT_LEAST_0,
    envvar="ARMTREE_KEEP_MB",
    help="Delete the oldest recordings beyond so many megabytes.",
)
trees_option = click.option(
    "--trees",
    type=PATH,
    envvar="ARMTREE_TREES",
    default=_own_trees,
    help="Folder with task files of your own; default: ./trees, if there is one.",
)


def _load(_context: click.Context, _option: click.Parameter, folder: Path | None) -> Path | None:
    """Load the skills before anything asks for them; a broken file is told of."""
    from trees.compile.plugins import load_skills

    if folder is not None and not folder.is_dir():
        raise click.BadParameter(f"{folder}: there is no such folder for skills")
    for wrong in load_skills(folder):
        click.echo(f"Broken skills are left out: {wrong}", err=True)
    return folder


skills_option = click.option(
    "--skills",
    type=PATH,
    envvar="ARMTREE_SKILLS",
    callback=_load,
    help="Folder with skills of your own: Python files.",
)
