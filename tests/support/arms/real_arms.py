"""Arms as their makers describe them, with their meshes, out of the package example-robot-data."""

import json
from importlib.metadata import distribution
from pathlib import Path
from xml.etree import ElementTree

from hardware import Robot, load_robot

DATA = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = DATA / "example-robot-data" / "robots"
FILES = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "ur_description/srdf/ur5.srdf"),
    "panda": ("panda_description/urdf/panda.urdf", "panda_description/srdf/panda.srdf"),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", "xarm_description/srdf/xarm7.srdf"),
    "jaco": ("kinova_description/robots/kinova.urdf", "kinova_description/srdf/kinova.srdf"),
}
_MOVING = ("revolute", "continuous", "prismatic")


def real(name: str, folder: Path) -> Robot:
    """One of `FILES`, by a robot file that is written into a folder.

    Speeds and which links may touch are the maker's, beside neighbours; accelerations are not, as a
    URDF has none. What slides is a gripper.
    """
    urdf, srdf = (ROBOTS / file for file in FILES[name])
    every = ElementTree.parse(urdf).getroot().findall("joint")
    joints = [joint for joint in every if joint.get("type") in _MOVING]
    slides = [j.get("name", "") for j in joints if j.get("type") == "prismatic"]
    turns = [j.get("name", "") for j in joints if j.get("type") != "prismatic"]
    pairs = [(joint.find("parent"), joint.find("child")) for joint in every]
    allowed = [[link.get("link", "") for link in pair if link is not None] for pair in pairs]
    for pair in ElementTree.parse(srdf).getroot().iter("disable_collisions"):
        allowed.append([pair.get("link1", ""), pair.get("link2", "")])
    lines = [
        f"name = {json.dumps(name)}\nurdf = {json.dumps(str(urdf))}",
        f"[groups]\narm = {json.dumps(turns)}\ngripper = {json.dumps(slides)}",
        *(_described(joint) for joint in joints if joint.find("mimic") is None),
        f"[collision]\nmargin_m = 0.005\nfloor_ignores = []\nallowed = {json.dumps(allowed)}",
    ]
    file = folder / f"{name}.toml"
    file.write_text("\n\n".join(lines) + "\n")
    return load_robot(file)


def _described(joint: ElementTree.Element) -> str:
    limit = joint.find("limit")
    assert limit is not None
    endless = joint.get("type") == "continuous"
    lower, upper = (0.0, 0.0) if endless else (float(limit.attrib[k]) for k in ("lower", "upper"))
    speed = float(limit.attrib["velocity"])
    return (
        f"[joints.{json.dumps(joint.get('name'))}]\n"
        f"velocity = {speed}\nacceleration = {2.0 * speed}\nboot = {0.5 * (lower + upper)}"
    )
