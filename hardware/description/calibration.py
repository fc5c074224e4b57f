"""The calibration of an arm: a file of its own, which takes precedence over the robot file."""

import shlex
from collections.abc import Mapping
from pathlib import Path

from hardware.files import user_folder, write_file
from hardware.loading.dataclass import dataclass
from hardware.toml_table import TomlTable

ROBOTS = Path(__file__).parents[1] / "robots"  # the shipped robots
VERSION = 1
_SUFFIX = ".calibration.toml"


@dataclass(frozen=True, slots=True)
class CalibratedJoint:
    """The calibration of a joint.

    Attributes:
        lower: Smallest position of the calibrated range [deg].
        upper: Largest position of the calibrated range [deg].
        wire: Value of the key `wire`: a table of TOML in one line. The driver reads it.
        before: Values that the servo stored before the first calibration, by their names in
            `ServoReport.kept`.
    """

    lower: float
    upper: float
    wire: str
    before: Mapping[str, int]


def calibration_file(robot_file: Path) -> Path:
    """Return the path of the calibration file for a robot file. The file may be missing.

    It is in the folder of the robot file. For a shipped robot it is in the user's folder, because
    an installation may be read-only, and an update would delete the file.
    """
    folder = user_folder() if _ships(robot_file) else robot_file.parent
    return folder / f"{robot_file.stem}{_SUFFIX}"


def calibrate_command(robot_file: Path, port: str) -> str:
    """Return the command that calibrates an arm, for messages.

    Args:
        robot_file: The robot file.
        port: Name of the port.
    """
    robot = robot_file.stem if _ships(robot_file) else str(robot_file)
    return shlex.join(["armtree", "calibrate", "--robot", robot, "--port", port])


def _ships(robot_file: Path) -> bool:
    return robot_file.resolve().is_relative_to(ROBOTS.resolve())


def is_robot_file(path: Path) -> bool:
    """Return True if a TOML file in a folder of robots is a robot file, not a calibration."""
    return not path.name.endswith(_SUFFIX)


def read_calibration(path: Path, robot: str) -> TomlTable | None:
    """Return the table of the joints in a calibration file; None if there is no such file.

    Args:
        path: The calibration file.
        robot: Name of the robot.

    Raises:
        DescriptionError: The file is wrong, or it calibrates another robot.
    """
    if not path.is_file():
        return None
    root = TomlTable.read(path)
    root.integer("version", choices=(VERSION,))
    if (other := root.text("robot")) != robot:
        root.fail("robot", f"the file is for {other}, not {robot}; delete it, or calibrate again")
    root.text("made")
    joints = root.table("joints")
    root.done()
    return joints


def earlier_values(path: Path, robot: str, ticks: int) -> dict[str, dict[str, tuple[int, int]]]:
    """Return the values of each joint's servo in a calibration file; empty if there is no file.

    Args:
        path: The calibration file.
        robot: Name of the robot.
        ticks: Number of positions in a turn of a servo. Values must be smaller.

    Returns:
        For each joint and each value, by its name in `ServoReport`: the value before the first
        calibration, and the value of the last calibration.

    Raises:
        DescriptionError: The file is wrong, or it calibrates another robot.
    """
    joints = read_calibration(path, robot)
    found = dict[str, dict[str, tuple[int, int]]]()
    for name in joints or ():
        assert joints
        before, wire = (joints.table(name).table(key) for key in ("before", "wire"))
        allowed = range(1 - ticks, ticks)
        found[name] = {
            key: (before.integer(key, choices=allowed), wire.integer(key, choices=allowed))
            for key in before
        }
    return found


def write_calibration(
    path: Path, robot: str, made: str, joints: Mapping[str, CalibratedJoint]
) -> None:
    """Write a calibration file, and its folder if it is missing.

    Args:
        path: The file.
        robot: Name of the robot.
        made: Time and method of the calibration, as text for people.
        joints: The calibration of every actuated joint.

    Raises:
        OSError: The file cannot be written.
    """
    lines = [
        f"# Calibration of {robot}, by `armtree calibrate`. It takes precedence over the robot",
        "# file. `armtree calibrate --restore` writes `before` back and deletes this file.",
        "",
        f"version = {VERSION}",
        f'robot = "{robot}"',
        f'made = "{made}"',
    ]
    for name, joint in joints.items():
        before = ", ".join(f"{key} = {value}" for key, value in joint.before.items())
        lines += [
            "",
            f"[joints.{name}]",
            f"lower_deg = {joint.lower:.3f}",
            f"upper_deg = {joint.upper:.3f}",
            f"wire = {joint.wire}",
            f"before = {{ {before} }}",
        ]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, ("\n".join(lines) + "\n").encode())
