"""A group of commands. Its help has sections. All its commands share some options."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import click

from hardware.spelling import did_you_mean, suggestion

_OWN, _COMMON = "Options", "Options of every command"
# Names of commands in other programs, and the commands of armtree that they may mean.
_OTHER_NAMES = {
    **dict.fromkeys(("delete", "remove", "del"), ("rm",)),
    **dict.fromkeys(("list", "dir"), ("ls", "tasks")),
    **dict.fromkeys(("goto", "go", "moveto"), ("move",)),
    **dict.fromkeys(("start", "exec", "execute"), ("run",)),
}
# Environment variable that a shell sets to request completions.
COMPLETION_VARIABLE = "_ARMTREE_COMPLETE"


@dataclass
class Diagnostics:
    """Additional output of a command, besides its result.

    Attributes:
        verbose: True to print the log to standard error.
        debug: True to print the traceback of an error.
    """

    verbose: bool = False
    debug: bool = False


def diagnostics() -> Diagnostics:
    """Return the `Diagnostics` of the current command."""
    return click.get_current_context().ensure_object(Diagnostics)


def _set_verbose(context: click.Context, _option: click.Parameter, given: bool) -> None:
    wanted = context.ensure_object(Diagnostics)
    if given and not wanted.verbose:
        import logging

        from executive.cli.terminal.log_printer import LogPrinter

        wanted.verbose = True
        logging.getLogger().addHandler(LogPrinter("%(levelname)s %(name)s: %(message)s"))


def _set_debug(context: click.Context, _option: click.Parameter, given: bool) -> None:
    context.ensure_object(Diagnostics).debug |= given


_shared: dict[str, Any] = {"is_flag": True, "is_eager": True, "expose_value": False}
_EVERYWHERE = (
    click.Option(
        ["-v", "--verbose"],
        callback=_set_verbose,
        help="Print the log to standard error.",
        **_shared,
    ),
    click.Option(
        ["--debug"],
        callback=_set_debug,
        help="Print the traceback of an error, except of wrong usage.",
        **_shared,
    ),
)


class Command(click.Command):
    """A command. Its help lists its own options, its settings, and the options of every command."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, by section."""
        from executive.cli.settings import SETTINGS_SECTION

        titles = (_OWN, SETTINGS_SECTION, _COMMON)
        sections: dict[str, list[tuple[str, str]]] = {title: [] for title in titles}
        for option in self.get_params(ctx):
            if isinstance(option, click.Option) and (record := option.get_help_record(ctx)):
                title = getattr(option, "section", _OWN)
                sections[_COMMON if option.is_eager else title].append(record)
        for title, records in sections.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def command(*arguments: Any, **settings: Any) -> Callable[[Callable[..., Any]], Command]:
    """Return a decorator that makes a `Command`, like `click.command`."""
    return click.command(*arguments, cls=Command, **settings)


class CommandGroup(click.Group):
    """A group of commands. Every command accepts --verbose and --debug, before and after its name.

    Args:
        sections: Commands by the title of their section in the help: a sentence about each, by its
            module and function, such as `new_arm.new_arm`. A module is imported when its command
            is needed. None if the decorator `command` adds the commands.
        package: Package of these modules.
    """

    command_class = Command

    def __init__(
        self,
        *arguments: Any,
        sections: Mapping[str, Mapping[str, str]] | None = None,
        package: str | None = None,
        **settings: Any,
    ) -> None:
        super().__init__(*arguments, **settings)
        self._package = package
        self._sections = {
            title: {_name(place): words for place, words in places.items()}
            for title, places in (sections or {}).items()
        }
        self._places = {_name(place): place for each in (sections or {}).values() for place in each}
        self.params += _EVERYWHERE

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Add a command."""
        super().add_command(cmd, name)
        cmd.params += [option for option in _EVERYWHERE if option not in cmd.params]

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        return [*(self._places or self.commands)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command, or None if there is no such command."""
        if cmd_name in self._places and cmd_name not in self.commands:
            module, function = self._places[cmd_name].split(".")
            found = getattr(import_module(f".{module}", self._package), function)
            self.add_command(found, cmd_name)
        return super().get_command(ctx, cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return a command: its name, the command, and its arguments.

        For an unknown name, raise a usage error that suggests a similar name.
        """
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            names = self.list_commands(ctx)  # click knows only imported commands
            if args[0] in names or args[0].startswith("-"):
                raise
            other = next((each for each in _OTHER_NAMES.get(args[0], ()) if each in names), "")
            near = did_you_mean(other) or suggestion(args[0], names)
            if ctx.parent and "show" in names and len(args) == 1:  # such as `armtree log latest`
                near = near or did_you_mean(f"{ctx.command_path} show {args[0]}")
            why = f"No such command {args[0]!r}{near}"
            raise click.UsageError(why, ctx) from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands of each section, each with the first sentence of its help."""
        width = max(map(len, self.list_commands(ctx)))
        sections = self._sections or {
            "Commands": {
                name: command.get_short_help_str(limit=sys.maxsize)
                for name, command in self.commands.items()
            }
        }
        for title, commands in sections.items():
            with formatter.section(title):
                formatter.write_dl(
                    [(f"{name:<{width}}", words) for name, words in commands.items()]
                )


def _name(place: str) -> str:
    """Return the name of a command from its module and function, such as `move.home`."""
    return place.partition(".")[2].rstrip("_").replace("_", "-")
