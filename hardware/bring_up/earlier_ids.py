"""The file with the ids that servos had before `armtree calibrate --ids`."""

import json
from collections.abc import Mapping
from pathlib import Path

from hardware.description.calibration import calibration_file
from hardware.errors import DescriptionError
from hardware.files import read_file, write_file

_MAX_BYTES = 2**16  # largest file [bytes]


def ids_file(robot_file: Path) -> Path:
    """Return the path of the file with earlier ids for a robot file. The file may be missing."""
    return calibration_file(robot_file).with_name(f"{robot_file.stem}.ids.json")


def read_ids(path: Path, servos: Mapping[str, int]) -> dict[str, int]:
    """Return the earlier id of the servo of each joint; empty if there is no file.

    Args:
        path: The file.
        servos: Present ids, by joint.

    Raises:
        DescriptionError: The file is wrong, or has other joints.
    """
    if not path.is_file():
        return {}
    try:
        ids = json.loads(read_file(path, _MAX_BYTES))
    except (OSError, ValueError, RecursionError) as error:
        raise DescriptionError(path, 0, f"cannot be read: {error}; delete it") from error
    joints = isinstance(ids, dict) and ids.keys() <= servos.keys()
    if not joints or not all(type(each) is int for each in ids.values()):
        raise DescriptionError(path, 0, "does not have ids of joints of this robot; delete it")
    return dict(ids)


def write_ids(path: Path, ids: Mapping[str, int]) -> None:
    """Write the file, and its folder if it is missing; delete the file if there are no ids.

    Raises:
        OSError: The file cannot be written.
    """
    if not ids:
        path.unlink(missing_ok=True)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, f"{json.dumps(dict(ids), indent=2)}\n".encode())
