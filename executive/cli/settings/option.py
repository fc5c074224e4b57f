"""The option of a setting, and its value.

Precedence: option, environment, the file nearest to the working directory, the user's file,
default.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from .armtree_toml import configured
from .rows import SETTINGS, environment_name

F = TypeVar("F", bound=Callable[..., Any])

SETTINGS_SECTION = "Settings, also in armtree.toml, or ARMTREE_SEED and so on"


class SettingOption(click.Option):
    """The option of a setting. Its value may also be in an environment variable or a file."""

    section = SETTINGS_SECTION

    def get_help_extra(self, ctx: click.Context) -> Any:
        """Return the default, for the end of the help text, without the range of the value."""
        return {"default": extra} if (extra := super().get_help_extra(ctx).get("default")) else {}

    def get_error_hint(self, ctx: click.Context | None) -> str:
        """Return the source of the value, for an error: its option, variable, or file and line."""
        source = ctx.get_parameter_source(self.name) if ctx and self.name else None
        if source is ParameterSource.ENVIRONMENT:
            return str(self.envvar)
        if ctx and self.name and source is ParameterSource.DEFAULT_MAP:
            return configured(ctx)[self._setting].place
        return click.Parameter.get_error_hint(self, ctx)

    @property
    def _setting(self) -> str:
        """Name of the setting. The function's parameter may have another name."""
        (flag, *_) = self.opts
        return flag.removeprefix("--").replace("-", "_")

    def consume_value(
        self, ctx: click.Context, opts: Mapping[str, Any]
    ) -> tuple[Any, ParameterSource]:
        """Return the value before its conversion, and its source."""
        value, source = super().consume_value(ctx, opts)
        if source in (ParameterSource.COMMANDLINE, ParameterSource.ENVIRONMENT):
            return value, source
        if found := configured(ctx).get(self._setting):
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
        "show_envvar": True,  # errors name the variable
        "help": row.help,
        "metavar": row.metavar,
        "default": row.default,
        "show_default": row.default is not None and not callable(row.default),
    }


def given_options(context: click.Context, *names: str) -> Iterator[str]:
    """Yield each of the named options that is on the command line, and after it its value."""
    for name in names:
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            yield from (f"--{name}", str(context.params[name]))


def find_setting(ctx: click.Context, name: str) -> tuple[Any, str]:
    """Return the value of a setting without its option, and the source of the value.

    The source is an environment variable, a file and line, or "" for the default.

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
