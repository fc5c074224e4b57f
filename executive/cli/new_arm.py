"""`armtree robots` and `armtree new-arm`."""

import json
import shlex
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hardware.spelling import choices

from .settings import PATH, find_setting
from .support.command_group import command
from .support.failures import Refusal
from .support.names import first_motion
from .support.options import own_trees_option
from .terminal.keyboard import ask
from .terminal.streams import echo

if TYPE_CHECKING:
    from hardware import Robot
    from skills.motion.collision.allowed_pairs import AllowedPairs

_SWAP = """\
`open` and `closed` are guessed: closed is the limit nearer to 0. If `armtree move open` closes the
gripper, swap the two names."""


@command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per robot.")
def robots(as_json: bool) -> None:
    """List the shipped robots, for --robot, and the firmware for an Arduino."""
    from hardware import load_robot, shipped_robots
    from hardware.drivers.arduino.firmware_profile import HEX_FILE
    from trees import Library

    for name, path in shipped_robots().items():
        robot = load_robot(path)
        lists = {**robot.groups, "tasks": tuple(Library(robot=robot.name).names())}
        if as_json:
            echo(json.dumps({"robot": name, **lists, "file": str(path)}))
            continue
        lines = [*(f"{what}: {', '.join(names)}" for what, names in lists.items()), str(path)]
        for line in lines:
            echo(f"{name if line is lines[0] else '':<12} {line}")
    if not as_json:
        echo(f"\nFirmware for an Uno or a Nano: {HEX_FILE}", whole=True)


@command("new-arm")
@click.argument("urdf", type=PATH)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    type=PATH,
    help="Robot file to write. Default: NAME.toml in the working directory, for NAME.urdf.",
)
@click.option(
    "--tool",
    metavar="LINK",
    help="Link of the tool. Default: a guess, which you confirm at a terminal.",
)
@click.option(
    "--gripper",
    metavar="JOINT,...",
    help="Joints of the gripper, or `none`. Default: guessed from the URDF.",
)
@own_trees_option
def new_arm(
    urdf: Path, output: Path | None, tool: str | None, gripper: str | None, trees: Path
) -> None:
    """Make a robot file for an arm from its URDF.

    The limits of joints are those of the URDF. Arm, gripper and tool are guessed. In 10,000 random
    configurations, armtree finds the pairs of links that touch by design or never touch; it does
    not check these pairs later. It saves the poses `open` and `closed` of the gripper. The new arm
    can move on the port virtual at once. Comments in the robot file explain what to add for a real
    board.

    \b
    Example:
      armtree new-arm so101.urdf
    """  # noqa: D301
    from hardware import load_robot, shipped_robots, write_file
    from hardware.description.new_robot import (
        UrdfUnusable,
        draft_robot,
        guess_gripper_poses,
        robot_text,
    )
    from skills.motion.collision.allowed_pairs import find_allowed_pairs
    from skills.motion.validation import MAX_MAGNITUDE
    from trees.writing.saved_poses import create_poses

    output, wrong = output or Path(f"{urdf.stem}.toml"), ""
    if output.exists():
        wrong = f"{output} exists; delete it, or give another file with -o"
    elif not output.absolute().parent.is_dir():
        wrong = f"there is no folder {output.parent}; create it, or give another file with -o"
    joints = None if gripper is None else tuple(gripper.split(",")) if gripper != "none" else ()
    try:
        robot = draft_robot(urdf, MAX_MAGNITUDE, joints, tool)
    except UrdfUnusable as error:
        if wrong:
            raise Refusal(f"{wrong}\n{error}") from error
        raise
    if wrong:
        raise Refusal(wrong)
    assert robot.tool
    if tool is None and sys.stdin.isatty():
        robot = replace(robot, tool=replace(robot.tool, link=_ask_link(robot, robot.tool.link)))
    taken = output.stem in shipped_robots()  # a shipped robot's tasks are for other joints
    robot = replace(robot, name=f"my_{output.stem}" if taken else output.stem)
    echo("Loading the shapes, and checking 10,000 configurations ...", err=True)
    guesses = guess_gripper_poses(robot)
    allowed = find_allowed_pairs(robot, guesses)
    boots = robot.by_joint(allowed.boot)
    moved = [replace(joint, boot=boots.get(joint.name, joint.boot)) for joint in robot.joints]
    robot = replace(robot, joints=tuple(moved))
    write_file(output, robot_text(robot, output.parent, allowed.reasons).encode())
    robot = load_robot(output)
    saved = create_poses(robot, trees, allowed.poses, _SWAP) if allowed.poses else None
    for line in _report(robot, allowed, saved):
        echo(line)
    for line in _warnings(robot, allowed, guesses):
        echo(f"warning: {line}", err=True)
    words, saves = ["armtree", *first_motion(robot)], ""
    chosen = find_setting(click.get_current_context(), "robot")[0]
    if not (chosen and chosen.exists() and chosen.samefile(output)):
        words += ["--robot", str(output)]
        line = f"robot = {json.dumps(str(output))}"
        saves = f"With the line `{line}` in armtree.toml, --robot is not needed.\n"
    echo(f"\n{saves}Next, type: {shlex.join(words)}", whole=True)


