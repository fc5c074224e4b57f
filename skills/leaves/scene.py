"""What stands around the arm and what it holds, changed by the task as it goes."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills.base import Skill, WorldChange
from skills.errors import BadBody, refuse
from skills.motion.errors import MotionError
from skills.motion.query import Carry, Result
from skills.motion.world import Body, Box, Cylinder, Mesh, Shape, Sphere, quaternion
from skills.planning_skill import PlanningSkill
from skills.ports import Port, xyz

from .check_bounds import check_link

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

    world_change = WorldChange.ADDS

    OUTPUT_PORTS: Ports = {}

    @classmethod
    def shape(cls, given: Mapping[str, Any]) -> Shape:
        """Its form, of all inputs."""
        raise NotImplementedError

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Make it, where it is spelled out."""
        cls.body(inputs)

    @classmethod
    def body(cls, inputs: Mapping[str, Any]) -> Body | None:
        """What is put there."""
        if any(port not in inputs for port in cls.INPUT_PORTS):
            return None
        rotation = xyz("rotation", inputs["rotation"])
        if not all(map(math.isfinite, rotation)):
            why = f"the rotation of {inputs['body']} is not finite; give radians"
            raise BadBody(why).at("rotation")
        return Body(
            inputs["body"],
            cls.shape(inputs),
            xyz("position", inputs["position"]),
            quaternion(*rotation),
            touches=frozenset(inputs["touches"]),
        )

    def on_start(self) -> Status:
        """Put it into the world."""
        scene = self.context.scene
        body = self.body({port: self.get_input(port) for port in self.INPUT_PORTS})
        assert body
        there = any(other.name == body.name for other in scene.world.bodies)
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

    @classmethod
    def shape(cls, given: Mapping[str, Any]) -> Box:
        """Its form."""
        return Box(xyz("size", given["size"]))


class AddSphere(_Add):
    """A sphere is there from now on."""

    INPUT_PORTS = {**_PLACE, "radius": _LENGTH}

    @classmethod
    def shape(cls, given: Mapping[str, Any]) -> Sphere:
        """Its form."""
        return Sphere(given["radius"])


class AddCylinder(_Add):
    """A cylinder, along z where it is not rotated, stands there from now on."""

    INPUT_PORTS = {
        **_PLACE,
        "radius": _LENGTH,
        "length": _LENGTH,
    }

    @classmethod
    def shape(cls, given: Mapping[str, Any]) -> Cylinder:
        """Its form."""
        return Cylinder(given["radius"], given["length"])


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
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the file that is spelled out."""
        wrong: list[Exception] = []
        if "file" in inputs and (why := _no_mesh(Path(inputs["file"]))):
            wrong.append(BadBody(why).at("file"))
        try:
            super().validate(robot, inputs)
        except (BadBody, MotionError) as error:
            wrong.append(error)
        refuse(wrong)

    @classmethod
    def shape(cls, given: Mapping[str, Any]) -> Mesh:
        """Its form."""
        return Mesh(given["file"], xyz("scale", given["scale"]))


def _no_mesh(file: Path) -> str:
    """Why a file is none of triangles; empty where it may be one."""
    if file.suffix.lower() not in _MESHES:
        return f"{file} is no STL, DAE or OBJ file"
    if not file.is_file():
        return f"there is no file {file}; a path counts from where armtree is started"
    return ""


class RemoveBody(Skill):
    """A body is gone from now on."""

    world_change = WorldChange.REMOVES

    INPUT_PORTS = {"body": _BODY}
    OUTPUT_PORTS: Ports = {}

    def on_start(self) -> Status:
        """Take it out of the world."""
        scene = self.context.scene
        scene.world = scene.world.without(self.get_input("body"))
        return Status.SUCCESS


class _HandOver(PlanningSkill, register=False):
    """A body moves with another link from now on."""

    world_change = WorldChange.HANDS_OVER

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
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
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
