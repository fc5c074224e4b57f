"""Forward kinematics: the transform from each link to its parent for given joint positions."""

from collections.abc import Mapping
from math import cos, hypot, sin

from hardware.joints import Mimic
from hardware.loading.dataclass import dataclass

from .urdf import Urdf, UrdfJoint, Vector

Quaternion = tuple[float, float, float, float]  # x, y, z, w


@dataclass(frozen=True, slots=True)
class LinkTransform:
    """The pose of a link in the frame of its parent.

    Attributes:
        parent: Name of the parent link.
        child: Name of the link.
        position: Position of the link's origin [m].
        rotation: Unit quaternion (x, y, z, w).
    """

    parent: str
    child: str
    position: Vector
    rotation: Quaternion


class ForwardKinematics:
    """The forward kinematics of a robot.

    Args:
        urdf: The URDF of the robot.
    """

    def __init__(self, urdf: Urdf) -> None:
        self._joints = [
            (
                joint,
                _from_rpy(joint.rpy),
                _normalized(joint.axis),
                joint.mimic or Mimic(joint.name, 1.0, 0.0),
            )
            for joint in urdf.joints
        ]

    def transforms(self, positions: Mapping[str, float]) -> list[LinkTransform]:
        """Return the transforms of all links except the root.

        Args:
            positions: Joint positions by name [rad or m]. A missing joint is at 0. A mimic joint
                follows its leader.
        """
        return [
            _transform(joint, rotation, axis, mimic.value(positions.get(mimic.leader, 0.0)))
            for joint, rotation, axis, mimic in self._joints
        ]

    def locate(self, link: str, offset: Vector, positions: Mapping[str, float]) -> Vector:
        """Return the position of a point of a link, in the root frame [m].

        Args:
            link: Name of the link.
            offset: The point in the frame of the link [m].
            positions: Joint positions by name [rad or m], as in `transforms`.
        """
        above = {each.child: each for each in self.transforms(positions)}
        while each := above.get(link):
            x, y, z = _rotated(each.rotation, offset)
            a, b, c = each.position
            link, offset = each.parent, (a + x, b + y, c + z)
        return offset

    def joints_above(self, link: str) -> list[UrdfJoint]:
        """Return the joints between a link and the root, nearest joint first."""
        above = {joint.child: joint for joint, *_ in self._joints}
        joints = []
        while joint := above.get(link):
            joints.append(joint)
            link = joint.parent
        return joints


def reach(urdf: Urdf) -> float:
    """Return an upper bound of the distance of any link from the root [m]."""
    above = {joint.child: joint for joint in urdf.joints}

    def length(link: str) -> float:
        total = 0.0
        while joint := above.get(link):
            travel = max(abs(joint.lower), abs(joint.upper)) if joint.type == "prismatic" else 0.0
            total, link = total + hypot(*joint.xyz) + travel, joint.parent
        return total

    return max(map(length, above), default=0.0)


def _transform(joint: UrdfJoint, rotation: Quaternion, axis: Vector, value: float) -> LinkTransform:
    position = joint.xyz
    if joint.type in ("revolute", "continuous"):
        x, y, z = (sin(value / 2) * part for part in axis)
        rotation = _product(rotation, (x, y, z, cos(value / 2)))
    elif joint.type == "prismatic":
        x, y, z = _rotated(rotation, axis)
        position = position[0] + value * x, position[1] + value * y, position[2] + value * z
    return LinkTransform(joint.parent, joint.child, position, rotation)


def _normalized(vector: Vector) -> Vector:
    x, y, z = vector
    length = (x * x + y * y + z * z) ** 0.5
    return x / length, y / length, z / length


def _from_rpy(rpy: Vector) -> Quaternion:
    """Return the quaternion of rotations [rad] about the fixed x, y and z axes, in this order."""
    roll, pitch, yaw = (
        (sin(rpy[0] / 2), 0.0, 0.0, cos(rpy[0] / 2)),
        (0.0, sin(rpy[1] / 2), 0.0, cos(rpy[1] / 2)),
        (0.0, 0.0, sin(rpy[2] / 2), cos(rpy[2] / 2)),
    )
    return _product(yaw, _product(pitch, roll))


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotated(rotation: Quaternion, vector: Vector) -> Vector:
    x, y, z, w = rotation
    rotated = _product(_product(rotation, (*vector, 0.0)), (-x, -y, -z, w))
    return rotated[0], rotated[1], rotated[2]
