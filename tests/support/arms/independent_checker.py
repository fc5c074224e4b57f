"""Distances of an arm in a world, with coal and pinocchio only: no code of the planner decides."""

from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import Robot
from skills.motion import Body, Box, Cylinder, Sphere, World

Array = NDArray[np.float64]
_FLOOR = 1.0  # thickness [m]


class IndependentChecker:
    """Checks configurations, one exact shape against another.

    Args:
        robot: The arm, by its URDF and the rules of its robot file.
        world: Boxes, spheres and cylinders in the root frame.

    Attributes:
        model: Kinematics; joints that mimic others have coordinates of their own.
        data: Working memory for the model.
        shapes: Links, bodies and the floor.
    """

    def __init__(self, robot: Robot, world: World) -> None:
        self.robot, urdf = robot, str(robot.urdf)
        self.model = pin.buildModelFromUrdf(urdf)
        self.data = self.model.createData()
        folders = [str(folder) for folder in robot.urdf.parents]
        kind = pin.GeometryType.COLLISION
        self.shapes = pin.buildGeomFromUrdf(self.model, urdf, kind, None, folders)
        links = [self.model.frames[s.parentFrame].name for s in self.shapes.geometryObjects]
        for body in world.bodies:
            links.append(body.name)
            pose = pin.XYZQUATToSE3(np.array((*body.position, *body.rotation)))
            self._add(body.name, pose, _shape(body))
        rules = robot.collision
        if rules.floor is not None:
            links.append("floor")
            pose = pin.SE3(np.eye(3), np.array((0.0, 0.0, rules.floor - 0.5 * _FLOOR)))
            self._add("floor", pose, coal.Box(10.0, 10.0, _FLOOR))
        joints = [shape.parentJoint for shape in self.shapes.geometryObjects]
        bodies = {body.name for body in world.bodies}
        for i, j in combinations(range(len(links)), 2):
            names = {links[i], links[j]}
            # The base of an arm may be too close to the floor.
            moves = joints[i] != joints[j] or ("floor" in names and not names & bodies)
            ignored = "floor" in names and names & rules.floor_ignores
            if moves and not ignored and names not in rules.allowed:
                self.shapes.addCollisionPair(pin.CollisionPair(i, j))
        self._pool = pin.GeometryPool(self.model, self.shapes, 1)

    def coordinates(self, rows: Array) -> Array:
        """Return pinocchio's coordinates (nq, N) of all actuated joints (N, A)."""
        own = dict(zip([joint.name for joint in self.robot.actuated], rows.T, strict=True))
        q = np.zeros((self.model.nq, len(rows)), order="F")
        for joint in self.robot.joints:
            values = own[joint.mimic.leader] if joint.mimic else own[joint.name]
            if joint.mimic:
                values = joint.mimic.multiplier * values + joint.mimic.offset
            place = self.model.joints[self.model.getJointId(joint.name)]
            both = np.array([np.cos(values), np.sin(values)]) if place.nq == 2 else values[None]
            q[place.idx_q : place.idx_q + place.nq] = both
        return q

    def hits(self, rows: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return True for each row in which two shapes are closer than a margin [m] (N,)."""
        placed = self._pool.getGeometryData(0)
        for request in placed.collisionRequests:
            request.security_margin = margin
        q = self.coordinates(rows)
        return np.array(pin.computeCollisionsInParallel(1, self._pool, q, True, False), bool)

    def _add(self, name: str, pose: pin.SE3, shape: coal.CollisionGeometry) -> None:
        self.shapes.addGeometryObject(pin.GeometryObject(name, 0, 0, pose, shape))


def _shape(body: Body) -> coal.CollisionGeometry:
    match body.shape:
        case Box(size):
            return coal.Box(*size)
        case Sphere(radius):
            return coal.Sphere(radius)
        case Cylinder(radius, length):
            return coal.Cylinder(radius, length)
    raise ValueError(f"{body.name} is a {type(body.shape).__name__}, which is not checked here")
