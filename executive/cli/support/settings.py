"""The settings: one row each, for an option, an environment variable and a key of `armtree.toml`.

Precedence: option, environment, the file nearest to the working directory, the user's file,
default.
"""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import urlsplit

import click
from click.core import ParameterSource

from executive.api import PORT

from .command_group import SETTINGS_SECTION

if TYPE_CHECKING:
    from hardware.toml_table import TomlTable

F = TypeVar("F", bound=Callable[..., Any])

FILE = "armtree.toml"
PATH = click.Path(path_type=Path)
_LARGEST = 2**31 - 1


class Finite(click.FloatRange):
    """A number in a range. NaN, which no comparison excludes, and infinity are rejected."""

    name = "number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number; raise a usage error for anything else."""
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number


class Whole(click.IntRange):
    """A whole number in a range."""

    name = "whole number"


class Url(click.types.StringParamType):
    """The URL of a server."""

    name = "url"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the URL; raise a usage error for anything else."""
        if not str(value).startswith(("http://", "https://")):
            why = f"{value!r} is not the URL of a server, such as http://arm:8765"
            self.fail(why, param, ctx)
        return str(value)


class FleetUrl(click.types.StringParamType):
    """The URL of the NATS server of a fleet."""

    name = "url"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the URL; raise a usage error for anything else."""
        try:
            parts = urlsplit(str(value))
            valid = parts.scheme in ("nats", "tls") and parts.hostname and parts.port != 0
        except ValueError:
            valid = False
        if not valid:
            why = f"{value!r} is not the URL of a fleet, such as nats://127.0.0.1:4222"
            self.fail(why, param, ctx)
        return str(value)


