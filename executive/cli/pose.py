"""`armtree pose`: save, list, show and remove poses."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .move import check_arm, find_arm
from .settings import option
from .support.command_group import CommandGroup
from .support.names import complete_own_pose, complete_pose, load_library
from .support.options import own_trees_option, recordings_option, robot_option, trees_option
from .terminal.streams import echo

if TYPE_CHECKING:
    from hardware import Robot

_name = click.argument("name", shell_complete=complete_pose)


@click.group(cls=CommandGroup)
def pose() -> None:
    """Save, list, show and remove poses.

    Your poses are in the file poses.yaml, in the subfolder of your tasks that has the name of the
    robot. Tasks, `armtree move` and `armtree plan` take the names of poses.
    """


@pose.command()
@_name
@click.option(
    "--group",
    metavar="GROUP",
    default="arm",
    show_default=True,
    help="Joints to save: a group of the robot, or `all`.",
)
@click.option("--replace", is_flag=True, help="Replace an earlier pose with this name.")
@option("server")
@robot_option
@recordings_option
@own_trees_option
def save(
    name: str,
    group: str,
    replace: bool,
    server: str | None,
    robot: Path | None,
    recordings: Path,
    trees: Path,
) -> None:
    """Save the commanded pose of the arm, as `armtree where` shows it.

    A shipped pose never changes. With --replace, your own pose of the same name is used instead.

    \b
    Examples:
      armtree pose save left
      armtree pose save half_open --group gripper
    """  # noqa: D301
    from executive.goals.moves.poses import save_where
    from hardware import load_robot
    from skills import BadTarget

    loaded = load_robot(robot)
    found, source = find_arm(server, robot, recordings)
    check_arm(loaded, found)
    try:
        path, positions = save_where(loaded, found, trees, name, group, replace)
    except BadTarget as error:
        raise click.UsageError(f"--group: {error}") from error
    echo(path, f"{name:<12} {_words(loaded, positions)}", f"{'':<12} by {source}")
    if left := [joint.name for joint in loaded.actuated if joint.name not in positions]:
        echo(f"{'':<12} without {', '.join(left)}; --group all saves every joint")


@pose.command()
@robot_option
@trees_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per pose.")
def ls(robot: Path | None, trees: Path | None, as_json: bool) -> None:
    """List the poses with their joint positions, and the file and line of each, or `shipped`."""
    from executive.goals.moves.poses import listed_poses

    loaded, library = load_library(trees, robot)
    for name, positions, source in listed_poses(loaded, library):
        if as_json:
            echo(json.dumps({"pose": name, "positions": positions, "source": source}))
        else:
            echo(f"{name:<12} {_words(loaded, positions)}", f"{'':<12} {source}")


@pose.command()
@_name
@robot_option
@trees_option
@click.option("--json", "as_json", is_flag=True, help="Print a JSON object.")
def show(name: str, robot: Path | None, trees: Path | None, as_json: bool) -> None:
    """Print the joint positions of a pose, the point of the tool, and the file of the pose."""
    from executive.goals.moves.poses import listed_poses
    from hardware.spelling import there_are
    from trees.errors import PoseUnknown

    loaded, library = load_library(trees, robot)
    poses = {each: (positions, source) for each, positions, source in listed_poses(loaded, library)}
    if name not in poses:
        folder = trees or library.shipped[-1]
        why = f"there is no pose {name}; {there_are(name, poses)}"
        raise PoseUnknown.at(folder, why)
    positions, source = poses[name]
    moves_tool = all(joint.name in positions for joint in loaded.actuated_in("arm"))
    boot = loaded.by_joint(loaded.boot_pose)
    tool = loaded.tool_position(boot | dict(positions)) if moves_tool else None
    if as_json:
        row = {"pose": name, "positions": positions, "tool": tool, "source": source}
        echo(json.dumps(row))
        return
    for joint in positions:
        echo(f"{joint:<12} {_words(loaded, {joint: positions[joint]}).partition(' ')[2]}")
    if tool:
        echo(f"{'tool':<12} {', '.join(f'{1e3 * value:z.1f}' for value in tool)} mm")
    echo(f"{'from':<12} {source}")


@pose.command()
@click.argument("name", shell_complete=complete_own_pose)
@robot_option
@own_trees_option
def rm(name: str, robot: Path | None, trees: Path) -> None:
    """Remove a pose from your poses.yaml. Shipped poses stay."""
    from hardware import load_robot
    from trees.writing.saved_poses import remove_pose

    path = remove_pose(load_robot(robot), trees, name)
    echo(f"{path}: pose {name} is removed; `armtree check` finds tasks that used it")


def _words(robot: "Robot", positions: Mapping[str, float]) -> str:
    """Return positions in words, with a note for joints that this robot does not have."""
    known = {joint.name: joint for joint in robot.joints}
    return ", ".join(
        f"{name} {known[name].words(q, 4)}"
        if name in known
        else f"{name}, which {robot.name} does not have"
        for name, q in positions.items()
    )
