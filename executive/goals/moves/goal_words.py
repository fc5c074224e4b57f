"""The words of a goal for `armtree move` and `armtree plan`: joints, poses, a point."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise
from typing import Any

from hardware import BadPosition, Robot
from hardware.description.gripper import WIDTH
from hardware.description.robot import TURNS
from hardware.loading.dataclass import dataclass
from hardware.printable import plural
from hardware.spelling import did_you_mean, there_are
from skills import (
    TOOL_PORTS,
    BadTarget,
    OutOfBounds,
    Positions,
    SkillError,
    distance_errors,
    joint_errors,
    refuse,
    tool_target_errors,
)
from trees import (
    UNITS,
    Declaration,
    FileError,
    Place,
    fit,
    in_radians,
    in_smaller_units,
    is_bare,
    near_limit,
    parse_value,
)
from trees.compile.port_types import declaration

_ANGLE, _LENGTH = Declaration("angle"), Declaration("length")

Poses = Mapping[str, Mapping[str, float]]

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?[a-z]*", re.IGNORECASE)
_VALUE = re.compile(rf"(\+?=)?({_NUMBER.pattern})", re.IGNORECASE)

TASK = "the number or name of a task"  # what the words of a goal may be, too


@dataclass(frozen=True, slots=True)
class Words:
    """The meaning of the words of a goal.

    Attributes:
        joints: Positions by joint [rad].
        changes: Changes from the start by joint [rad], for joints that are not in `joints`.
        point: x, y, z of the tool [m]; None if the words give no point.
        turn: Roll, pitch and yaw of the tool from the start [rad]; None if the words give none.
    """

    joints: Mapping[str, float]
    changes: Mapping[str, float]
    point: tuple[float, float, float] | None = None
    turn: tuple[float, float, float] | None = None


def is_point(words: Sequence[str], poses: Poses) -> bool:
    """Return True if the words are x, y, z."""
    return len(words) == 3 and not any("=" in word or word in poses for word in words)


def read_words(
    words: Sequence[str], robot: Robot, poses: Poses, also: Sequence[str] = (), quoted: bool = False
) -> Words:
    """Read the words of a goal.

    Args:
        words: Either x, y, z; or changes of `TURNS`, such as `pitch+=5deg`; or `JOINT=VALUE`,
            `JOINT+=CHANGE` and names of poses, applied in order, each joint at most once;
            `width=VALUE` is the width of the gripper. Values are written as in task files.
        robot: Description of the robot.
        poses: The poses.
        also: What else the words may be, for messages, such as `TASK`.
        quoted: True if the words are the value of an option, which is in quotes.

    Raises:
        BadTarget: The words cannot be read.
        OutOfBounds: A change is larger than the range of its joint, or the gripper cannot reach the
            width. Or a number without a unit is out of bounds, although it would be valid in
            degrees or mm.
    """
    units = {joint.name: joint.unit for joint in robot.actuated}
    _check_spelling(words, robot, quoted)
    _check_poses([word for word in words if word in poses], poses)
    if of_tool := _read_tool_words(words, robot, units, poses):
        return of_tool
    joints, changes, given = dict[str, float](), dict[str, float](), dict[str, str]()
    for word in words:
        name, equals, text = word.partition("=")
        joint = name.removesuffix("+")
        if not equals:
            if word not in poses:
                offers = [*([f"{WIDTH}=20mm"] if robot.gripper else []), "x y z of the tool", *also]
                raise BadTarget(_no_pose(word, words, poses, offers, quoted))
            _check_names(poses[word], robot, (), poses)
            joints |= poses[word]
            continue
        if joint == WIDTH and WIDTH not in units:
            if joint != name:
                why = f"{WIDTH} cannot be changed by a distance"
                raise BadTarget(f"{why}; give the whole width, such as {WIDTH}=20mm")
            joints |= _at_width(robot, text)
            continue
        _check_names((joint,), robot, words, poses)
        if joint in given:
            total = ", with the sum of its changes" if given[joint] == name != joint else ""
            raise BadTarget(f"{joint} is given twice; give it once{total}")
        given[joint] = name
        errors = joint_errors if joint == name else distance_errors
        value = _joint_value(robot, joint, text, errors)
        if joint == name:
            joints[joint] = value
            continue
        refuse(distance_errors(robot, {joint: value}))
        if joint in joints:
            joints[joint] += value
        else:
            changes[joint] = value
    return Words(joints, {name: by for name, by in changes.items() if name not in joints})


def _read_tool_words(
    words: Sequence[str], robot: Robot, units: Mapping[str, str], poses: Poses
) -> Words | None:
    """Return the meaning of words about the tool; None if the words are about joints."""
    if is_point(words, poses):
        return Words({}, {}, _read_point(words, robot))
    if any("=" in word and _name(word) in TURNS and _name(word) not in units for word in words):
        return Words({}, {}, turn=_read_turn(words, poses))
    return None


def _read_point(words: Sequence[str], robot: Robot) -> tuple[float, float, float]:
    """Return x, y, z.

    Suggest a smaller unit for each number that is too large for metres: cm if another number fits
    metres and the arm reaches that far, otherwise mm.
    """

    def read(words: Sequence[str]) -> tuple[float, float, float]:
        text = f"[{', '.join(words)}]"
        x, y, z = read_value("point", text, declaration(TOOL_PORTS["point"]))
        refuse(tool_target_errors(robot, {"point": [x, y, z]}))
        return x, y, z

    try:
        return read(words)
    except BadTarget as error:
        plain = [word for word in words if _plain(word)]
        large = [word for word in plain if _error(read, (word, "0", "0"))]
        if large:
            near_in_cm = max(abs(float(word)) for word in large) / 100 <= robot.reach
            unit = "cm" if near_in_cm and large != plain else "mm"
            near = [f"{word}{unit}" if word in large else word for word in words]
            if not _error(read, near):
                error.args = (f"{error}{did_you_mean(' '.join(near))}",)
        raise


def _plain(word: str) -> bool:
    """Return True if a word is a number other than 0, without a unit."""
    return _NUMBER.fullmatch(word) is not None and not word[-1].isalpha() and float(word) != 0.0


def _name(word: str) -> str:
    """Return the part of a word before its = or +=."""
    return word.partition("=")[0].removesuffix("+")


def _read_turn(words: Sequence[str], poses: Poses) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of words such as `pitch+=5deg`."""
    angles = dict[str, float]()
    for word in words:
        name, (before, _, text) = _name(word), word.partition("=")
        if name not in TURNS or word in poses:
            turns = ", ".join(TURNS)
            raise BadTarget(f"{word!r} cannot be combined with {turns}; make two moves")
        if before == name:
            why = f"{name} is a change of the tool's orientation"
            raise BadTarget(f"{why}; write {name}+={text or '5deg'}")
        if name in angles:
            raise BadTarget(f"{name} is given twice; give it once, with the sum of its changes")
        angles[name] = read_value(name, text, _ANGLE)
    roll, pitch, yaw = (angles.get(name, 0.0) for name in TURNS)
    return roll, pitch, yaw


