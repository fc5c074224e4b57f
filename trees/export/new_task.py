"""Writes a new task file: a commented example that runs."""

import re
from pathlib import Path

from trees.errors import FileError, Mistake, Place
from trees.reading.library import Library

from .schema import NAME, schema_text

_TEXT = """\
# yaml-language-server: $schema={schema}
# trees/README.md describes everything that a task can contain. `armtree check` finds mistakes.
task: {number}
name: {name}
description: Turn the arm to and fro.

# Parameters, given when the task is run: armtree run {number} --set swing="30 deg"
parameters:
  swing: {{type: angle, default: 20 deg, min: 1 deg, max: 60 deg, description: angle of the turn}}

# The tree. `armtree skills` lists the skills, `armtree show {number}` draws this tree.
tree:
  sequence:
    - subtree: reach                # a target for arm and gripper
      with: {{arm: upright, gripper: open}}
    - repeat:
        sequence:
          - subtree: move_joints    # some joints; the others do not move
            with: {{joints: {{joint_1: $swing}}}}   # in rad, or with a unit
          - Wait: {{duration: 200 ms}}
          - subtree: move_joints
            with: {{joints: {{joint_1: 0}}}}
      times: 2
    - Say: {{text: "{name}: done"}}
"""


def write_task(folder: Path, number: int, name: str) -> Path:
    """Write a task file, and the JSON Schema that editors use to complete it.

    Args:
        folder: Folder to write to. It is created if it does not exist.
        number: Number of the task.
        name: Name of the task.

    Returns:
        The path of the task file.

    Raises:
        FileError: The number is in use, the name is invalid, or the file cannot be written.
    """
    path = folder / f"{number}_{name}.yaml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        library = Library(folder)
        if number in library.numbers():
            raise _wrong(path, f"task {number} is in {library.path(number)} already")
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name):
            raise _wrong(
                path, f"{name!r} is not a name; use a letter, then letters, digits, _ or -"
            )
        (folder / NAME).write_text(schema_text(library))
        path.write_text(_TEXT.format(number=number, name=name, schema=NAME))
    except OSError as error:
        raise _wrong(path, f"cannot be written: {error.strerror}") from error
    return path


def _wrong(path: Path, message: str) -> FileError:
    return FileError([Mistake(Place(path, 0, 0), message)])
