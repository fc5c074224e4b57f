"""Writes a new task file: a commented example that runs."""

import json
import re
from pathlib import Path

from hardware import DISPLAY_UNITS, Robot, write_file
from hardware.spelling import did_you_mean
from trees.errors import FileError
from trees.export.schema import NAME as SCHEMA, schema_text
from trees.reading.library import Library
from trees.reading.node_parser import NAME, joined

_TEXT = Path(__file__).with_suffix(".yaml.txt")  # template with fields for numbers and names
_MOST = 60.0  # largest swing [deg or mm]


def write_task(robot: Robot, folder: Path, number: int, name: str) -> Path:
    """Write a task file and return its path. See `prepare_file`."""
    path = prepare_file(robot, folder, number, name)
    try:
        values = {"number": number, "name": name, "schema": SCHEMA, **_values(robot)}
        write_file(path, _TEXT.read_text().format(**values).encode())
    except OSError as error:
        raise FileError.at(path, f"cannot be written: {error.strerror}") from error
    return path


def prepare_file(robot: Robot, folder: Path, number: int, name: str) -> Path:
    """Check number and name of a new task. Write the JSON Schema for editors into its folder.

    This is the subfolder with the name of the robot, because the task names joints.

    Args:
        robot: The robot.
        folder: Folder of the user's files. It is created if it does not exist.
        number: Number of the task.
        name: Name of the task.

    Returns:
        The path for the task file.

    Raises:
        FileError: Number or name are in use, the name is invalid, or the schema cannot be written.
    """
    own = folder / robot.name
    path = own / f"{number}_{name}.yaml"
    if not NAME.fullmatch(name):
        why = f"{name!r} is not a name; use a letter, then letters, digits, _ or -"
        raise FileError.at(path, why + did_you_mean(joined(name)))
    try:
        own.mkdir(parents=True, exist_ok=True)
        library = Library(folder, robot.name)
        if number in library.numbers():
            there = library.path(number)
            where = "is here" if there == path else f"is in {there}"
            ways = f"give another number, such as {library.free_number(number)}"
            if there.parent not in library.shipped:
                ways = f"edit that file, or delete it, or {ways}"
            raise FileError.at(path, f"task {number} {where} already; {ways}")
        if name in (names := library.names()):
            raise FileError.at(
                path, f"task {names[name]} is called {name} already; give another name"
            )
        write_file(own / SCHEMA, schema_text(library).encode())
    except OSError as error:
        raise FileError.at(path, f"cannot be written: {error.strerror}") from error
    return path


def _values(robot: Robot) -> dict[str, str]:
    """Return the values of the fields of the template that depend on the robot."""
    joint = max(robot.actuated_in("arm"), key=lambda joint: joint.upper - joint.boot)
    scale, unit = DISPLAY_UNITS[joint.unit]
    most = min(_MOST, scale * (joint.upper - joint.boot))
    swings = {"least": most / 60.0, "default": most / 3.0, "most": most}
    return {
        "kind": "length" if joint.unit == "m" else "angle",
        "unit": joint.unit,
        "joint": _quoted(joint.name),
        "start": f"{joint.boot:g}",
        "all": ", ".join(f"{_quoted(each.name)}: {each.boot:g}" for each in robot.actuated),
        **{name: f"{swing:.4g} {unit}" for name, swing in swings.items()},
    }


def _quoted(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z_][\w.-]*", name) else json.dumps(name)
