"""World files: bodies around the arm, as JSON."""

from pathlib import Path

from executive.api import strict_json
from executive.errors import BadWorldFile
from hardware import Robot, read_file
from skills.motion import BadWorld, World
from skills.motion.collision.planning_scene import PlanningScene
from trees import Mistake, Place

_MAX_BYTES = 2**20


def read_world(file: Path) -> World:
    """Return the bodies of a JSON file. docs/pages/how_to/plan.md describes its format.

    Raises:
        BadWorldFile: The file cannot be read, or does not contain a list of bodies.
    """
    try:
        data = read_file(file, _MAX_BYTES)
        return World.parse(strict_json.parse(data))
    except BadWorld as error:
        raise BadWorldFile.at(file, str(error)) from error
    except OSError as error:
        raise BadWorldFile.at(file, f"cannot be read: {error.strerror}") from error
    except strict_json.NotJson as error:
        lines = data.decode(errors="replace").splitlines() if error.line else []
        place = Place(file, error.line, error.column, lines=lines)
        raise BadWorldFile([Mistake(place, f"is not JSON: {error.why}")]) from error
    except ValueError as error:  # an error of the path
        raise BadWorldFile.at(file, str(error)) from error


def check_world(file: Path, world: World, robot: Robot) -> None:
    """Check that the bodies of a file fit the robot.

    Raises:
        BadWorldFile: A body names an unknown link or body, or a file that is not a mesh.
    """
    try:
        PlanningScene(robot, world)
    except BadWorld as error:
        raise BadWorldFile.at(file, str(error)) from error
