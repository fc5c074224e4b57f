"""World files: bodies around the arm, as JSON or YAML."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.api import strict_json
from executive.errors import BadWorldFile
from hardware import Robot, read_file
from skills.motion import BadWorld, Body, Mesh, World
from trees import FileError, Located, Mistake, Place
from trees.reading.document import draft_document, nested, split_lines

_MAX_BYTES = 2**20


def read_world(file: Path) -> World:
    """Return the bodies of a file. docs/pages/how_to/plan.md describes its format.

    A relative path of a mesh is in the folder of the file.

    Raises:
        BadWorldFile: The file cannot be read, or does not contain a list of bodies.
    """
    try:
        data = read_file(file, _MAX_BYTES)
    except OSError as error:
        raise BadWorldFile.at(file, f"cannot be read: {error.strerror}") from error
    except ValueError as error:  # an error of the path
        raise BadWorldFile.at(file, str(error)) from error
    try:
        return World(
            tuple(_in_folder(each, file) for each in World.parse(_plain(file, data)).bodies)
        )
    except BadWorld as error:
        raise BadWorldFile(_mistakes(file, data, error.all)) from error


def _plain(file: Path, data: bytes) -> Any:
    """Return the content of a file. YAML includes JSON, but takes longer to read."""
    try:
        return strict_json.parse(data)
    except strict_json.NotJson as error:
        try:
            root, mistakes = draft_document(file, data.decode())
        except (FileError, UnicodeDecodeError):
            lines = split_lines(data.decode(errors="replace")) if error.line else []
            place = Place(file, error.line, error.column, lines=lines)
            raise BadWorldFile([Mistake(place, f"is not JSON: {error.why}")]) from error
        if mistakes:
            raise BadWorldFile(mistakes) from error
        return root.plain()


def _mistakes(file: Path, data: bytes, errors: Sequence[BadWorld]) -> list[Mistake]:
    """Return errors of bodies as mistakes, with their lines if the errors have locations."""
    if any(error.location for error in errors):  # to find lines takes seconds in a large file
        with suppress(FileError, UnicodeDecodeError):
            root, _ = draft_document(file, data.decode())
            return [_mistake(root, error) for error in errors]
    return [Mistake(Place(file), str(error)) for error in errors]


def _mistake(root: Located, error: BadWorld) -> Mistake:
    """Return a wrong body as a mistake at its key."""
    value, (_, asked, near) = root, str(error).removesuffix("?").rpartition("; did you mean ")
    for step in error.location:
        items = value.value if isinstance(value.value, list) else []
        inner = items[step] if isinstance(step, int) else nested(value).get(step)
        if inner is None:  # a key is missing
            break
        value = inner
    old, right = str(error.location[-1]) if error.location else "", None
    if asked and near.isidentifier():  # a key
        right = value.label.replaced(f'"{old}"', f'"{near}"') or value.label.replaced(old, near)
    elif asked:
        right = value.instead(near)
    return Mistake(value.label, str(error), right)


def in_file(file: Path, error: BadWorld) -> BadWorldFile:
    """Return an error about a body of a file, with its line."""
    return BadWorldFile(_mistakes(file, read_file(file, _MAX_BYTES), error.all))


def _in_folder(body: Body, file: Path) -> Body:
    shape = body.shape
    if not isinstance(shape, Mesh):
        return body
    return replace(body, shape=replace(shape, path=str(file.parent / shape.path)))


def check_world(file: Path, world: World, robot: Robot) -> None:
    """Check that the bodies of a file fit the robot.

    Raises:
        BadWorldFile: A body names an unknown link or body, or a file that is not a mesh.
    """
    from skills.motion.collision.planning_scene import PlanningScene  # imports pinocchio

    try:
        PlanningScene(robot, world)
    except BadWorld as error:
        raise in_file(file, error) from error
