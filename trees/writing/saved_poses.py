"""Saves and removes poses in the poses file of the user. Does not change other bytes."""

import io
from collections.abc import Collection, Mapping
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.nodes import CollectionNode, Node

from hardware import DISPLAY_UNITS, Joint, Robot, write_file
from hardware.spelling import did_you_mean, there_are
from trees.declarations import UNITS
from trees.errors import FileError, Mistake, Place, PoseUnknown
from trees.reading.grammar import PosesFile, draft_poses
from trees.reading.library import POSES, pose_paths, read_poses, shipped_folders, with_robot
from trees.reading.node_parser import NAME, joined

_NEW = "# Poses of the {}. A pose can replace joint values in any task.\nposes: {{}}\n"


class PoseExists(FileError):
    """A pose of that name exists, and `replace` was not set."""


def save_pose(
    robot: Robot,
    folder: Path,
    name: str,
    positions: Mapping[str, float],
    replace: bool = False,
) -> Path:
    """Save a pose to the poses file of a robot, in the subfolder of its name.

    If another file of the user has a pose of that name, the pose is saved to that file.

    Args:
        robot: The robot.
        folder: Folder of the user's files. It is created if it does not exist.
        name: Name of the pose.
        positions: Joint positions by joint name [rad], [m].
        replace: True to replace a pose of that name. The shipped file is not changed: the
            key `replaces` of the file of the user then names the pose.

    Returns:
        The file.

    Raises:
        PoseExists: The name is in use.
        FileError: The name is invalid, or a file of poses is wrong or cannot be written.
    """
    shipped, files = _poses(robot, folder)
    file = next((file for file in files if name in file.poses), None)
    path = file.path if file else folder / robot.name / POSES
    units = {unit for names in UNITS.values() for unit in names}
    if not NAME.fullmatch(name) or name in units or name in {each.name for each in robot.joints}:
        rule = "use a letter, then letters, digits, _ or -, and no name of a joint or a unit"
        why = f"{name!r} cannot be the name of a pose; {rule}"
        raise FileError.at(path, why + did_you_mean(joined(name) if name != joined(name) else ""))
    if not replace and file:
        why = f"has a pose {name} already; give --replace, or another name"
        raise PoseExists.at(path, why)
    if not replace and name in shipped:
        why = f"pose {name} is shipped; give another name, or --replace to use your pose"
        raise PoseExists.at(path, why)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError.at(path.parent, f"cannot be created: {error.strerror}") from error
    file = next((file for file in files if file.path == path), None)
    text, replaced = (file.text, {*file.replaces}) if file else (_NEW.format(robot.name), set())
    new = _with_pose(text, name, pose_text(robot, positions))
    if name in shipped - replaced:
        new = _with_replaces(new, sorted({*replaced, name}))
    _rewrite(path, text, new, name)
    return path


def create_poses(
    robot: Robot, folder: Path, poses: Mapping[str, Mapping[str, float]], comment: str
) -> Path | None:
    """Create the poses file of a robot that has none.

    Args:
        robot: The robot. No shipped robot has its name, so there are no other poses.
        folder: Folder of the user's files. It is created if it does not exist.
        poses: Joint positions by joint name [rad], [m], by the name of the pose.
        comment: Text of the comment at the top of the file.

    Returns:
        The file; None if it exists already.

    Raises:
        FileError: The file cannot be written.
    """
    path = folder / robot.name / POSES
    if path.exists():
        return None
    lines = [f"# Poses of the {robot.name}. A pose can replace joint values in any task."]
    lines += [*(f"# {line}" for line in comment.splitlines()), "poses:"]
    lines += [f"  {name}: {pose_text(robot, positions)}" for name, positions in poses.items()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, ("\n".join(lines) + "\n").encode())
    except OSError as error:
        raise FileError.at(path, f"cannot be written: {error.strerror}") from error
    return path


def remove_pose(robot: Robot, folder: Path, name: str) -> Path:
    """Remove a pose from a poses file of the user. Return the path of the file.

    Args:
        robot: The robot.
        folder: Folder of the user's files.
        name: Name of the pose.

    Raises:
        FileError: No file of the user has the pose, or the file is wrong or cannot be written.
    """
    shipped, files = _poses(robot, folder)
    file = next((file for file in files if name in file.poses), None)
    if file is None:
        if name in shipped:
            why = f"pose {name} is shipped and cannot be removed; `armtree pose save` replaces it"
            raise FileError.at(folder, why)
        own = [each for file in files for each in file.poses]
        raise PoseUnknown.at(folder, f"no pose {name} is here; {there_are(name, own)}")
    new = _without_pose(file.text, name)
    if name in file.replaces:
        new = _with_replaces(new, [each for each in file.replaces if each != name])
    _rewrite(file.path, file.text, new, name)
    return file.path


