"""The installation of ROS 2 for this process: a sourced one, or the one that `make ros2` made."""

import os
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

FOLDER = Path(sys.prefix) / "ros2"
DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
# Without this variable, wheels restart the interpreter to set the variables of `environment`.
_COMPLETE = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"


def is_ready() -> bool:
    """Return True if this process can import ROS 2."""
    return find_spec("rclpy") is not None


def environment(folder: Path = FOLDER) -> Mapping[str, str] | None:
    """Return the environment of a process that uses an installation made from wheels.

    Args:
        folder: Folder of the installation.

    Returns:
        The whole environment, or None if nothing is installed there.
    """
    site = folder / "lib/python{}.{}/site-packages".format(*sys.version_info) / ""
    if not (site / "rclpy").is_dir():
        return None
    paths = {
        "PYTHONPATH": [site],
        "LD_LIBRARY_PATH": [folder / "lib", *sorted(site.glob("ros_*.libs"))],
        "AMENT_PREFIX_PATH": [folder],
    }
    found = {**os.environ, _COMPLETE: "1"}
    for name, added in paths.items():
        before = [os.environ[name]] if os.environ.get(name) else []
        found[name] = os.pathsep.join([*map(str, added), *before])
    return found


def stay_on_this_machine() -> bool:
    """Limit discovery to nodes of this machine, unless the user has set another range.

    Returns:
        False if this process can find nodes of other machines.
    """
    return os.environ.setdefault(DISCOVERY, "LOCALHOST") in ("LOCALHOST", "OFF") or (
        os.environ.get("ROS_LOCALHOST_ONLY") == "1"
    )