def _joint_value(
    robot: Robot, joint: str, text: str, errors: Callable[[Robot, Positions], list[SkillError]]
) -> float:
    """Return a position or a change of a joint."""
    unit = robot.joint(joint).unit
    value: float = read_value(joint, text, _LENGTH if unit == "m" else _ANGLE)
    _ask_unit(lambda q: refuse(errors(robot, Positions({joint: q}))), joint, unit, text, value)
    return value


def _at_width(robot: Robot, text: str) -> Mapping[str, float]:
    """Return the position of the gripper's joint from its width."""
    if robot.gripper is None:
        why = "the width of the gripper is unknown, because the robot file does not name its pads"
        add = f"add `pads` to [gripper] in {robot.path}"
        raise BadTarget(f"{why}; {add}, or give a pose or JOINT=VALUE")
    width = read_value(WIDTH, text, _LENGTH)
    try:
        _ask_unit(robot.at_width, WIDTH, "m", text, width)
        return robot.at_width(width)
    except BadPosition as error:
        raise OutOfBounds([error]) from error


def _ask_unit(
    check: Callable[[float], object], name: str, unit: str, text: str, value: float
) -> None:
    """Suggest a smaller unit, or the limit, for a number without a unit."""
    if not (error := _error(check, value)):
        return
    written, limit = parse_value(text, name), getattr(error, "limit", None)
    for near, factor in in_smaller_units(written.value, unit):
        if not _error(check, value * factor):
            error.args = (f"{error}{did_you_mean(near)}",)
            raise error
    if limit is None or not is_bare(written.value):
        return
    for near, position in near_limit(written, limit, unit):
        if not _error(check, position):
            error.args = (in_radians(str(error), written, unit, limit, near),)
            raise error


