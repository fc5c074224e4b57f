"""Makes a task from a move: its words become the text of a subtree file."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from executive.api.move import HOME, LEADER, Move
from hardware import Robot
from logs import MOVE
from skills import BadTarget, Positions, combine_errors, joint_errors, tool_target_errors
from skills.motion.query import MIN_SPEED
from trees.reading.grammar import Draft, draft_subtree

from .goal_words import Poses, Words, read_words

FILE = Path("move.yaml")  # name of the file in the recording of a move

_EXAMPLE = "`armtree move joint_1=70deg`"


def read_move(move: Move, robot: Robot, poses: Poses) -> Words:
    """Read the words of a move.

    Args:
        move: The move.
        robot: Description of the robot.
        poses: Poses of the library.

    Raises:
        BadTarget: The words cannot be read, they name no target, or a point is much too far away.
        OutOfBounds: A target is outside the limits.
    """
    if not MIN_SPEED <= move.speed <= 1.0:  # NaN fails this comparison
        why = f"speed {move.speed:g} is not between {MIN_SPEED:g} and 1"
        raise BadTarget(f"{why}; it is a share of the limits of the robot file")
    if not move.words:
        raise BadTarget(f"a move needs a target, such as {_EXAMPLE}, a pose, or x y z")
    if move.words == (LEADER,) and LEADER not in poses:
        return Words({}, {})
    known = poses_with_home(robot, poses)
    words = _changes(move.words, known) if move.relative else move.words
    read = read_words(words, robot, known)
    errors = joint_errors(robot, Positions(read.joints))
    if read.turn:
        errors += tool_target_errors(robot, {"turn": read.turn})
    if errors:
        raise combine_errors(errors)
    return read


def move_text(move: Move, read: Words) -> str:
    """Return a move as the text of a subtree file.

    Args:
        move: The move.
        read: The result of `read_move`.
    """
    tree = _tree(read, move.relative, move.speed)
    description = f"{'by ' * move.relative}{' '.join(move.words)}"
    head = {"subtree": FILE.stem, "description": f"move {description}", "ports": {}}
    lines = [f"{key}: {json.dumps(value)}" for key, value in head.items()]
    return "\n".join([*lines, f"tree: {json.dumps(tree)}\n"])


def draft_move(text: str) -> Draft:
    """Return the task of a text from `move_text`.

    Raises:
        FileError: The text is not YAML.
    """
    subtree, mistakes = draft_subtree(FILE, text)
    return replace(subtree, number=MOVE), mistakes


def poses_with_home(robot: Robot, poses: Poses) -> Mapping[str, Mapping[str, float]]:
    """Return the poses with the pose `home`, if none of them has that name.

    The pose is the home in the robot file, or else the start pose.

    Raises:
        BadTarget: The robot file names poses that do not exist.
    """
    if HOME in poses:
        return poses
    if not robot.home:
        return {**poses, HOME: robot.by_joint(robot.boot_pose)}
    try:
        joints = read_words(robot.home, robot, poses).joints
    except BadTarget as error:
        error.args = (f"{robot.path}: home: {error}",)
        raise
    if not joints:
        raise BadTarget(f"{robot.path}: home names no position; give poses or JOINT=VALUE")
    return {**poses, HOME: joints}


def _changes(words: tuple[str, ...], poses: Poses) -> tuple[str, ...]:
    """Return words as changes of joints. The words x y z stay unchanged."""
    if wrong := next((word for word in words if word in poses), None):
        raise BadTarget(f"{wrong} is a pose, not a change; give JOINT=CHANGE or x y z")
    changed = (word.replace("=", "+=", 1) if "+=" not in word else word for word in words)
    return tuple(changed)


def _tree(read: Words, relative: bool, speed: float) -> dict[str, object]:
    """Return the tree of a move. If `read` has no target, the arm follows the leader."""
    ports: dict[str, object] = {}
    if read == Words({}, {}):
        subtree = "follow_leader"
    elif read.point is not None:
        subtree, ports = "move_tool", {"point": list(read.point), "relative": relative}
    elif read.turn is not None:
        subtree = "move_tool"
        ports = {"point": [0.0, 0.0, 0.0], "relative": True, "turn": list(read.turn)}
    elif not read.changes:
        subtree, ports = "move_joints", {"joints": dict(read.joints)}
    elif not read.joints:
        subtree, ports = "move_relative", {"by": dict(read.changes)}
    else:
        ports = {"joints": dict(read.joints), "by": dict(read.changes)}
        subtree = "move_mixed"
    return {"subtree": subtree, "with": {**ports, "speed": speed}}
