"""What stands around the arm and what it holds, changed by the task as it goes."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot

from .base import Skill
from .bounds import check_link
from .errors import BadTarget
from .motion import Body, Box, Carry, Cylinder, Mesh, MotionError, Result, Shape, Sphere, quaternion
from .pending import Asking
from .ports import Port
from .positions import three

Ports = dict[str, PortInformation]

_MESHES = (".stl", ".dae", ".obj")
_LEAST = 1e-6  # of a size [m]
_LENGTH = Port(float, description="[m]", unit="m", least=_LEAST)

_BODY = PortInformation(str, description="name of the body")
_PLACE: Ports = {
    "body": _BODY,
    "position": Port(
        list[float],
        description="x, y, z of its centre in the frame of the robot's root [m]",
        unit="m",
        count=3,
    ),
    "rotation": Port(
        list[float],
        default_value=[0.0, 0.0, 0.0],
        description="turns about x, then y, then z [rad]",
        unit="rad",
        count=3,
    ),
    "touches": PortInformation(
        list[str], default_value=[], description="links, bodies or floor that it may touch"
    ),
}


class _Add(Skill, register=False):
    """Say that a body stands there from now on; one of that name is replaced."""

    OUTPUT_PORTS: Ports = {}

    def shape(self) -> Shape:
        """Its form."""
        raise NotImplementedError

    def on_start(self) -> Status:
        """Put it into the world."""
        scene, name = self.context.scene, self.get_input("body")
        roll, pitch, yaw = three("rotation", self.get_input("rotation"))
        for angle in (roll, pitch, yaw):
            if not math.isfinite(angle):
                raise BadTarget(f"the rotation of {name} is not finite; give radians")
        body = Body(
            name,
            self.shape(),
            three("position", self.get_input("position")),
            quaternion(roll, pitch, yaw),
            touches=frozenset(self.get_input("touches")),
        )
        there = any(other.name == name for other in scene.world.bodies)
        scene.world = scene.world.replacing(body) if there else scene.world.adding(body)
        return Status.SUCCESS


class AddBox(_Add):
    """A box stands there from now on."""

    INPUT_PORTS = {
        **_PLACE,
        "size": Port(
            list[float], description="edges along x, y and z [m]", unit="m", least=_LEAST, count=3
        ),
    }

    def shape(self) -> Box:
        """Its form."""
        return Box(three("size", self.get_input("size")))


class AddSphere(_Add):
    """A sphere is there from now on."""

    INPUT_PORTS = {**_PLACE, "radius": _LENGTH}

    def shape(self) -> Sphere:
        """Its form."""
        return Sphere(self.get_input("radius"))


class AddCylinder(_Add):
    """A cylinder, along z where it is not rotated, stands there from now on."""

    INPUT_PORTS = {
        **_PLACE,
        "radius": _LENGTH,
        "length": _LENGTH,
    }

    def shape(self) -> Cylinder:
        """Its form."""
        return Cylinder(self.get_input("radius"), self.get_input("length"))


class AddMesh(_Add):
    """A body of triangles stands there from now on."""

    INPUT_PORTS = {
        **_PLACE,
        "file": PortInformation(str, description="STL, DAE or OBJ file"),
        "scale": Port(
            list[float],
            default_value=[1.0, 1.0, 1.0],
            description="its unit along x, y, z [m]",
            unit="m",
            least=_LEAST,
            count=3,
        ),
    }

    @classmethod
    def judge(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the file that is spelled out."""
        if "file" in inputs and Path(inputs["file"]).suffix.lower() not in _MESHES:
            raise BadTarget(f"{inputs['file']} is no STL, DAE or OBJ file").at("file")
        if "file" in inputs and not Path(inputs["file"]).is_file():
            where = "a path counts from where armtree is started"
            raise BadTarget(f"there is no file {inputs['file']}; {where}").at("file")

    def shape(self) -> Mesh:
        """Its form."""
        return Mesh(self.get_input("file"), three("scale", self.get_input("scale")))


class RemoveBody(Skill):
    """A body is gone from now on."""

    INPUT_PORTS = {"body": _BODY}
    OUTPUT_PORTS: Ports = {}

    def on_start(self) -> Status:
        """Take it out of the world."""
        scene = self.context.scene
        scene.world = scene.world.without(self.get_input("body"))
        return Status.SUCCESS


class _HandOver(Asking, register=False):
    """A body moves with another link from now on."""

    OUTPUT_PORTS: Ports = {}

    def hand_over(self, link: str) -> Status:
        """Have a worker say where the body is in the frame of the link."""
        scene, name = self.context.scene, self.get_input("body")
        scene.world.body(name)
        return self.ask(
            Carry(scene.world, name, link, self.context.arm.commanded, self.context.timeout)
        )

    def on_answer(self, answer: Result) -> Status:
        """Put it into the world."""
        if isinstance(answer, MotionError):
            raise answer
        assert isinstance(answer, Body)
        self.context.scene.world = self.context.scene.world.replacing(answer)
        return Status.SUCCESS


class Attach(_HandOver):
    """A body moves with a link from now on, as when it was grasped; it is checked like a link."""

    INPUT_PORTS = {"body": _BODY, "link": PortInformation(str, description="link that holds it")}

    @classmethod
    def judge(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the link that is spelled out."""
        if "link" in inputs:
            check_link(robot, "link", inputs["link"])

    def on_start(self) -> Status:
        """Take hold of it where it is."""
        return self.hand_over(self.get_input("link"))


class Detach(_HandOver):
    """A body stays where it is from now on."""

    INPUT_PORTS = {"body": _BODY}

    def on_start(self) -> Status:
        """Let go of it where it is."""
        return self.hand_over("")
