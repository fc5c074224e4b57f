"""Arguments: values of the parameters of a task, from the command line or a request."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from trees.errors import BadArguments, FileError, Mistake, Place
from trees.reading.document import REFUSED, Located
from trees.reading.grammar import parse_value

FILE = "arguments.yaml"  # name of the file with the arguments in a recording
_SOURCE = "arguments"
MISSING = Place(Path(_SOURCE))  # place of a missing argument


def read_arguments(settings: Sequence[str], tasks: Sequence[int] = ()) -> dict[str, Located]:
    """Return arguments by name from settings NAME=VALUE. A value is YAML, as in a task file.

    Args:
        settings: Texts of the form NAME=VALUE.
        tasks: Numbers of the tasks to run. A setting is for one task only.

    Raises:
        BadArguments: A setting is wrong, or there are several tasks.
    """
    arguments: dict[str, Located] = {}
    wrong: list[Mistake] = []
    for setting in settings:
        name, equals, text = setting.partition("=")
        source = f"--set {setting}"
        if len(tasks) > 1:
            wrong.append(_wrong(source, "is for one task; run the tasks one by one"))
        if not equals or not name:
            wrong.append(_wrong(source, "is not NAME=VALUE"))
            continue
        if name in arguments:
            wrong.append(_wrong(source, f"{name} is given twice"))
        arguments[name] = _parsed(text, source, name, wrong)
    return _right(arguments, wrong)


def located(arguments: Mapping[str, str | Located]) -> dict[str, Located]:
    """Return the arguments with places. Texts are read as YAML, as in a task file.

    Raises:
        BadArguments: A text is not YAML.
    """
    wrong: list[Mistake] = []
    read = {
        name: _parsed(value, _SOURCE, name, wrong, f"{name}: ") if isinstance(value, str) else value
        for name, value in arguments.items()
    }
    return _right(read, wrong)


def as_text(arguments: Mapping[str, Located]) -> str:
    """Return the text of a YAML file with the arguments."""
    return "".join(f"{name}: {json.dumps(value.plain())}\n" for name, value in arguments.items())


def wrong(mistakes: Iterable[Mistake], arguments: Mapping[str, Located]) -> FileError:
    """Return mistakes as a BadArguments if all of them concern arguments, else as a FileError."""
    found = tuple(mistakes)
    given = {MISSING.path, *(value.place.path for value in arguments.values())}
    callers = all(mistake.place.path in given for mistake in found)
    return (BadArguments if callers else FileError)(found)


def name_of(value: Located | None, arguments: Mapping[str, Located]) -> str:
    """Return the name of the argument that contains a value; empty for a value in a file."""
    if value and any(value.place.path == each.place.path for each in arguments.values()):
        return value.place.argument
    return ""


def _parsed(text: str, source: str, name: str, wrong: list[Mistake], label: str = "") -> Located:
    try:
        return parse_value(text, source, name)
    except FileError as error:
        for each in error.mistakes:
            place = replace(each.place, location=each.place.location or name)
            wrong.append(replace(each, place=place, message=f"{label}{each.message}"))
        return Located(MISSING, REFUSED, MISSING)


def _right(arguments: dict[str, Located], wrong: list[Mistake]) -> dict[str, Located]:
    if wrong:
        raise BadArguments(wrong)
    return arguments


def _wrong(source: str, message: str) -> Mistake:
    return Mistake(Place(Path(source)), message)
