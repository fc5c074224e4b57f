"""Where the links stand for given joint positions, from the URDF alone."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin
from xml.etree import ElementTree

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # x, y, z, w

_TURNING = ("revolute", "continuous")
_NONE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Place:
    """Where a link stands in its parent.

    Attributes:
        parent: Link.
        child: Link.
        position: [m].
        rotation: Unit quaternion (x, y, z, w).
    """

    parent: str
    child: str
    position: Vector
    rotation: Quaternion


@dataclass(frozen=True, slots=True)
class _Joint:
    name: str
    turns: bool
    slides: bool
    parent: str
    child: str
    origin: Vector
    rotation: Quaternion
    axis: Vector
    leader: str
    multiplier: float
    offset: float


class Links:
    """The links of a robot.

    Args:
        urdf: Its description.

    Raises:
        ValueError: It is no URDF.
    """

    def __init__(self, urdf: str) -> None:
        self._joints = [
            _joint(element) for element in ElementTree.fromstring(urdf).findall("joint")
        ]

    def places(self, positions: Mapping[str, float]) -> list[Place]:
        """Where every link stands but the root; joints that are not given stand at 0.

        Args:
            positions: By joint, [rad] or [m].
        """
        return [_place(joint, positions) for joint in self._joints]


def _place(joint: _Joint, positions: Mapping[str, float]) -> Place:
    value = joint.multiplier * positions.get(joint.leader, 0.0) + joint.offset
    position, rotation = joint.origin, joint.rotation
    if joint.turns:
        x, y, z = (sin(value / 2) * part for part in joint.axis)
        rotation = _times(rotation, (x, y, z, cos(value / 2)))
    elif joint.slides:
        x, y, z = _turned(rotation, joint.axis)
        position = position[0] + value * x, position[1] + value * y, position[2] + value * z
    return Place(joint.parent, joint.child, position, rotation)


def _joint(element: ElementTree.Element) -> _Joint:
    mimic, kind = element.find("mimic"), element.get("type", "")
    name = element.get("name", "")
    leader, multiplier, offset = name, 1.0, 0.0
    if mimic is not None:
        leader = mimic.get("joint", "")
        multiplier, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
    return _Joint(
        name=name,
        turns=kind in _TURNING,
        slides=kind == "prismatic",
        parent=_attribute(element, "parent", "link"),
        child=_attribute(element, "child", "link"),
        origin=_vector(element, "origin", "xyz", _NONE),
        rotation=_from_rpy(_vector(element, "origin", "rpy", _NONE)),
        axis=_unit(_vector(element, "axis", "xyz", (1.0, 0.0, 0.0))),
        leader=leader,
        multiplier=multiplier,
        offset=offset,
    )


def _attribute(element: ElementTree.Element, tag: str, name: str) -> str:
    found = element.find(tag)
    return "" if found is None else found.get(name, "")


def _vector(element: ElementTree.Element, tag: str, name: str, default: Vector) -> Vector:
    text = _attribute(element, tag, name)
    if not text:
        return default
    x, y, z = map(float, text.split())
    return x, y, z


def _unit(vector: Vector) -> Vector:
    x, y, z = vector
    length = (x * x + y * y + z * z) ** 0.5 or 1.0
    return x / length, y / length, z / length


def _from_rpy(rpy: Vector) -> Quaternion:
    """Of a turn about the fixed x, y and z axes, in this order [rad]."""
    roll, pitch, yaw = (
        (sin(rpy[0] / 2), 0.0, 0.0, cos(rpy[0] / 2)),
        (0.0, sin(rpy[1] / 2), 0.0, cos(rpy[1] / 2)),
        (0.0, 0.0, sin(rpy[2] / 2), cos(rpy[2] / 2)),
    )
    return _times(yaw, _times(pitch, roll))


def _times(a: Quaternion, b: Quaternion) -> Quaternion:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _turned(rotation: Quaternion, vector: Vector) -> Vector:
    x, y, z, w = rotation
    turned = _times(_times(rotation, (*vector, 0.0)), (-x, -y, -z, w))
    return turned[0], turned[1], turned[2]
