"""World files: bodies around the arm, as JSON."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

from executive.errors import BadWorldFile
from hardware import Robot
from hardware.files import read_file
from skills.motion import BadWorld, World
from skills.motion.collision.planning_scene import PlanningScene
from trees import Mistake, Place

_MAX_BYTES = 2**20


def read_world(file: Path) -> World:
    """Return the bodies of a JSON file. README.md describes its format.

    Raises:
        BadWorldFile: The file cannot be read, or does not contain a list of bodies.
    """
    try:
        text = read_file(file, _MAX_BYTES).decode("utf-8")
        return World.parse(json.loads(text, object_pairs_hook=_once))
    except BadWorld as error:
        raise BadWorldFile.at(file, str(error)) from error
    except OSError as error:
        raise BadWorldFile.at(file, f"cannot be read: {error.strerror}") from error
    except json.JSONDecodeError as error:
        why = f"is not JSON: {error.msg}"
        lines = error.doc.splitlines()
        place = Place(file, error.lineno, error.colno, lines=lines)
        raise BadWorldFile([Mistake(place, why)]) from error
    except RecursionError as error:
        raise BadWorldFile.at(file, "its lists or objects are nested too deep") from error
    except ValueError as error:  # not UTF-8, or a huge number
        raise BadWorldFile.at(file, f"is not JSON: {error}") from error


def check_world(file: Path, world: World, robot: Robot) -> None:
    """Check that the bodies of a file fit the robot.

    Raises:
        BadWorldFile: A body names an unknown link or body, or a file that is not a mesh.
    """
    try:
        PlanningScene(robot, world)
    except BadWorld as error:
        raise BadWorldFile.at(file, str(error)) from error


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object; reject duplicate keys, of which `json` would keep the last one."""
    found = dict(pairs)
    if len(found) < len(pairs):
        duplicate = next(
            key for key, times in Counter(key for key, _ in pairs).items() if times > 1
        )
        name = found.get("name")
        where = name if isinstance(name, str) and duplicate != "name" else "one object"
        raise BadWorld(f"{json.dumps(duplicate)} is given twice in {where}; leave one out")
    return found