def _error(check: Callable[[Any], object], value: object) -> Exception | None:
    try:
        check(value)
    except (SkillError, BadPosition) as error:
        return error
    return None


def read_value(name: str, text: str, wanted: Declaration) -> Any:
    """Return the value of a text in the form of a task file.

    Args:
        name: Name of the value, for messages.
        text: The value.
        wanted: Its type.

    Raises:
        BadTarget: The text is not such a value.
    """
    if not text:
        raise BadTarget(f"{name} has no value")

    def wrong(place: Place, why: str, _: object = None) -> None:
        raise BadTarget(f"{name}: {why}")

    try:
        return fit(parse_value(text, name), wanted, {}, wrong)
    except FileError as error:
        raise BadTarget(f"{name}: {error.mistakes[0].message}") from error


def _check_spelling(words: Sequence[str], robot: Robot, quoted: bool) -> None:
    """Check that each word is NAME=VALUE or NAME+=VALUE without spaces, commas and brackets.

    Args:
        words: The words.
        robot: Description of the robot.
        quoted: True if the words are already in quotes.

    Raises:
        BadTarget: A word is written in another way. The message has the right spelling.
    """
    written = " ".join(words)
    text = written if "=" in written else re.sub("[][(){}]", "", written)
    if "," in written or text != written:
        decimals = all(re.search(r"\d,\d", word) for word in words)
        right = text.replace(",", ".") if decimals and len(words) > 1 else text.replace(",", " ")
        odd = "commas" if text == written else "brackets"
        raise BadTarget(f"{written!r} contains {odd}; write {' '.join(right.split())}")
    joints = [joint.name for joint in robot.actuated]
    for number, word in enumerate(words):
        named, _, rest = re.sub("[: ]+", "=", word).partition("=")
        if "=" not in word and named in {*joints, WIDTH}:
            raise BadTarget(_with_sign(word, named, rest, words[number + 1 :], robot))
        name, equals, value = word.partition("=")
        sign = "+=" if name.endswith("+") else "="
        name = name.removesuffix("+")
        if equals and not name.strip():
            raise BadTarget(f"{word!r} names no joint; write one word, such as {joints[0]}=0.5")
        if equals and name != name.strip():
            right = f"{name.strip()}{sign}{''.join(value.split())}"
            raise BadTarget(f"{word!r} contains spaces; write {right}")
    for before, word in pairwise(words):
        if any(word in units for units in UNITS.values()):
            why = f"{word!r} is separated from its number; write {before}{word} as one word"
            raise BadTarget(why if quoted else f"{why}, or both in quotes")


def _with_sign(word: str, name: str, value: str, following: Sequence[str], robot: Robot) -> str:
    """Return the message for a word without =. The message has the right spelling.

    Args:
        word: The word.
        name: Name of its joint, or `WIDTH`.
        value: Its value; empty if the word has none.
        following: The words after this word.
        robot: Description of the robot.
    """
    first, second, *_ = [*following, "", ""]
    found = _VALUE.fullmatch(first + second if first in ("=", "+=") else first)
    if found and not value:
        sign = found[1] or "="
        right = f"{name}{sign}{_with_unit(robot, name, sign, found[2])}"
        return f"{word!r} is separated from its value; write {right}"
    units = {joint.name: joint.unit for joint in robot.actuated}
    example = "20deg" if units.get(name) == "rad" else "20mm"
    if value:
        example = _with_unit(robot, name, "=", "".join(value.split()))
    return f"{word!r} has no =; write {name}={example}"


