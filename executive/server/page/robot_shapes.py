"""The robot for the page: joints, shapes, and meshes by the hash of their content."""

import hashlib
import math
import threading
from functools import cached_property
from pathlib import Path
from typing import Any

from executive.errors import NotFound
from hardware import Robot, read_file
from hardware.description.urdf import Shape, UrdfError, UrdfJoint

MAX_MESH_BYTES = 2**24
MESH_KIND = ".stl"  # for other meshes, the collision shape of their link is shown


class RobotScene:
    """Describes a robot for the page. Any thread may call.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._lock = robot, threading.Lock()
        self._meshes: dict[str, bytes] = {}
        self._hashes: dict[str, str] = {}

    def description(self) -> dict[str, Any]:
        """Return the robot as a JSON object."""
        with self._lock:
            return self._description

    def mesh(self, digest: str) -> bytes:
        """Return the content of a mesh of the description.

        Raises:
            NotFound: The robot has no such mesh.
        """
        self.description()
        if digest not in self._meshes:
            raise NotFound(f"the robot has no mesh {digest}")
        return self._meshes[digest]

    @cached_property
    def _description(self) -> dict[str, Any]:
        robot = self._robot
        tool = robot.tool and {"link": robot.tool.link, "offset": robot.tool.offset}
        urdf = robot.description
        return {
            "name": robot.name,
            "opening": robot.open_effect,
            "links": list(urdf.links),
            "joints": [self._joint(each) for each in sorted(urdf.joints, key=self._place)],
            "shapes": [self._shape(s) for s in urdf.visible_shapes(self._load_mesh)],
            "groups": {name: list(joints) for name, joints in robot.groups.items()},
            "tool": tool,
        }

    def _place(self, joint: UrdfJoint) -> int:
        """Return a number that sorts joints as the robot file does, and others after them."""
        names = [each.name for each in self._robot.joints]
        return names.index(joint.name) if joint.name in names else len(names)

    def _joint(self, joint: UrdfJoint) -> dict[str, Any]:
        mimic = joint.mimic
        known = [each for each in self._robot.joints if each.name == joint.name]
        limits = [limit for each in known for limit in (each.lower, each.upper)]
        return {
            "name": joint.name,
            "type": joint.type,
            "unit": joint.unit,
            "parent": joint.parent,
            "child": joint.child,
            "xyz": joint.xyz,
            "rpy": joint.rpy,
            "axis": joint.axis,
            "limits": [limit for limit in limits if math.isfinite(limit)],
            "mimic": mimic and [mimic.leader, mimic.multiplier, mimic.offset],
        }

    def _load_mesh(self, name: str) -> bool:
        """Store a mesh. Return False if it cannot be shown."""
        try:
            path = Path(self._robot.mesh(name))
            if path.suffix.lower() != MESH_KIND:
                return False
            data = read_file(path, MAX_MESH_BYTES)
        except (UrdfError, OSError, ValueError):
            return False
        self._hashes[name] = digest = hashlib.sha256(data).hexdigest()[:32]
        self._meshes[digest] = data
        return True

    def _shape(self, shape: Shape) -> dict[str, Any]:
        return {
            "link": shape.link,
            "kind": shape.kind,
            "sizes": shape.sizes,
            "mesh": self._hashes.get(shape.mesh, ""),
            "xyz": shape.xyz,
            "rpy": shape.rpy,
            "color": shape.color,
        }
