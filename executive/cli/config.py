"""`armtree config`."""

import json

import click

from .settings import FILE, SETTINGS, environment_name, files, find_setting, read_files, user_file
from .support.command_group import command
from .terminal.streams import echo


@command()
@click.argument("names", metavar="[NAME]...", nargs=-1, type=click.Choice(list(SETTINGS)))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per setting.")
@click.pass_context
def config(context: click.Context, names: tuple[str, ...], as_json: bool) -> None:
    """Show each setting, its value, and where the value comes from. With NAME, only that setting.

    A setting is an option of a command, such as --recording-timeout, an environment variable, such
    as ARMTREE_RECORDING_TIMEOUT, or a key of a file, such as recording_timeout. Precedence: option,
    environment, the nearest armtree.toml in the working directory or above it, armtree/armtree.toml
    in the user's folder for configuration, default.

    A relative path in a file starts in the folder of that file. An unknown key is an error, which
    is reported after the settings. Programs in Python do not read the files.

    \b
    Example of an armtree.toml:
      port = "/dev/ttyACM0"
      trees = "tasks"
      recording_timeout = 2.0
    """  # noqa: D301
    _, wrong = read_files(context)
    context.resilient_parsing = True  # mistakes are reported after the table
    rows = {name: find_setting(context, name) for name in names or SETTINGS}
    for name, (value, source) in rows.items():
        shown = value if value is None or isinstance(value, int | float) else str(value)
        if as_json:
            row = {"setting": name, "value": shown, "source": source or "default"}
            row |= {"environment": environment_name(name), "about": SETTINGS[name].help}
            echo(json.dumps(row))
        else:
            about = SETTINGS[name].help.partition(". ")[0].rstrip(".")
            echo(f"{name:<18} {'-' if value is None else shown!s:<30} {source or 'default'}")
            echo(f"{'':<18} {about}")
    if not as_json and not files():
        echo("", f"There is no {FILE} in this folder or a folder above it, and no {user_file()}.")
    if wrong:
        from executive.errors import BadConfiguration  # slow to import

        raise BadConfiguration("\n".join(wrong))
