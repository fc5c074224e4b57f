"""Values of a task's parameters, given when it is called."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from trees import FileError, Located, Mistake, Place, parse_value

FILE = "arguments.yaml"  # what a recording keeps them as


def read_arguments(settings: Sequence[str], tasks: Sequence[int]) -> dict[str, Located]:
    """Read NAME=VALUE, the value as it would stand in a file.

    Args:
        settings: What was given.
        tasks: Which tasks are called.

    Raises:
        FileError: A setting is wrong, or it is not clear for which task it is.
    """
    arguments: dict[str, Located] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        source = f"--set {setting}"
        if len(tasks) > 1:
            raise _wrong(source, "goes with one task; run them one by one")
        if not equals or not name:
            raise _wrong(source, "is not NAME=VALUE")
        if name in arguments:
            raise _wrong(source, f"{name} is given twice")
        arguments[name] = parse_value(text, source)
    return arguments


def located(arguments: Mapping[str, str | Located]) -> dict[str, Located]:
    """Values of which some are still text, as it would stand in a file.

    Raises:
        FileError: A text cannot be read.
    """
    return {
        name: parse_value(value, f"argument {name}") if isinstance(value, str) else value
        for name, value in arguments.items()
    }


def as_text(arguments: Mapping[str, Located]) -> str:
    """The arguments as a file."""
    return "".join(f"{name}: {json.dumps(value.plain())}\n" for name, value in arguments.items())


def _wrong(source: str, message: str) -> FileError:
    return FileError([Mistake(Place(Path(source), 0, 0), message)])
