"""The bodies of a world as pinocchio and coal see them."""

import os
from collections.abc import Iterator

import coal
import numpy as np
import pinocchio as pin

from skills.motion.errors import BadWorld, shown
from skills.motion.world import Body, Box, Cylinder, Mesh, Shape, Sphere, World

from .shapes import hull


def objects(
    kinematics: pin.Model, world: World
) -> Iterator[tuple[Body, pin.GeometryObject, pin.GeometryObject]]:
    """Every body, as it is and as the convex shape around it.

    Raises:
        BadWorld: A body moves with a link that is not there, or its mesh cannot be read.
    """
    for body in world.bodies:
        joint, frame, place = _seat(kinematics, body)
        shape = geometry(body.shape)
        exact = pin.GeometryObject(body.name, joint, frame, place, shape)
        if isinstance(body.shape, Mesh):
            try:
                around = hull([exact])
            except ValueError as error:
                raise BadWorld(f"The mesh {body.shape.path} is no body: {error}") from error
            outer = pin.GeometryObject(body.name, joint, frame, pin.SE3.Identity(), around)
        else:
            outer = exact
        yield body, exact, outer


def files(world: World) -> list[tuple[int, ...] | None]:
    """What tells that the file of a mesh was written anew; None for one that is not there."""
    return [_stamp(body.shape.path) for body in world.bodies if isinstance(body.shape, Mesh)]


def frame_of(kinematics: pin.Model, link: str) -> int:
    """Index of a link's frame; of the root's for the empty name.

    Raises:
        BadWorld: There is no such link.
    """
    if not isinstance(link, str):
        raise BadWorld(f"The link is {shown(link)}; give a name, or none")
    if not link:
        return 0
    bodies = [frame.name for frame in kinematics.frames if frame.type == pin.FrameType.BODY]
    if link not in bodies:
        raise BadWorld(f"There is no link {link}; there are {', '.join(bodies)}")
    return int(kinematics.getFrameId(link, pin.FrameType.BODY))


def placed(body: Body) -> pin.SE3:
    """Where a body is in the frame of its link."""
    return pin.XYZQUATToSE3(np.array((*body.position, *body.rotation)))


def geometry(shape: Shape) -> coal.CollisionGeometry:
    """The shape that coal checks.

    Raises:
        BadWorld: It is a mesh that cannot be read.
    """
    match shape:
        case Box(size):
            return coal.Box(*size)
        case Sphere(radius):
            return coal.Sphere(radius)
        case Cylinder(radius, length):
            return coal.Cylinder(radius, length)
        case Mesh(path, scale):
            try:
                return coal.MeshLoader().load(path, np.array(scale))
            except (RuntimeError, ValueError) as error:
                why = str(error).partition("message: ")[2].splitlines() or [str(error)]
                raise BadWorld(f"The mesh {path} cannot be read: {why[0]}") from error


def _stamp(path: str) -> tuple[int, ...] | None:
    try:
        found = os.stat(path)
    except (OSError, ValueError):  # whoever loads it says so
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


def _seat(kinematics: pin.Model, body: Body) -> tuple[int, int, pin.SE3]:
    """Joint and frame that a body moves with, and its place in the frame of the joint."""
    try:
        index = frame_of(kinematics, body.link)
    except BadWorld as error:
        raise BadWorld(f"{body.name} moves with {body.link}: {error}") from error
    frame = kinematics.frames[index]
    return frame.parentJoint, index, frame.placement * placed(body)
