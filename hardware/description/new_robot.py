"""Makes a robot file from a URDF."""

import json
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from hardware.drivers.null_driver import NO_BAUD, NO_FIRMWARE, NullDriver
from hardware.errors import DescriptionError
from hardware.files import read_file
from hardware.joints import Joint
from hardware.link.link import VIRTUAL
from hardware.spelling import closest, did_you_mean, there_are

from .gripper import closing
from .groups import Tree, guess_gripper, guess_tool
from .meshes import MAX_SIZE, mesh_mistakes, mesh_size_mistakes, visual_mesh_warnings
from .robot import CollisionRules, Robot, Serial, Tool
from .urdf import MAX_BYTES, Urdf, UrdfError, UrdfJoint

_MARGIN = 0.005  # [m]
# A larger velocity limit in a URDF is a placeholder: `_CAUTIOUS` replaces it.
_PLAUSIBLE = {"rad": 3.5, "m": 1.0}  # [rad/s], [m/s]
_CAUTIOUS = {"rad": 1.0, "m": 0.1}  # [rad/s], [m/s]
_DEGREES = 4 * math.pi, 720.0  # magnitude of limits that are degrees by mistake
# Magnitude of limits that are mm by mistake: fingers of 5 mm are common, axes of 5 m are not.
_STROKE = 5.0, 1e4
_TIME_TO_SPEED = 0.5  # [s]
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

_HEAD = """\
# {name}, made from a URDF by `armtree new-arm`. The page *Robot files* explains the keys.
# Without a driver the arm moves on the port `virtual` only, and nothing real moves. For a real
# board, fill in `driver`, [serial] and the `wire` of every joint, and remove their `# `:
#   driver          board         baud      firmware         wire
#   "feetech"       bus servos    1000000   "sts", "scs"     {{ id = 1, sign = 1, offset_deg = 0 }}
#   "serial_servo"  an Arduino    115200    "stock"          {{ letter = "a", sign = 1,
#                                     offset_deg = 90, span_deg = 180, reversed = false }}

name = {name}
urdf = {urdf}
# driver = ""                 # one of these, or one of an installed package

# [serial]
# port = "/dev/ttyACM0"       # `armtree doctor` lists the ports
# baud = 0                    # speed of the line
# boot_wait_s = 2.0           # longest time from opening the port until the board reads from it
# firmware = ""

[groups]
arm = {arm}
gripper = {gripper}
"""
_JOINT = """
[joints.{key}]{pad}# {limits}
velocity = {velocity:<19}# [{unit}/s]{note}
acceleration = {acceleration:<15g}# [{unit}/s2]; a URDF has none
boot = {boot:<23}# position in the start pose [{unit}]
# wire = {{}}
"""
_GRIPPER = """
# [gripper]                   # the width of `armtree move width=20mm` is the distance of its pads:
# pads = {{ {pads} }}
# Fill in the middle of the face of each finger, in the frame of that link [m].
"""
_TAIL = """
[tool]                        # tool center point: what `armtree move X Y Z` moves
link = {link}
offset_m = [0.0, 0.0, 0.0]    # its position in the frame of that link
axis = [0.0, 0.0, 1.0]        # its direction in that frame

[collision]
margin_m = {margin:<19g}# least distance that planning keeps
# floor_m = 0.0               # height of the table; remove the `# ` if there is one
floor_ignores = [{root}]
allowed = [                   # pairs of links that are not checked, each with its reason
{pairs}]
"""


class UrdfUnusable(DescriptionError):
    """A URDF cannot become a robot file. The message lists all its mistakes."""

    def __init__(self, path: Path, mistakes: Sequence[UrdfError]) -> None:
        error = UrdfError.of(mistakes, path)
        super().__init__(path, error.line, str(error))


def draft_robot(
    path: Path, largest: float, gripper: Sequence[str] | None = None, tool: str | None = None
) -> Robot:
    """Return a robot with the joints, groups and limits of a URDF, without a driver.

    Positions at boot are 0, or the nearest limit. All pairs of links are checked for collisions.

    Args:
        path: The URDF file.
        largest: Largest allowed size of a collision shape, and largest allowed distance of the
            shape from the origin of the link [m].
        gripper: Names of the joints of the gripper; None to guess them.
        tool: Name of the link that carries the tool; None to guess it.

    Raises:
        UrdfUnusable: The URDF has mistakes, or has no joint or link with a name given in `gripper`
            or `tool`.
    """
    try:
        urdf = Urdf(read_file(path, MAX_BYTES))
    except UrdfError as error:
        raise UrdfUnusable(path, [error]) from error
    except (OSError, ValueError, LookupError) as error:
        words = f"cannot be read: {getattr(error, 'strerror', None) or error}; check the path"
        raise UrdfUnusable(path, [UrdfError(words)]) from error
    if urdf.is_xacro:
        raise UrdfUnusable(path, list(urdf.mistakes()))
    mistakes, names = list(urdf.mistakes()), tuple(gripper or ())
    is_tree = not mistakes
    mistakes += _joint_mistakes(urdf)
    mistakes += urdf.shape_mistakes(largest)
    mistakes += [
        UrdfError(f"the {key} of {where}, {_words(size)}, {_metres(size, key)}", line)
        for line, where, key, size in urdf.shape_sizes()
        if MAX_SIZE < max(size, default=0.0) <= largest
    ]
    used = [name for name, collides in urdf.meshes().items() if name and collides]
    mistakes += mesh_mistakes(path, used)
    mistakes += mesh_size_mistakes(path, urdf)
    mistakes += _gripper_mistakes(gripper or (), urdf)
    if tool is not None and urdf.links and tool not in urdf.links:
        why = f"there is no link {tool} for the tool; {there_are(tool, urdf.links)}"
        mistakes.append(UrdfError(why))
    if is_tree:
        try:
            names = guess_gripper(urdf) if gripper is None else names
        except UrdfError as error:
            mistakes.append(error)
    if mistakes:
        raise UrdfUnusable(path, [*mistakes, *visual_mesh_warnings(path, urdf)])
    return _robot(path, urdf, names, tool or guess_tool(urdf, names))


