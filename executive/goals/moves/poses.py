"""Lists poses, and saves the position of the arm as a pose."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from executive.api.events import Where
from executive.api.move import HOME
from hardware import NotActive, Robot
from hardware.spelling import choices
from skills import BadTarget
from trees import Library
from trees.writing.saved_poses import PoseExists, save_pose

from .move_task import poses_with_home

ALL = "all"  # word for all groups


def listed_poses(robot: Robot, library: Library) -> Iterator[tuple[str, Mapping[str, float], str]]:
    """Yield each pose: its name, its joint positions [rad], and its source, such as `FILE:LINE`."""
    poses, _ = library.poses()
    files, _ = library.draft_poses()
    if HOME not in poses:
        source = "home of the robot file" if robot.home else robot.firmware.words.start_pose
        yield HOME, poses_with_home(robot, poses)[HOME], source
    for name, positions in poses.items():
        (*_, file) = (file for file in files if name in file.poses)
        place = file.labels[name].label
        shipped = file.path.parent in library.shipped
        yield name, positions, "shipped" if shipped else f"{place.path}:{place.line}"


def save_where(
    robot: Robot, where: Where, folder: Path, name: str, group: str, replace: bool
) -> tuple[Path, dict[str, float]]:
    """Save the commanded position of a group as a pose.

    Args:
        robot: The robot.
        where: Position of the arm.
        folder: Folder of the user's files. It is created if it does not exist.
        name: Name of the pose.
        group: A group of the robot, or `all`.
        replace: True to replace a pose of that name.

    Returns:
        The file, and the saved positions [rad].

    Raises:
        BadTarget: The robot has no such group.
        NotActive: The position of the arm is unknown.
        PoseExists: The name is in use; `home` always is.
        FileError: The name is invalid, or the file cannot be written.
    """
    if group not in (*robot.groups, ALL):
        known = choices(group, (*robot.groups, ALL))
        raise BadTarget(f"the robot has no group {group}; there are {known}")
    if where.commanded is None:
        raise NotActive("The pose of an inactive arm is not known; activate it, or move it first")
    if name == HOME and not replace:
        why = f"pose {HOME} is the robot's own; give another name, or --replace to use yours"
        raise PoseExists.at(folder, why)
    joints = robot.actuated if group == ALL else robot.actuated_in(group)
    positions = {joint.name: where.commanded[joint.name] for joint in joints}
    return save_pose(robot, folder, name, positions, replace), positions