AT_LEAST_0 = Finite(0)
ABOVE_0 = Finite(0, min_open=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A setting.

    Attributes:
        type: Type of its value.
        help: Meaning, for `--help`.
        default: Default, or a function that returns it; None for none.
        metavar: Stands for its value in `--help`; None for the name of its type.
    """

    type: "click.ParamType[Any]"
    help: str
    default: Any = None
    metavar: str | None = None

    def read(self, table: "TomlTable", key: str, folder: Path) -> Any:
        """Return the value of a key of a file. A relative path is in the folder of the file.

        Raises:
            DescriptionError: The value is wrong.
        """
        kind = self.type
        if isinstance(kind, click.IntRange):
            most = _LARGEST if kind.max is None else int(kind.max)
            return table.integer(key, range(int(kind.min or 0), most + 1))
        given = table.number(key) if isinstance(kind, click.FloatRange) else table.text(key)
        if isinstance(kind, click.Path):
            from hardware import shipped_robots

            if key == "robot" and str(given) in shipped_robots():
                return Path(str(given))
            return folder / Path(str(given)).expanduser()
        try:
            return kind.convert(given, None, None)
        except click.BadParameter as error:
            table.fail(key, error.message)


@dataclass(frozen=True, slots=True)
class Configured:
    """A value in a file.

    Attributes:
        value: The value.
        place: The file and the line.
    """

    value: Any
    place: str


def _own_trees() -> Path | None:
    return own if (own := Path("trees")).is_dir() else None


SETTINGS = {
    "port": Setting(
        metavar="PORT",
        type=click.STRING,
        help="Serial port, or `virtual` for a simulated board. Default: that of the robot file.",
    ),
    "robot": Setting(
        metavar="FILE",
        type=PATH,
        help="Robot file, or a name that `armtree robots` lists. Default: arduinobot.",
    ),
    "trees": Setting(
        metavar="FOLDER",
        type=PATH,
        default=_own_trees,
        help="Folder with your own task files. Default: ./trees, if it exists.",
    ),
    "skills": Setting(
        metavar="FOLDER", type=PATH, help="Folder with your own skills: Python files."
    ),
    "world": Setting(
        metavar="FILE",
        type=PATH,
        help="JSON file with the bodies around the arm, as in the example.",
    ),
    "recordings": Setting(
        metavar="FOLDER", type=PATH, default=Path("recordings"), help="Folder for recordings."
    ),
    "server": Setting(
        type=Url(),
        metavar="URL",
        help="URL of the server. Default: the one on this machine.",
    ),
    "fleet": Setting(
        type=FleetUrl(), metavar="URL", help="URL of the NATS server of a fleet of arms."
    ),
    "tcp_port": Setting(
        metavar="PORT",
        type=Whole(0, 65535),
        default=PORT,
        help="TCP port of the server; 0 for any free one.",
    ),
    "policy": Setting(
        type=click.Choice(["reject", "queue", "preempt"]),
        default="reject",
        help="What happens to a goal while another one runs.",
    ),
    "result_timeout": Setting(
        type=Finite(-1),
        default=900.0,
        metavar="SECONDS",
        help="How long a result is kept [s]; -1 to keep it until there are 1000 newer ones.",
    ),
    "seed": Setting(metavar="N", type=Whole(1), default=1, help="Seed of the planner."),
    "workers": Setting(metavar="N", type=Whole(1), default=1, help="Number of planner processes."),
    "recording_timeout": Setting(
        type=ABOVE_0,
        default=5.0,
        metavar="SECONDS",
        help="Longest time that a frame may wait for the recording of the previous frame [s]. "
        "After that time the motion ends with log.behind. While a frame waits, the arm stands "
        "still in the middle of its motion; a shorter time ends more motions on a slow disk.",
    ),
    "keep_days": Setting(metavar="DAYS", type=AT_LEAST_0, help="Delete recordings that are older."),
    "keep_mb": Setting(
        metavar="MB",
        type=AT_LEAST_0,
        help="Delete the oldest recordings if all of them together are larger.",
    ),
}


def environment_name(name: str) -> str:
    """Return the environment variable of a setting."""
    return f"ARMTREE_{name.upper()}"


class SettingOption(click.Option):
    """The option of a setting. If neither it nor its variable is given, the files count."""

    section = SETTINGS_SECTION

    def get_help_extra(self, ctx: click.Context) -> Any:
        """Return what follows the help text: the default. An error names the range."""
        return {"default": extra} if (extra := super().get_help_extra(ctx).get("default")) else {}

    def consume_value(
        self, ctx: click.Context, opts: Mapping[str, Any]
    ) -> tuple[Any, ParameterSource]:
        """Return the value, and where it comes from."""
        value, source = super().consume_value(ctx, opts)
        (flag, *_) = self.opts
        if source in (ParameterSource.COMMANDLINE, ParameterSource.ENVIRONMENT):
            return value, source
        if found := configured(ctx).get(flag.removeprefix("--").replace("-", "_")):
            return found.value, ParameterSource.DEFAULT_MAP
        return value, source


def option(name: str, *declared: str, **changes: Any) -> Callable[[F], F]:
    """Return a decorator that adds the option of a setting to a command.

    Args:
        name: Name of the setting.
        declared: Another name of the parameter of the function.
        changes: Arguments of the option that differ for this command.
    """
    return click.option(_flag(name), *declared, cls=SettingOption, **_arguments(name) | changes)


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _arguments(name: str) -> dict[str, Any]:
    row = SETTINGS[name]
    return {
        "type": row.type,
        "envvar": environment_name(name),
        "show_envvar": True,  # in errors
        "help": row.help,
        "metavar": row.metavar,
        "default": row.default,
        "show_default": row.default is not None and not callable(row.default),
    }


def find_setting(ctx: click.Context, name: str) -> tuple[Any, str]:
    """Return the value of a setting that no option gives, and where it comes from.

    Raises:
        UsageError: The value of the environment is wrong.
        BadConfiguration: A file is wrong.
    """
    parameter = SettingOption([_flag(name)], **_arguments(name))
    value, source = parameter.consume_value(ctx, {})
    found = parameter.type_cast_value(ctx, value)
    if source is ParameterSource.ENVIRONMENT:
        return found, environment_name(name)
    return found, configured(ctx)[name].place if source is ParameterSource.DEFAULT_MAP else ""


def local_server() -> str:
    """Return the URL of a server on this machine at the port of the settings."""
    port, _ = find_setting(click.get_current_context(), "tcp_port")
    return f"http://localhost:{port}"


def configured(ctx: click.Context) -> Mapping[str, Configured]:
    """Return the values of the files, by name of the setting. The files are read once.

    Raises:
        BadConfiguration: A file is wrong.
    """
    found, wrong = read_files(ctx)
    if wrong and not ctx.resilient_parsing:  # a shell completes it
        from executive.errors import BadConfiguration  # slow to import

        raise BadConfiguration("\n".join(wrong))
    return found


def read_files(ctx: click.Context) -> tuple[Mapping[str, Configured], Sequence[str]]:
    """Return the values of the files, by name of the setting; and what is wrong in the files."""
    if __name__ not in ctx.meta:
        values, wrong = dict[str, Configured](), list[str]()
        for path in reversed(files()):
            found, mistakes = _read(path)
            values |= found
            wrong += mistakes
        ctx.meta[__name__] = values, wrong
    read: tuple[Mapping[str, Configured], Sequence[str]] = ctx.meta[__name__]
    return read


def files() -> list[Path]:
    """Return the files of settings that exist; the first one counts most."""
    return [path for path in (*_upwards(), user_file()) if path.exists()]


def user_file() -> Path:
    """Return the path of the user's own file."""
    own = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    folder = own if own.is_absolute() else Path("~/.config").expanduser()
    return folder / "armtree" / FILE


def _upwards() -> Iterator[Path]:
    """Yield the nearest file in the working directory or above it."""
    try:
        here = Path.cwd()
    except OSError:  # the working directory was deleted
        return
    paths = (folder / FILE for folder in (here, *here.parents))
    if found := next((path for path in paths if path.exists()), None):
        yield found


def _read(path: Path) -> tuple[dict[str, Configured], list[str]]:
    """Return the values of a file that are right, and what is wrong in it."""
    from hardware import DescriptionError
    from hardware.spelling import there_are
    from hardware.toml_table import TomlTable  # only where there is a file

    values, wrong = dict[str, Configured](), list[str]()
    try:
        _check_owner(path)
        table = TomlTable.read(path)
    except DescriptionError as error:
        return {}, [str(error)]
    for name in table:
        try:
            if name not in SETTINGS:
                table.fail(name, f"unknown key; {there_are(name, SETTINGS)}")
            value = SETTINGS[name].read(table, name, path.parent)
            values[name] = Configured(value, f"{path}:{table.line(name)}")
        except DescriptionError as error:
            wrong.append(str(error))
    return values, wrong


def _check_owner(path: Path) -> None:
    """Reject a file that another user has put into a folder for all, such as the one above theirs.

    Its skills would run as this user.
    """
    from hardware import DescriptionError

    owner, folder = path.stat().st_uid, path.parent.stat().st_uid
    if owner not in (os.getuid(), folder, 0):
        why = "belongs to another user, so it is not read; delete it, or work in another folder"
        raise DescriptionError(path, 0, why)