def guess_gripper_poses(robot: Robot) -> dict[str, dict[str, float]]:
    """Return the poses `open` and `closed` of a gripper from the limits of its joints.

    A joint without limits is left out. The result is empty if no joint is left.

    Each joint is closed at the limit that is nearer to 0; if both are equally near, at the lower
    one. It is open at the other limit.

    Returns:
        Position by joint [rad], [m], by the name of the pose.
    """
    bounded = [joint for joint in robot.actuated_in("gripper") if not joint.continuous]
    ends = {j.name: (j.upper, j.lower) if closing(j) < 0 else (j.lower, j.upper) for j in bounded}
    poses = {
        pose: {joint: limits[end] for joint, limits in ends.items()}
        for end, pose in enumerate(("open", "closed"))
    }
    return poses if ends else {}


def robot_text(robot: Robot, folder: Path, allowed: Mapping[tuple[str, str], str]) -> str:
    """Return the text of a robot file.

    Args:
        robot: The robot that `draft_robot` returned.
        folder: Folder of the robot file. The path of the URDF is written relative to this folder.
        allowed: Reason for each pair of links that is not checked for collisions.
    """
    urdf = robot.description
    assert robot.tool
    head = _HEAD.format(
        name=json.dumps(robot.name),
        urdf=json.dumps(_relative(robot.urdf, folder)),
        **{group: json.dumps(names) for group, names in robot.groups.items()},
    )
    tail = _TAIL.format(
        link=json.dumps(robot.tool.link),
        margin=robot.collision.margin,
        root=json.dumps(Tree(urdf).root),
        pairs="".join(f"    {json.dumps(pair)},  # {why}\n" for pair, why in allowed.items()),
    )
    joints = "".join(_joint_text(joint, urdf.moving[joint.name]) for joint in robot.actuated)
    return head + joints + _gripper_text(robot, urdf) + tail


def _relative(urdf: Path, folder: Path) -> str:
    """Return the path of a URDF relative to a folder. Symbolic links are resolved first."""
    return os.path.relpath(urdf.parent.resolve() / urdf.name, folder.resolve())


def _joint_text(joint: Joint, described: UrdfJoint) -> str:
    limits = f"{joint.words(joint.lower)} to {joint.words(joint.upper)}"
    said = "has none" if math.isinf(described.velocity) else f"says {described.velocity:g}"
    key = _key(joint.name)
    return _JOINT.format(
        key=key,
        pad=" " * max(1, 21 - len(key)),
        limits="turns without limits" if joint.continuous else limits,
        velocity=_rounded(joint.velocity, 0.0, joint.velocity),
        note="" if joint.velocity == described.velocity else f"; the URDF {said}",
        acceleration=joint.acceleration,
        boot=_rounded(joint.boot, joint.lower, joint.upper),
        unit=joint.unit,
    )


def _gripper_text(robot: Robot, urdf: Urdf) -> str:
    """Return the table `gripper` as comments; empty unless one joint moves independently."""
    if len(robot.actuated_in("gripper")) != 1:
        return ""
    moving = [urdf.moving[name] for name in robot.groups["gripper"]]
    fingers = [*(joint.child for joint in moving), moving[0].parent][:2]
    pads = ", ".join(f"{_key(link)} = [0.0, 0.0, 0.0]" for link in fingers)
    return _GRIPPER.format(pads=pads)


def _key(name: str) -> str:
    """Return a name as a key of TOML."""
    return name if _BARE_KEY.fullmatch(name) else json.dumps(name)


def _rounded(value: float, lower: float, upper: float) -> float:
    """Return a value rounded to four decimals, or unchanged if the result is 0 or out of bounds."""
    short = round(value, 4)
    return short if short and lower <= short <= upper else value


