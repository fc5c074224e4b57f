"""Leaves that change the world: add, remove, attach and detach bodies."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills.base import Skill, WorldChange
from skills.errors import BadBody, refuse
from skills.joint_targets import link_errors
from skills.motion.errors import BadWorld, MotionError
from skills.motion.query import Carry, Result
from skills.motion.world import Body, Box, Cylinder, Mesh, Shape, Sphere, quaternion
from skills.planning_skill import PlanningSkill
from skills.ports import MOST_REACHES, ORIGIN, Port, vector, xyz

Ports = dict[str, PortInformation]

_MESHES = (".stl", ".dae", ".obj")
_LEAST = 1e-6  # smallest length [m]
_SIZES = ("size", "radius", "length")


def _length(name: str) -> Port:
    return Port(float, description=f"{name} [m]", unit="m", least=_LEAST)


_BODY = PortInformation(str, description="name of the body")
_PLACE: Ports = {
    "body": _BODY,
    "position": vector("x, y, z of the body's centre in the frame of the robot's root [m]", "m"),
    "rotation": vector("rotation about the fixed axes x, then y, then z [rad]", "rad", ORIGIN),
    "touches": PortInformation(
        list[str], default_value=[], description="links, bodies or floor that the body may touch"
    ),
}


class _Add(Skill, register=False):
    """Add a body to the world, or replace the body of the same name.

    Attributes:
        form: Class of the body's shape. Its arguments are the inputs that are not in `_PLACE`.
    """

    world_change = WorldChange.ADDS
    form: ClassVar[Callable[..., Shape]]

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the body if all inputs are known. Check that known lengths are not too large."""
        cls.body(inputs)
        most = MOST_REACHES * robot.reach
        errors = []
        for port in cls.INPUT_PORTS.keys() & inputs.keys() & {"position", *_SIZES}:
            value = inputs[port]
            largest = max(map(abs, value)) if isinstance(value, list) else abs(value)
            if largest > most > 0:
                far = f"{port} {largest:g} m is far beyond the reach of this arm"
                errors.append(BadBody(f"{far}, {robot.reach:.2g} m").at(port))
        refuse(errors)

    @classmethod
    def body(cls, inputs: Mapping[str, Any]) -> Body | None:
        """Return the body, or None if an input is not known."""
        if any(port not in inputs for port in cls.INPUT_PORTS):
            return None
        rotation = xyz("rotation", inputs["rotation"])
        if not all(map(math.isfinite, rotation)):
            why = f"the rotation of {inputs['body']} is not finite; give radians"
            raise BadBody(why).at("rotation")
        sizes = {port: inputs[port] for port in cls.INPUT_PORTS if port not in _PLACE}
        vectors = {port: xyz(port, size) for port, size in sizes.items() if isinstance(size, list)}
        return Body(
            inputs["body"],
            cls.form(*(sizes | vectors).values()),
            xyz("position", inputs["position"]),
            quaternion(*rotation),
            touches=frozenset(inputs["touches"]),
        )

    def on_start(self) -> Status:
        """Add the body."""
        scene = self.context.scene
        body = self.body({port: self.get_input(port) for port in self.INPUT_PORTS})
        assert body
        scene.world = scene.world.adding(body)
        return Status.SUCCESS


class AddBox(_Add):
    """Add a box to the world."""

    form = Box
    INPUT_PORTS = {**_PLACE, "size": vector("edges along x, y and z [m]", "m", least=_LEAST)}


class AddSphere(_Add):
    """Add a sphere to the world."""

    form = Sphere
    INPUT_PORTS = {**_PLACE, "radius": _length("radius")}


class AddCylinder(_Add):
    """Add a cylinder to the world. Before the rotation, its axis is the z axis."""

    form = Cylinder
    INPUT_PORTS = {**_PLACE, "radius": _length("radius"), "length": _length("length")}


class AddMesh(_Add):
    """Add a body with the shape of a mesh file to the world."""

    form = Mesh
    INPUT_PORTS = {
        **_PLACE,
        "file": PortInformation(
            str,
            description="STL, DAE or OBJ file; a closed mesh is solid, an open mesh is a surface",
        ),
        "scale": vector("size of a unit of the file in x, y, z [m]", "m", (1.0, 1.0, 1.0), _LEAST),
    }

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the file if its name is known, and check the other inputs."""
        errors: list[Exception] = []
        if "file" in inputs and (why := _file_error(Path(inputs["file"]))):
            errors.append(BadBody(why).at("file"))
        try:
            super().validate(robot, inputs)
        except (BadBody, MotionError) as error:
            errors.append(error)
        refuse(errors)


def _file_error(file: Path) -> str:
    """Return the error of a mesh file as words, or "" if the file exists and has a known suffix."""
    if file.suffix.lower() not in _MESHES:
        return f"{file} is not an STL, DAE or OBJ file"
    if not file.is_file():
        return f"there is no file {file}; paths are relative to the working directory"
    return ""


class RemoveBody(Skill):
    """Remove a body from the world."""

    world_change = WorldChange.REMOVES

    INPUT_PORTS = {"body": _BODY}

    def on_start(self) -> Status:
        """Remove the body."""
        scene = self.context.scene
        scene.world = scene.world.without(self.get_input("body"))
        return Status.SUCCESS


class _SetParent(PlanningSkill, register=False):
    """A skill that attaches a body to another link, at its current pose."""

    world_change = WorldChange.ATTACHES

    def set_parent(self, link: str) -> Status:
        """Request the body, attached to another link, from a worker. Return RUNNING.

        Args:
            link: Name of the new link; "" for the robot's root.
        """
        scene, name = self.context.scene, self.get_input("body")
        scene.world.body(name)
        return self.request(
            Carry(scene.world, name, link, self.context.arm.commanded, self.context.timeout)
        )

    def on_answer(self, answer: Result) -> Status:
        """Replace the body in the world by the body that the worker returned."""
        if isinstance(answer, MotionError):
            raise answer
        assert isinstance(answer, Body)
        self.context.scene.world = self.context.scene.world.replacing(answer)
        return Status.SUCCESS


class Attach(_SetParent):
    """Attach a body to a link, as after a grasp. The body then moves with the link."""

    INPUT_PORTS = {"body": _BODY, "link": PortInformation(str, description="link for the body")}

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check that the robot has the link, if its name is known."""
        if "link" in inputs:
            refuse(link_errors(robot, "link", inputs["link"]))

    def on_start(self) -> Status:
        """Attach the body at its current pose."""
        return self.set_parent(self.get_input("link"))


class Detach(_SetParent):
    """Detach a body from its link. The body stays at its current pose."""

    INPUT_PORTS = {"body": _BODY}

    def on_start(self) -> Status:
        """Detach the body from its link.

        Raises:
            BadWorld: The body is not attached to a link.
        """
        body = self.context.scene.world.body(self.get_input("body"))
        if not body.link:
            raise BadWorld(f"{body.name} is attached to no link; attach it before")
        return self.set_parent("")
