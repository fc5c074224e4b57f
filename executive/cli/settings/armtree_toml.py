"""Reads files of settings: the nearest `armtree.toml`, and the file in the user's folder.

Also finds misspelt environment variables.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from executive.cli.terminal.streams import echo
from hardware.files import user_folder
from hardware.loading.dataclass import dataclass
from hardware.spelling import closest, did_you_mean

from .rows import SETTINGS, environment_name

FILE = "armtree.toml"
_PREFIX = environment_name("")
_NO_SETTINGS = ("token", "fleet_ca", "fleet_nkey", "fleet_token")  # variables without a setting
_NEAR = 0.7  # smallest similarity to suggest a variable


@dataclass(frozen=True, slots=True)
class Configured:
    """The value of a setting in a file.

    Attributes:
        value: The value.
        place: File and line of the value, as FILE:LINE.
    """

    value: Any
    place: str


def configured(ctx: click.Context) -> Mapping[str, Configured]:
    """Return the values in the files of settings, by name of the setting. Reads the files once.

    Raises:
        BadConfiguration: A file is wrong.
    """
    found, wrong = read_files(ctx)
    if wrong and not ctx.resilient_parsing:  # completion in a shell ignores them
        from executive.errors import BadConfiguration  # slow to import

        raise BadConfiguration("\n".join(wrong))
    return found


def read_files(ctx: click.Context) -> tuple[Mapping[str, Configured], Sequence[str]]:
    """Return the values in the files of settings, by name of the setting, and their mistakes.

    The first call also prints a note for each unknown variable that resembles one of a setting.
    """
    if __name__ not in ctx.meta:
        _note_misspelt()
        values, wrong = dict[str, Configured](), list[str]()
        for path in reversed(files()):
            found, mistakes = _read(path)
            values |= found
            wrong += mistakes
        ctx.meta[__name__] = values, wrong
    read: tuple[Mapping[str, Configured], Sequence[str]] = ctx.meta[__name__]
    return read


def _note_misspelt() -> None:
    known = (*SETTINGS, *_NO_SETTINGS)
    for variable in sorted(os.environ):
        name = variable.removeprefix(_PREFIX).lower()
        if not variable.startswith(_PREFIX) or name in known:
            continue
        if near := closest(name, known, _NEAR):
            echo(f"note: {variable} is not known{did_you_mean(environment_name(near))}", err=True)


def files() -> list[Path]:
    """Return the existing files of settings. The first one has precedence."""
    return [path for path in (*_upwards(), user_file()) if path.exists()]


def user_file() -> Path:
    """Return the path of the file of settings in the user's folder. The file may be missing."""
    return user_folder() / FILE


def _upwards() -> Iterator[Path]:
    """Yield the nearest file in the working directory or a folder above it, if there is one."""
    try:
        here = Path.cwd()
    except OSError:  # the working directory was deleted
        return
    paths = (folder / FILE for folder in (here, *here.parents))
    if found := next((path for path in paths if path.exists()), None):
        yield found


def _read(path: Path) -> tuple[dict[str, Configured], list[str]]:
    """Return the valid values of a file, and its mistakes."""
    from hardware import DescriptionError
    from hardware.spelling import there_are
    from hardware.toml_table import TomlTable  # imported only if there is a file

    values, wrong = dict[str, Configured](), list[str]()
    try:
        _check_owner(path)
        table = TomlTable.read(path)
    except DescriptionError as error:
        return {}, [str(error)]
    for name in table:
        try:
            if name not in SETTINGS:
                there = there_are(name, SETTINGS)
                there += "" if there.endswith("?") else "; `armtree config` lists them"
                if table.is_table(name):
                    there = f"this file has no tables: write its keys at the top, without [{name}]"
                table.fail(name, f"unknown key; {there}")
            value = SETTINGS[name].read(table, name, path.parent)
            values[name] = Configured(value, f"{path}:{table.line(name)}")
        except DescriptionError as error:
            wrong.append(str(error))
    return values, wrong


def _check_owner(path: Path) -> None:
    """Raise DescriptionError if a file is not of this user, the owner of its folder, or root.

    Another user may have put the file into a shared folder. Skills that it names would run as this
    user.
    """
    from hardware import DescriptionError

    owner, folder = path.stat().st_uid, path.parent.stat().st_uid
    if owner not in (os.getuid(), folder, 0):
        why = "belongs to another user, so it is not read; delete it, or work in another folder"
        raise DescriptionError(path, 0, why)
