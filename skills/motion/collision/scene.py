"""The robot as pinocchio sees it: its joints, its shapes, and which pairs of shapes are checked."""

from collections.abc import Iterator
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import CollisionRules, Robot
from skills.motion.errors import BadWorld
from skills.motion.kinematics.lever_arms import travel_bounds
from skills.motion.kinematics.robot_model import RobotModel
from skills.motion.world import EMPTY, World

from .bodies import objects
from .solid import solid_of

Array = NDArray[np.float64]

FLOOR = "floor"


class PlanningScene:
    """Kinematics and geometry of a robot in a world.

    There are two geometries. In the exact one every primitive of the URDF is a shape; in the outer
    one each link is the convex hull around its primitives, far fewer pairs. Where the outer shapes
    keep a distance, so do the exact ones.

    Args:
        robot: The robot.
        world: What stands around it, and what it holds.
        links: The robot's, where they are at hand.

    Attributes:
        joints: Names of the actuated joints, the columns of all configurations (A).
        units: Of their values (A).
        kinematics: pinocchio's model; followers share the coordinate of the joint they follow.
        exact: Geometry of the primitives.
        outer: Geometry of the hulls.
        solids: What each mesh of `exact` encloses, by its index.
        levers: How far the two of each pair of `outer` can move against each other (P, A) [m/rad];
            see `reach`.

    Raises:
        ModelUnusable: pinocchio cannot read the URDF.
        BadWorld: A body names a link or body that is not there, or takes the name of one.
    """

    def __init__(self, robot: Robot, world: World = EMPTY, links: RobotModel | None = None) -> None:
        links = links or RobotModel(robot)
        self.joints = tuple(joint.name for joint in robot.actuated)
        self.units = tuple(joint.unit for joint in robot.actuated)
        self.kinematics = links.kinematics
        self._bodies = {body.name: body for body in world.bodies}
        self.exact, self.outer, found = (
            pin.GeometryModel(),
            pin.GeometryModel(),
            [*links.lever_arms],
        )
        for shape in links.exact:
            self.exact.addGeometryObject(shape)
        for shape in links.outer:
            self.outer.addGeometryObject(shape)
        self._check_names()
        solids = list(links.solids)
        for _, exact, outer in objects(self.kinematics, world):
            self.exact.addGeometryObject(exact)
            self.outer.addGeometryObject(outer)
            found.append(links.lever_arms_of(outer))
            solids.append(solid_of(exact.geometry))
        self.solids = {i: solid for i, solid in enumerate(solids) if solid}
        for geometry in (self.exact, self.outer):
            self._add_floor(geometry, robot.collision)
            self._add_pairs(geometry, robot.collision)
            for shape in geometry.geometryObjects:
                shape.geometry.computeLocalAABB()  # coal guesses from it where two shapes face
        found += [links.floor_lever_arms] * (
            len(self.outer.geometryObjects) - len(found)
        )  # of the floor
        self.lever_arms = travel_bounds(robot, found, self.outer.collisionPairs)
        ids = map(self.kinematics.getJointId, self.joints)
        self._places = [self.kinematics.joints[joint].idx_q for joint in ids]
        # Whether pinocchio's coordinates are the configuration itself.
        self._plain = self._places == list(range(self.kinematics.nq))

    def coordinates(self, configurations: Array) -> Array:
        """Of configurations (N, A) [rad], as pinocchio wants them: (nq, N), column-major."""
        if self._plain:
            return np.ascontiguousarray(configurations).T
        q = np.zeros((self.kinematics.nq, len(configurations)), order="F")
        q[self._places] = configurations.T
        return q

    def link(self, geometry: pin.GeometryModel, index: int) -> str:
        """The link or body that a shape belongs to; `floor` for the floor."""
        shape = geometry.geometryObjects[index]
        if shape.name == FLOOR or self.is_body(geometry, index):
            return str(shape.name)
        return str(self.kinematics.frames[shape.parentFrame].name)

    def is_body(self, geometry: pin.GeometryModel, index: int) -> bool:
        """Whether a shape is a body of the world, not a part of the robot."""
        return geometry.geometryObjects[index].name in self._bodies

    def between(self, pair: pin.CollisionPair) -> pin.GeometryModel:
        """The primitives of the two links of a pair of `outer`, and their pairs.

        The floor meets meshes where it meets their hull, which coal tells a hundred times as soon.
        """
        links = {self.link(self.outer, index) for index in (pair.first, pair.second)}
        shapes = range(len(self.exact.geometryObjects))
        chosen = [index for index in shapes if self.link(self.exact, index) in links]
        geometry = pin.GeometryModel()
        if FLOOR in links and len(self.solids.keys() & set(chosen)) == len(chosen) - 1:
            for index in (pair.first, pair.second):
                geometry.addGeometryObject(self.outer.geometryObjects[index])
            geometry.addCollisionPair(pin.CollisionPair(0, 1))
            return geometry
        for index in chosen:
            geometry.addGeometryObject(self.exact.geometryObjects[index])
        for each in self.exact.collisionPairs:
            if each.first in chosen and each.second in chosen:
                ends = chosen.index(each.first), chosen.index(each.second)
                geometry.addCollisionPair(pin.CollisionPair(*ends))
        return geometry

    def _check_names(self) -> None:
        frames = self.kinematics.frames
        links = {frame.name for frame in frames if frame.type == pin.FrameType.BODY} | {FLOOR}
        shapes = {shape.name for shape in self.exact.geometryObjects}
        taken = {frame.name for frame in frames} | links | shapes
        for name, body in self._bodies.items():
            if name in taken:
                raise BadWorld(f"The robot has a {name} already; give the body another name")
            for other in sorted(body.touches - links - self._bodies.keys()):
                what = f"{name} may touch {other}, but there is no such link or body"
                there = links | self._bodies.keys() - {name}
                raise BadWorld(f"{what}; there are {', '.join(sorted(there))}")

    def _add_floor(self, geometry: pin.GeometryModel, rules: CollisionRules) -> None:
        if rules.floor is not None:
            half = coal.Halfspace(np.array([0.0, 0.0, 1.0]), rules.floor)
            geometry.addGeometryObject(pin.GeometryObject(FLOOR, 0, 0, pin.SE3.Identity(), half))

    def _add_pairs(self, geometry: pin.GeometryModel, rules: CollisionRules) -> None:
        for first, second in self._pairs(geometry, rules):
            geometry.addCollisionPair(pin.CollisionPair(first, second))

    def _pairs(
        self, geometry: pin.GeometryModel, rules: CollisionRules
    ) -> Iterator[tuple[int, int]]:
        """Pairs of shapes that may not touch."""
        joints = [shape.parentJoint for shape in geometry.geometryObjects]
        links = [self.link(geometry, i) for i in range(len(joints))]
        for i, j in combinations(range(len(links)), 2):
            pair = frozenset((links[i], links[j]))
            if FLOOR in pair:
                stands = (pair & self._bodies.keys()) and joints[i] == joints[j]
                wanted = not (pair & rules.floor_ignores or stands)
            else:  # shapes on one joint never move against each other
                wanted = joints[i] != joints[j] and pair not in rules.allowed
            if wanted and not self._may_touch(links[i], links[j]):
                yield i, j

    def _may_touch(self, first: str, second: str) -> bool:
        """Whether a body allows the contact."""
        return any(
            name in self._bodies and other in self._bodies[name].touches
            for name, other in ((first, second), (second, first))
        )