def _joint_mistakes(urdf: Urdf) -> Iterator[UrdfError]:
    leaders = [j.name for j in urdf.joints if j.type != "fixed" and j.mimic is None]
    for joint, line in zip(urdf.joints, urdf.joint_lines, strict=True):
        name = joint.name
        limits = joint.lower, joint.upper
        if joint.type == "revolute" and (odd := _in_degrees(*limits)):
            lower, upper = (math.radians(q) if q in odd else q for q in limits)
            what = " and ".join(f"{q:g}" for q in odd)
            why = f"joint {name}: its limit{f's {what} look' if odd[1:] else f' {what} looks'}"
            right = f'lower="{lower:.5g}" upper="{upper:.5g}"'
            yield UrdfError(f"{why} like degrees, but a URDF has radians; write {right}", line)
        least, most = _STROKE
        if joint.type == "prismatic" and least < max(map(abs, limits)) <= most:
            why = f"joint {name}: its limits {joint.lower:g} and {joint.upper:g} look like mm"
            right = f'lower="{joint.lower / 1e3:g}" upper="{joint.upper / 1e3:g}"'
            yield UrdfError(f"{why}, but a URDF has metres; write {right}", line)
        if max(map(abs, joint.xyz)) > MAX_SIZE:
            why = f"joint {name}: its origin {_words(joint.xyz)} {_metres(joint.xyz, 'xyz')}"
            yield UrdfError(why, line)
        if joint.mimic and joint.mimic.leader not in leaders:
            why = f"joint {name} mimics {joint.mimic.leader}, which does not move by itself"
            yield UrdfError(f"{why}; let it mimic one of {', '.join(leaders) or 'others'}", line)
        if joint.mimic and not joint.mimic.multiplier:
            why = f"joint {name} mimics {joint.mimic.leader} with multiplier 0"
            yield UrdfError(f"{why}; give another multiplier, or the type fixed", line)


def _metres(numbers: Sequence[float], key: str) -> str:
    right = _words([each / 1e3 for each in numbers])
    return f'looks like mm, but a URDF has metres; write {key}="{right}"'


def _words(numbers: Sequence[float]) -> str:
    return " ".join(f"{each:g}" for each in numbers)


def _in_degrees(*limits: float) -> list[float]:
    """Return the limits that look like degrees; empty unless one is above two turns [rad]."""
    least, most = _DEGREES
    large = [q for q in limits if least < abs(q) <= most and round(q, 1) == q]
    return [q for q in limits if q in large or (large and q and q.is_integer())]


def _gripper_mistakes(gripper: Sequence[str], urdf: Urdf) -> Iterator[UrdfError]:
    """Yield the mistakes in a user's names of gripper joints."""
    leaders = {j.name: j.mimic.leader if j.mimic else j.name for j in urdf.moving.values()}
    independent = [name for name, leader in leaders.items() if name == leader]
    for name in gripper if independent else ():
        if name not in independent:
            near = did_you_mean(leaders.get(closest(name, leaders), ""))
            why = f"--gripper: {name} is not a joint that moves by itself"
            yield UrdfError(why + (near or f"; {there_are(name, independent)}"))
    if independent and set(independent) <= set(gripper):
        yield UrdfError("all joints are in the gripper; leave at least one for the arm")


def _robot(path: Path, urdf: Urdf, gripper: Sequence[str], tool: str) -> Robot:
    tree, followers = Tree(urdf), dict[str, list[UrdfJoint]]()
    chain = [joint for joint in tree.moving_below(tree.root) if joint.mimic is None]
    # A stable sort: the joints of the arm come first.
    chain.sort(key=lambda joint: joint.name in gripper)
    for joint in urdf.moving.values():
        if joint.mimic:
            followers.setdefault(joint.mimic.leader, []).append(joint)
    groups = {"arm": list[str](), "gripper": list[str]()}
    for joint in chain:
        own = [joint.name, *(each.name for each in followers.get(joint.name, ()))]
        groups["gripper" if joint.name in gripper else "arm"] += own
    leaders = {joint.name: _leader(joint, followers.get(joint.name, ())) for joint in chain}
    mimics = [
        joint.following(leaders[leader]) for leader, joints in followers.items() for joint in joints
    ]
    return Robot(
        name=re.sub(r"[^A-Za-z0-9_-]+", "_", path.stem),
        path=path,
        urdf=path,
        joints=(*leaders.values(), *mimics),
        groups={group: tuple(names) for group, names in groups.items()},
        serial=Serial(VIRTUAL, NO_BAUD, 0.0),
        driver=NullDriver(path),
        firmware=NO_FIRMWARE,
        collision=CollisionRules(_MARGIN, frozenset(), None, frozenset()),
        tool=Tool(tool, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        links=urdf.links,
    )


def _leader(joint: UrdfJoint, followers: Sequence[UrdfJoint]) -> Joint:
    velocity = joint.velocity
    if velocity > _PLAUSIBLE[joint.unit]:
        velocity = _CAUTIOUS[joint.unit]
    for each in followers:
        assert each.mimic
        velocity = min(velocity, each.velocity / abs(each.mimic.multiplier))
    return Joint(
        name=joint.name,
        lower=joint.lower,
        upper=joint.upper,
        velocity=velocity,
        acceleration=velocity / _TIME_TO_SPEED,
        boot=min(max(0.0, joint.lower), joint.upper),
        mimic=None,
        wire=None,
        unit=joint.unit,
    )