def _with_unit(robot: Robot, name: str, sign: str, text: str) -> str:
    """Return a value of a joint. If it is only valid in a smaller unit, add that unit."""
    if name == WIDTH:
        return text
    errors = distance_errors if sign == "+=" else joint_errors

    def check(q: float) -> None:
        refuse(errors(robot, Positions({name: q})))

    number = parse_value(text, name).value
    if isinstance(number, int | float) and _error(check, number):
        for near, factor in in_smaller_units(number, robot.joint(name).unit):
            if not _error(check, number * factor):
                return near.replace(" ", "")
    return text


def _check_poses(names: Sequence[str], poses: Poses) -> None:
    """Check that no two poses move a joint to different positions."""
    given = dict[str, str]()  # pose by joint
    for name in names:
        for joint, position in poses[name].items():
            earlier = given.setdefault(joint, name)
            if poses[earlier][joint] != position:
                why = f"{earlier} and {name} move {joint} to different positions"
                raise BadTarget(f"{why}; give one of them, or make two moves")


def _no_pose(
    word: str, words: Sequence[str], poses: Poses, offers: Sequence[str], quoted: bool
) -> str:
    """Return the message for a word that is not a pose."""
    if TASK in offers and word.isdecimal():
        why = f"{word!r} is the number of a task, which must be the only word"
        return f"{why}; plan one task at a time, or give x y z of the tool"
    if _NUMBER.fullmatch(word):
        numbers = [each for each in words if _NUMBER.fullmatch(each)]
        given = " ".join(numbers)
        if len(numbers) == 3:
            return f"{given} is a point for the tool; leave out the other words"
        point = f"x y z, such as 0.1 0.1 8cm{' in quotes' * quoted}"
        why = f"{given} has {plural(len(numbers), 'number')}; the point for the tool has three"
        moves = " or ".join(["JOINT=VALUE", *(each for each in offers if each.startswith(WIDTH))])
        return f"{why}, {point}. Or name what moves: {moves}"
    if (rest := [each for each in words if each != word]) and {*rest} <= poses.keys():
        return f"{word!r} is not a pose; leave it out: {' '.join(rest)}"
    others = ["JOINT=VALUE", "JOINT+=CHANGE", *offers]
    instead = f"{', '.join(others[:-1])} or {others[-1]}"
    instead += ", all of it in one pair of quotes" if quoted else ""
    there = there_are(word, poses)
    stop = "" if there.endswith("?") else "."
    return f"{word!r} is not a pose; {there}{stop} Or give {instead}"


def _instead(name: str, words: Sequence[str], robot: Robot, poses: Poses) -> str:
    """Return what to write instead of words that name the gripper or x, y, z; empty for others."""
    values = dict(word.split("=", 1) for word in words if "=" in word)
    if values.keys() == set("xyz") and len(words) == 3:
        return f"for a point for the tool write {values['x']} {values['y']} {values['z']}"
    if values.get(name) in poses:
        return f"{values[name]} is a pose: write {values[name]}"
    return f"write {WIDTH}=20mm" if name == "gripper" and name in values and robot.gripper else ""


def _check_names(names: Collection[str], robot: Robot, words: Sequence[str], poses: Poses) -> None:
    actuated = [joint.name for joint in robot.actuated]
    leaders = {joint.name: joint.mimic.leader for joint in robot.joints if joint.mimic}
    for name in names:
        if leader := leaders.get(name):
            raise BadTarget(f"{name} follows {leader}; name {leader} instead")
        if name not in actuated:
            instead = _instead(name, words, robot, poses) or there_are(name, actuated)
            raise BadTarget(f"{name} is not an actuated joint; {instead}")
