"""Values of a task's parameters, given when it is called."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from trees.errors import BadArguments, FileError, Mistake, Place
from trees.reading.document import REFUSED, Located
from trees.reading.grammar import parse_value

FILE = "arguments.yaml"  # what a recording keeps them as
MISSING = Place(Path("arguments"), 0, 0)  # of one that is not given


def read_arguments(settings: Sequence[str], tasks: Sequence[int]) -> dict[str, Located]:
    """Read NAME=VALUE, the value as it would stand in a file.

    Args:
        settings: What was given.
        tasks: Which tasks are called.

    Raises:
        BadArguments: A setting is wrong, or it is not clear for which task it is.
    """
    arguments: dict[str, Located] = {}
    wrong: list[Mistake] = []
    for setting in settings:
        name, equals, text = setting.partition("=")
        source = f"--set {setting}"
        if len(tasks) > 1:
            wrong.append(_wrong(source, "goes with one task; run them one by one"))
        if not equals or not name:
            wrong.append(_wrong(source, "is not NAME=VALUE"))
            continue
        if name in arguments:
            wrong.append(_wrong(source, f"{name} is given twice"))
        arguments[name] = _parsed(text, source, wrong)
    return _right(arguments, wrong)


def located(arguments: Mapping[str, str | Located]) -> dict[str, Located]:
    """Values of which some are still text, as it would stand in a file.

    Raises:
        BadArguments: A text cannot be read.
    """
    wrong: list[Mistake] = []
    read = {
        name: _parsed(value, f"argument {name}", wrong) if isinstance(value, str) else value
        for name, value in arguments.items()
    }
    return _right(read, wrong)


def as_text(arguments: Mapping[str, Located]) -> str:
    """The arguments as a file."""
    return "".join(f"{name}: {json.dumps(value.plain())}\n" for name, value in arguments.items())


def wrong(mistakes: Iterable[Mistake], arguments: Mapping[str, Located]) -> FileError:
    """What is wrong with a task, or with nothing but what it is called with."""
    found = tuple(mistakes)
    given = {MISSING.path, *(value.place.path for value in arguments.values())}
    callers = all(mistake.place.path in given for mistake in found)
    return (BadArguments if callers else FileError)(found)


def _parsed(text: str, source: str, wrong: list[Mistake]) -> Located:
    try:
        return parse_value(text, source)
    except FileError as error:
        wrong += error.mistakes
        return Located(MISSING, REFUSED, MISSING)


def _right(arguments: dict[str, Located], wrong: list[Mistake]) -> dict[str, Located]:
    if wrong:
        raise BadArguments(wrong)
    return arguments


def _wrong(source: str, message: str) -> Mistake:
    return Mistake(Place(Path(source), 0, 0), message)
