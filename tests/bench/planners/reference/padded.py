"""The same arm and world for planners without a margin: their shapes are padded.

Two shapes that are padded by half a margin each touch when the originals are a margin apart, or
slightly more at corners. A URDF cannot pad a mesh. Therefore a mesh is its bounding box, or the arm
is not padded and the world is padded by the whole margin. Then all planners keep the same distance
to the world; between two links of the arm, the others keep none. Joints outside the arm are fixed
at zero. Bodies and the floor are links.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as Xml

import coal
import numpy as np
import pinocchio as pin

from hardware import Robot
from hardware.description.meshes import find_mesh
from skills.motion import Body, Box, Cylinder, Sphere, World
from skills.motion.collision.planning_scene import PlanningScene, placement
from skills.motion.robot_model.robot_model import FLOOR


@dataclass(frozen=True)
class Description:
    """An arm and its world in formats that all planners read.

    Attributes:
        urdf: Arm and world.
        srdf: The pairs of links that are not checked, and the group `arm`.
        joints: Names of the arm's joints, in order.
        checked: Pairs of links that are checked.
    """

    urdf: str
    srdf: str
    joints: tuple[str, ...]
    checked: frozenset[frozenset[str]]


def padded(
    robot: Robot, world: World, margin: float | None = None, boxes: bool = True
) -> Description:
    """Return the arm and world, padded so that both touch when they are a margin apart.

    Args:
        robot: The arm.
        world: Bodies around it.
        margin: Distance to keep. Default: the robot's [m].
        boxes: True to pad arm and world by half of it each; each mesh is then its bounding box.
            False to pad only the world.
    """
    margin = robot.collision.margin if margin is None else margin
    own = 0.5 * margin if boxes else 0.0
    rest = margin - own
    root = Xml.parse(robot.urdf).getroot()
    arm = tuple(joint.name for joint in robot.actuated_in("arm"))
    for joint in root.findall("joint"):
        _fix(joint, robot, arm)
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        for geometry in link.iterfind("collision/geometry"):
            mesh = geometry.find("mesh")
            if mesh is None or boxes:
                _grow(geometry, robot.urdf, own)
            else:
                mesh.set("filename", str(find_mesh(robot.urdf, mesh.get("filename", ""))))
    for body in world.bodies:
        _add(root, body, rest)
    if robot.collision.floor is not None:
        deep = 0.5
        place = (0.0, 0.0, robot.collision.floor - 0.5 * deep)
        _add(root, Body(FLOOR, Box((4.0, 4.0, deep)), place), rest)
    checked = frozenset(_checked(PlanningScene(robot, world)))
    urdf = Xml.tostring(root, encoding="unicode")
    return Description(urdf, _srdf(root, arm, checked), arm, checked)


def _fix(joint: Xml.Element, robot: Robot, arm: tuple[str, ...]) -> None:
    limit, mimic = joint.find("limit"), joint.find("mimic")
    if mimic is not None:
        joint.remove(mimic)
    if joint.get("name") not in arm:
        joint.set("type", "fixed")
    elif limit is not None:
        limit.set("velocity", str(robot.joint(joint.get("name", "")).velocity))


def _grow(geometry: Xml.Element, urdf: Path, grow: float) -> None:
    shape = geometry[0]
    if shape.tag == "mesh":
        geometry.remove(shape)
        shape = _box_around(shape.get("filename", ""), urdf, geometry)
    for key, share in (("size", 2.0), ("radius", 1.0), ("length", 2.0)):
        if key in shape.attrib:
            sizes = [float(value) + share * grow for value in shape.attrib[key].split()]
            shape.set(key, " ".join(map(repr, sizes)))


def _box_around(name: str, urdf: Path, geometry: Xml.Element) -> Xml.Element:
    """Return the bounding box of a mesh that is aligned with its link's frame."""
    mesh = coal.MeshLoader().load(str(find_mesh(urdf, name)), np.ones(3))
    mesh.computeLocalAABB()
    sizes = mesh.aabb_local.max_ - mesh.aabb_local.min_
    return Xml.SubElement(geometry, "box", size=" ".join(map(repr, sizes.tolist())))


def _add(root: Xml.Element, body: Body, grow: float) -> None:
    link = Xml.SubElement(root, "link", name=body.name)
    geometry = Xml.SubElement(Xml.SubElement(link, "collision"), "geometry")
    match body.shape:
        case Box(size):
            Xml.SubElement(geometry, "box", size=" ".join(map(repr, size)))
        case Sphere(radius):
            Xml.SubElement(geometry, "sphere", radius=repr(radius))
        case Cylinder(radius, length):
            Xml.SubElement(geometry, "cylinder", radius=repr(radius), length=repr(length))
    _grow(geometry, Path(), grow)
    children = {child.get("link") for child in root.iterfind("joint/child")}
    first = next(e.get("name", "") for e in root.findall("link") if e.get("name") not in children)
    joint = Xml.SubElement(root, "joint", name=f"{body.name}_joint", type="fixed")
    Xml.SubElement(joint, "parent", link=first)
    Xml.SubElement(joint, "child", link=body.name)
    turn = " ".join(map(repr, pin.rpy.matrixToRpy(placement(body).rotation).tolist()))
    Xml.SubElement(joint, "origin", xyz=" ".join(map(repr, body.position)), rpy=turn)


def _checked(model: PlanningScene) -> Iterator[frozenset[str]]:
    for pair in model.hulls.collisionPairs:
        yield frozenset((model.hull_links[pair.first], model.hull_links[pair.second]))


def _srdf(root: Xml.Element, arm: tuple[str, ...], checked: frozenset[frozenset[str]]) -> str:
    srdf = Xml.Element("robot", name=root.get("name", ""))
    group = Xml.SubElement(srdf, "group", name="arm")
    for name in arm:
        Xml.SubElement(group, "joint", name=name)
    links = [link.get("name", "") for link in root.findall("link")]
    for one, other in combinations(links, 2):
        if frozenset((one, other)) not in checked:
            Xml.SubElement(srdf, "disable_collisions", link1=one, link2=other, reason="Never")
    return Xml.tostring(srdf, encoding="unicode")