def _ask_link(robot: "Robot", guess: str) -> str:
    """Ask for the link of the tool until the robot has the link. An empty text means the guess."""
    while (link := ask(f"Link of the tool [{guess}]:") or guess) not in robot.links:
        echo(f"there is no link {link}; there are {choices(link, robot.links)}")
    return link


def _report(robot: "Robot", allowed: "AllowedPairs", saved: Path | None) -> list[str]:
    """Return lines about the guesses and results."""
    from hardware.description.neighbours import shape_warnings

    reasons, nearest = Counter(allowed.reasons.values()), allowed.nearest
    counts = ", ".join(f"{count} {reason}" for reason, count in reasons.items())
    unchecked = f"not checked: {counts}" if counts else "all are checked"
    away = [f"{joint.name} {joint.words(joint.boot, 4)}" for joint in robot.actuated if joint.boot]
    others = ["others 0"] * (len(away) < len(robot.actuated))
    pose = ", ".join([*away, *others]) if away else "all joints at 0"
    poses = ", ".join(f"{name} {robot.words(each)}" for name, each in allowed.poses.items())
    free = "no links are checked"
    if nearest:
        free = f"nearest links: {nearest.first} and {nearest.second}, "
        free += f"{1e3 * nearest.distance:.0f} mm apart"
    lines = {
        "arm": ", ".join(robot.groups["arm"]),
        "gripper": ", ".join(robot.groups["gripper"]) or "none",
        "tool": robot.tool.link if robot.tool else "",
        "poses": f"{poses}, in {saved}" if saved else "none saved",
        robot.firmware.words.start_pose: f"{pose}; {free}",
        "pairs": f"{allowed.count} of links; {unchecked}" if allowed.count else "none",
    }
    return [
        f"{robot.path}: a robot file for {robot.name}",
        *(f"  {name:<11}{value}" for name, value in lines.items()),
        *(f"  {'shapes':<11}{why}" for why in shape_warnings(robot)),
    ]


def _warnings(
    robot: "Robot", allowed: "AllowedPairs", guesses: Mapping[str, Mapping[str, float]]
) -> Iterator[str]:
    """Yield a warning for pairs of links that are not checked, and for each changed pose."""
    off = [pair for pair, reason in allowed.reasons.items() if reason == "default"]
    if off:
        pairs = ", ".join(" and ".join(pair) for pair in off)
        why = f"{pairs} collide in the start pose, and no free pose was found"
        yield f"{why}. Collisions between them are not checked; correct the shapes or `boot`"
    for name, guess in guesses.items():
        if (free := allowed.poses[name]) != guess:
            why = f"pose {name}: at {robot.words(guess)} the gripper collides in the start pose"
            yield f"{why}; saved {robot.words(free)}, the nearest free position"