def _poses(robot: Robot, folder: Path) -> tuple[set[str], list[PosesFile]]:
    """Return the names of the shipped poses, and the files of the user.

    Raises:
        FileError: A file has mistakes.
    """
    shipped = shipped_folders(robot.name)
    folders = dict.fromkeys([*shipped, *with_robot(folder, robot.name)])
    files, mistakes = read_poses(pose_paths(folders, robot.name))
    if mistakes:
        raise FileError(mistakes)
    own = [file for file in files if file.path.parent not in shipped]
    return {name for file in files if file not in own for name in file.poses}, own


def pose_text(robot: Robot, positions: Mapping[str, float]) -> str:
    """Return joint positions [rad], [m] as text for a file."""
    joints = (joint for joint in robot.actuated if joint.name in positions)
    values = ", ".join(f"{each.name}: {_written(each, positions[each.name])}" for each in joints)
    return f"{{{values}}}"


def _written(joint: Joint, q: float) -> str:
    """Return a position, rounded to 0.01 deg or mm unless that would exceed a limit."""
    scale, unit = DISPLAY_UNITS[joint.unit]
    near = round(scale * q, 2) / scale
    if not joint.lower <= near <= joint.upper:
        return repr(q)
    return f"{scale * near:z.7g} {unit}"


def _rewrite(path: Path, text: str, new: str, name: str) -> None:
    """Change one pose in a file of poses.

    Raises:
        FileError: Another pose would also change, or the file cannot be written.
    """
    before, _ = draft_poses(path, text)
    try:
        after, mistakes = draft_poses(path, new)
    except FileError:
        after, mistakes = before, [Mistake(Place(path), "")]
    others = [{n: p for n, p in each.poses.items() if n != name} for each in (before, after)]
    if mistakes or others[0] != others[1]:
        raise FileError.at(path, f"pose {name} cannot be changed alone; edit the file by hand")
    try:
        write_file(path, new.encode())
    except OSError as error:
        raise FileError.at(
            path, f"cannot be written: {error.strerror}; nothing has changed"
        ) from error


def _with_pose(text: str, name: str, value: str) -> str:
    """Return the text of a file with a pose. A new pose follows the last pose."""
    label, poses = _pair(text, "poses")
    assert isinstance(poses, CollectionNode)  # the draft has no mistakes
    for key, old in poses.value:
        if key.value == name:
            return _spliced(text, key.end_mark.index, _end(old), f": {value}")
    if not poses.value:
        return _spliced(text, label.end_mark.index, _end(poses), f":\n  {name}: {value}")
    if poses.flow_style:
        return _spliced(text, _end(poses) - 1, _end(poses) - 1, f", {name}: {value}")
    first, last = poses.value[0][0], poses.value[-1][1]
    at = _line_end(text, _end(last))
    return _spliced(text, at, at, f"\n{' ' * first.start_mark.column}{name}: {value}")


def _without_pose(text: str, name: str) -> str:
    """Return the text of a file without a pose. The comments around it stay."""
    label, poses = _pair(text, "poses")
    assert isinstance(poses, CollectionNode)  # the draft has no mistakes
    names = [key.value for key, _ in poses.value]
    if names == [name]:
        return _spliced(text, label.end_mark.index, _end(poses), ": {}")
    number = names.index(name)
    key, value = poses.value[number]
    if not poses.flow_style:
        return _without_lines(text, key, value)
    if number:
        return _spliced(text, _end(poses.value[number - 1][1]), _end(value), "")
    return _spliced(text, key.start_mark.index, poses.value[1][0].start_mark.index, "")


def _with_replaces(text: str, names: Collection[str]) -> str:
    """Return the text of a file with these names in `replaces`."""
    key, value = _pair(text, "replaces")
    listed = f"[{', '.join(names)}]"
    if key is value:
        return f"{text.rstrip()}\nreplaces: {listed}\n"
    if not names:
        return _without_lines(text, key, value)
    return _spliced(text, key.end_mark.index, _end(value), f": {listed}")


def _without_lines(text: str, key: Node, value: Node) -> str:
    begin = text.rfind("\n", 0, key.start_mark.index) + 1
    return _spliced(text, begin, _line_end(text, _end(value)) + 1, "")


def _pair(text: str, name: str) -> tuple[Node, Node]:
    """Return the nodes of a top-level key and its value; without this key, the document twice."""
    root = YAML(typ="safe", pure=True).compose(io.StringIO(text))
    return next((pair for pair in root.value if pair[0].value == name), (root, root))


def _end(node: Node) -> int:
    """Return the index of the end of a node, without the comments after it."""
    if not isinstance(node, CollectionNode) or node.flow_style or not node.value:
        return int(node.end_mark.index)
    last = node.value[-1]
    return _end(last[1] if isinstance(last, tuple) else last)


def _line_end(text: str, at: int) -> int:
    end = text.find("\n", at)
    return len(text) if end < 0 else end


def _spliced(text: str, begin: int, end: int, new: str) -> str:
    return text[:begin] + new + text[end:]
