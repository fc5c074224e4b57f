"""A group of commands: help by section, and the options that every command takes."""

import logging
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import click

from executive.cli.terminal.streams import LogFormatter


@dataclass
class Diagnostics:
    """What a command prints beside its result.

    Attributes:
        verbose: True to print the log to standard error.
        debug: True to print the traceback of an error.
    """

    verbose: bool = False
    debug: bool = False


def diagnostics() -> Diagnostics:
    """Return what the current command prints beside its result."""
    return click.get_current_context().ensure_object(Diagnostics)


def _set_verbose(context: click.Context, _option: click.Parameter, given: bool) -> None:
    wanted = context.ensure_object(Diagnostics)
    if given and not wanted.verbose:
        wanted.verbose = True
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(LogFormatter("%(levelname)s %(name)s: %(message)s"))
        logging.getLogger().addHandler(handler)


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
        ["--debug"], callback=_set_debug, help="Print the traceback of an error.", **_shared
    ),
)


class CommandGroup(click.Group):
    """A group of commands. Each of them takes --verbose and --debug, before and after its name.

    Args:
        sections: Commands by the title of their section in the help. Without sections, commands are
            added by the decorator `command`.
    """

    def __init__(
        self,
        *arguments: Any,
        sections: Mapping[str, Sequence[click.Command]] | None = None,
        **settings: Any,
    ) -> None:
        super().__init__(*arguments, **settings)
        self._sections = sections or {}
        self.params += _EVERYWHERE
        for commands in self._sections.values():
            for command in commands:
                self.add_command(command)

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        """Add a command."""
        super().add_command(cmd, name)
        cmd.params += [option for option in _EVERYWHERE if option not in cmd.params]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the commands of each section, each with its whole first sentence."""
        width = max(map(len, self.commands))
        sections = self._sections or {"Commands": tuple(self.commands.values())}
        for title, commands in sections.items():
            rows = [
                (f"{command.name:<{width}}", command.get_short_help_str(limit=sys.maxsize))
                for command in commands
            ]
            with formatter.section(title):
                formatter.write_dl(rows)
