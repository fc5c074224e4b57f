"""Arms that are not ours: robot files without a wire, or just a URDF."""

import dataclasses
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import CollisionRules, Joint, Robot, load_robot
from hardware.drivers.arduino.frames import WireField
from skills.motion.collision.checker import CollisionChecker
from tests.support.paths import DATA

ARMS = ("six_axes", "seven_axes", "endless")
_PAIR = """name = "arm"
urdf = "arm.urdf"
[groups]
arm = ["{0}", "{1}"]
[joints.{0}]
velocity = 2.0
acceleration = 4.0
boot = 0.0
[collision]
margin_m = 0.005
floor_ignores = []
allowed = []
"""


def foreign(name: str) -> Robot:
    """An arm with a mesh, one with sliding fingers, or one that turns without end."""
    return load_robot(DATA / f"{name}.toml")


def pair_file(leader: str, follower: str) -> str:
    """A robot file for arm.urdf beside it, of two joints."""
    return _PAIR.format(leader, follower)


def robot_of(urdf: Path, margin: float = 0.01) -> Robot:
    """A Robot of joints that all turn by themselves, out of a URDF that has no robot file."""
    model = pin.buildModelFromUrdf(str(urdf), True)
    root = ElementTree.parse(urdf).getroot()
    elements = {e.get("name", ""): e for e in root.findall("joint")}
    joints = tuple(_joint(elements[name]) for name in model.names[1:])
    return dataclasses.replace(
        load_robot(),
        name=root.get("name", ""),
        urdf=urdf,
        joints=joints,
        groups={"arm": tuple(joint.name for joint in joints), "gripper": ()},
        collision=CollisionRules(margin, _neighbours(model), None, frozenset()),
        tool=None,
    )


def free_poses(
    robot: Robot, count: int, seed: int, checker: CollisionChecker
) -> NDArray[np.float64]:
    """Random configurations of all actuated joints that are free (N, A) [rad]."""
    random, found = np.random.default_rng(seed), list[NDArray[np.float64]]()
    lower = np.array([max(j.lower, -np.pi) for j in robot.actuated])
    upper = np.array([min(j.upper, np.pi) for j in robot.actuated])
    while len(found) < count:
        pose = random.uniform(lower, upper)
        if checker.first_collision(pose[None, :], robot.collision.margin) is None:
            found.append(pose)
    return np.array(found)


def _joint(element: ElementTree.Element) -> Joint:
    limit = element.find("limit")
    assert limit is not None
    return Joint(
        name=element.get("name", ""),
        lower=float(limit.attrib["lower"]),
        upper=float(limit.attrib["upper"]),
        velocity=min(2.0, float(limit.get("velocity", 1.0))),
        acceleration=2.0,
        boot=0.0,
        mimic=None,
        wire=WireField("x", 1, 0.0, np.pi, False),
    )


def _neighbours(model: pin.Model) -> frozenset[frozenset[str]]:
    """Pairs of links with at most two joints between them."""
    bodies = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    allowed = set[frozenset[str]]()
    for one, other in combinations(bodies, 2):
        ways = [list(model.supports[frame.parentJoint]) for frame in (one, other)]
        if len(set(ways[0]) ^ set(ways[1])) <= 2:
            allowed.add(frozenset((one.name, other.name)))
    return frozenset(allowed)
