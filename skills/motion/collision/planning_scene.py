"""The planning scene: robot and bodies as pinocchio and coal check them for collisions.

It corresponds to MoveIt's PlanningScene: robot model, world, and pairs of shapes that may touch.
"""

import dataclasses
from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import CollisionRules, Robot
from skills.motion.arrays import Array, Mask
from skills.motion.errors import BadWorld
from skills.motion.robot_model.motion_bounds import travel_bounds
from skills.motion.robot_model.robot_model import FLOOR, RobotModel
from skills.motion.world import EMPTY, Body, Box, Cylinder, Mesh, Sphere, World, mesh_stamps

from .body_meshes import BodyMesh, BodyMeshes, located

# Largest numbers of pairs of hulls and of exact shapes. At both limits, a planner needs 1 GB.
MAX_HULL_PAIRS, MAX_EXACT_PAIRS = 10_000, 40_000
_STEP = 8  # known geometries have multiples of this number of shapes


class ShapePairs(NamedTuple):
    """Pairs of shapes of two links.

    Attributes:
        geometry: The shapes.
        pairs: Pairs of the geometry.
        meshed: True if some of them are meshes.
    """

    geometry: pin.GeometryModel
    pairs: list[int]
    meshed: bool


class BroadPairs(NamedTuple):
    """Shapes and pairs for the broad phase.

    Attributes:
        geometry: The shapes, and the pairs to check.
        ends: Indices of the two shapes of each pair (P, 2).
        numbers: Index of each pair among the pairs of `PlanningScene.hulls` (P,).
    """

    geometry: pin.GeometryModel
    ends: NDArray[np.intp]
    numbers: NDArray[np.intp]

    def part(self, chosen: Mask) -> "BroadPairs":
        """Return a geometry of only some of the pairs (P,)."""
        return BroadPairs(*part_of(self.geometry, self.ends[chosen]), self.numbers[chosen])


class PlanningScene:
    """Collision geometry of a robot in a world.

    It holds two geometries. In `exact`, each primitive or mesh of the URDF is one shape. In `hulls`
    each link is one convex hull, so there are far fewer pairs. If two hulls keep a distance, so do
    the shapes in them.

    Args:
        robot: The robot.
        world: Bodies around the robot and attached to it. Default: none.
        robot_model: Model of the same robot. Default: a new one, read from the URDF.
        meshes: Meshes of earlier scenes, which are not read again. Default: none.

    Attributes:
        robot_model: Model of the robot.
        kinematics: pinocchio's model of the robot, from `robot_model`.
        exact: Geometry of primitives and meshes.
        hulls: Geometry of convex hulls.
        hull_pairs: `hulls` with its pairs.
        triangle_pairs: The same pairs, with the triangles of each hollow mesh of the world, such as
            a room, in place of its hull; None without such a mesh. Against the floor, hulls are
            enough; see `exact_pairs_of`.
        exact_links: Link or body of each shape of `exact`, or `floor`.
        hull_links: Link or body of each hull, or `floor`.
        volumes: Volume inside each mesh of `exact`, by the mesh's index.
        hollow: Names of the bodies with a hollow mesh.
        lever_arms: Bounds on the travel of each pair of `hulls` per unit of each actuated joint
            (P, A) [m/rad]; see `motion_bounds`.

    Raises:
        ModelUnusable: pinocchio cannot read the URDF.
        BadWorld: A body names an unknown link or body, a body has the name of a link, a mesh cannot
            be read, or there are too many pairs to check.
    """

    def __init__(
        self,
        robot: Robot,
        world: World = EMPTY,
        robot_model: RobotModel | None = None,
        meshes: BodyMeshes | None = None,
    ) -> None:
        # Read before the meshes are read, so that later changes of a file are noticed.
        self._mesh_stamps = mesh_stamps(world)
        self.robot_model = model = robot_model or RobotModel(robot)
        self.kinematics = model.kinematics
        self._bodies = {body.name: body for body in world.bodies}
        self._check_names()
        others = [*self._bodies, *([FLOOR] if robot.collision.floor is not None else ())]
        self.exact_links, self.hull_links = model.exact_links + others, model.hull_links + others
        shapes, hulls = list(model.exact), list(model.hulls)
        volumes, arms = list(model.volumes), list(model.lever_arms)
        meshes = meshes or BodyMeshes()
        self._loaded = list[BodyMesh]()  # later scenes share these as long as this one exists
        hollow = dict[int, pin.GeometryObject]()
        for number, body in enumerate(world.bodies):
            with located(number):
                exact, hull, mesh = self._body_shapes(body, meshes)
            if mesh:
                self._loaded.append(mesh)
                if mesh.hollow:
                    hollow[len(hulls)] = exact
            shapes.append(exact)
            hulls.append(hull)
            volumes.append(mesh.volume if mesh else None)
            arms.append(model.lever_arms_of(hull))
        self.volumes = {i: volume for i, volume in enumerate(volumes) if volume}
        self.hollow = frozenset(self.hull_links[hull] for hull in hollow)
        if robot.collision.floor is not None:
            half = coal.Halfspace(np.array([0.0, 0.0, 1.0]), robot.collision.floor)
            half.computeLocalAABB()
            floor = pin.GeometryObject(FLOOR, 0, 0, pin.SE3.Identity(), half)
            shapes.append(floor)
            hulls.append(floor)
        self.exact, self.hulls = geometry_of(shapes), geometry_of(hulls)
        checked = self._checked_links(robot.collision)
        self._exact_ends = self._add_pairs(self.exact, checked, MAX_EXACT_PAIRS)
        self._hull_ends = self._add_pairs(self.hulls, checked, MAX_HULL_PAIRS)
        numbers = np.arange(len(self._hull_ends))
        self.hull_pairs = BroadPairs(self.hulls, self._hull_ends, numbers)
        self.triangle_pairs = self._with_triangles(hollow) if hollow else None
        arms += [model.floor_lever_arms] * (len(hulls) - len(arms))
        self.lever_arms = travel_bounds(robot, arms, self._hull_ends)

    def is_current(self, world: World) -> bool:
        """Return True if no mesh file of the scene's world changed since the scene was built."""
        return self._mesh_stamps == mesh_stamps(world)

    def ends(self, geometry: pin.GeometryModel) -> NDArray[np.intp]:
        """Return the indices of the two shapes of each pair of a geometry (P, 2).

        To ask pinocchio would take microseconds for each pair.
        """
        return self._exact_ends if geometry is self.exact else self._hull_ends

    def linked_pairs(self, geometry: pin.GeometryModel) -> list[tuple[str, str]]:
        """Return the two links of each pair of a geometry."""
        links = self._links(geometry)
        return [(links[first], links[second]) for first, second in self.ends(geometry).tolist()]

    def is_body(self, name: str) -> bool:
        """Return True for the name of a body of the world, and False for that of a link."""
        return name in self._bodies

    def exact_pairs_of(self, pair: int) -> ShapePairs:
        """Return the pairs of exact shapes for two links, given by their pair of `hulls`.

        For meshes and the floor, it returns the pair of hulls: a mesh touches the floor exactly if
        its hull touches the floor, and coal checks a hull a hundred times faster.
        """
        links = [self.hull_links[hull] for hull in self._hull_ends[pair]]
        pairs = np.flatnonzero(self.hull_pairs_of_exact == pair).tolist()
        shapes = set(self._exact_ends[pairs].ravel().tolist())
        meshes = self.volumes.keys() & shapes
        if FLOOR in links and len(meshes) == len(shapes) - 1:
            return ShapePairs(self.hulls, [pair], False)
        return ShapePairs(self.exact, pairs, bool(meshes))

    @cached_property
    def hull_pairs_of_exact(self) -> NDArray[np.intp]:
        """For each pair of `exact`, the pair of `hulls` with the same two links."""
        rows = {link: row for row, link in enumerate(self.hull_links)}
        links = np.array([rows[link] for link in self.exact_links], np.intp)
        numbers = np.zeros((len(rows), len(rows)), np.intp)
        first, second = self._hull_ends.T
        numbers[first, second] = numbers[second, first] = np.arange(len(first))
        first, second = links[self._exact_ends].T
        pairs: NDArray[np.intp] = numbers[first, second]
        return pairs

    def _links(self, geometry: pin.GeometryModel) -> list[str]:
        return self.exact_links if geometry is self.exact else self.hull_links

    def attached(self, body: Body, link: str, configuration: Array) -> Body:
        """Return a body at the same pose, attached to another link.

        Args:
            body: The body.
            link: The link; empty for the root frame.
            configuration: All actuated joints (A,) [rad].

        Raises:
            BadWorld: The robot has no such link.
        """
        model, data = self.robot_model, self.kinematics.createData()
        frames = [model.frame_index(name) for name in (body.link, link)]
        q = model.coordinates(configuration[None, :])[:, 0]
        pin.framesForwardKinematics(self.kinematics, data, q)
        before, after = (data.oMf[frame] for frame in frames)
        x, y, z, *rotation = pin.SE3ToXYZQUAT(after.actInv(before * placement(body))).tolist()
        a, b, c, d = (np.array(rotation) / np.linalg.norm(rotation)).tolist()
        return dataclasses.replace(body, position=(x, y, z), rotation=(a, b, c, d), link=link)

    def _body_shapes(
        self, body: Body, meshes: BodyMeshes
    ) -> tuple[pin.GeometryObject, pin.GeometryObject, BodyMesh | None]:
        """Return the exact shape of a body, its hull, and its mesh if it has one."""
        try:
            frame = self.robot_model.frame_index(body.link)
        except BadWorld as error:
            raise BadWorld(f"{body.name} is attached to {body.link}: {error}", "link") from error
        parent = self.kinematics.frames[frame]
        joint, pose = parent.parentJoint, parent.placement * placement(body)

        def placed(shape: coal.CollisionGeometry) -> pin.GeometryObject:
            return pin.GeometryObject(body.name, joint, frame, pose, shape)

        if isinstance(body.shape, Mesh):
            with located("mesh"):
                mesh = meshes.load(body.shape)
            return placed(mesh.shape), placed(mesh.hull), mesh
        primitive = _primitive(body.shape)
        primitive.computeLocalAABB()  # coal needs the box of each shape for its first guess
        exact = placed(primitive)
        return exact, exact, None

    def _with_triangles(self, hollow: dict[int, pin.GeometryObject]) -> BroadPairs:
        """Return the pairs of hulls, with triangles in place of some hulls.

        In a pair of two hollow meshes, one remains a hull: that on the later joint.

        Args:
            hollow: Triangles of each hollow mesh, by the index of its hull.
        """
        hulls, ends = list(self.hulls.geometryObjects), self._hull_ends.copy()
        floor = self.hull_links.index(FLOOR) if FLOOR in self.hull_links else -1
        left = (ends != floor).all(axis=1)
        for hull in sorted(hollow, key=lambda hull: hulls[hull].parentJoint):
            rows = left & (ends == hull).any(axis=1)
            ends[rows, 0] = ends[rows].sum(axis=1) - hull
            ends[rows, 1] = len(hulls)
            hulls.append(hollow[hull])
            left &= ~rows
        order = np.lexsort(ends.T[::-1])
        return BroadPairs(*part_of(geometry_of(hulls), ends[order]), order)

    def _check_names(self) -> None:
        links = self.robot_model.links.keys() | {FLOOR}
        taken, there = self.robot_model.names | links, links | self._bodies.keys()
        for number, (name, body) in enumerate(self._bodies.items()):
            if name in taken:
                why = f"The robot already has a {name}; rename the body"
                raise BadWorld(why, number, "name")
            for other in sorted(body.touches - there):
                what = f"{name} may touch {other}, but there is no such link or body"
                why = f"{what}; choose from {', '.join(sorted(there - {name}))}"
                raise BadWorld(why, number, "touches")

    def _add_pairs(self, geometry: pin.GeometryModel, checked: Mask, most: int) -> NDArray[np.intp]:
        """Set the pairs of shapes to check. Return the indices of their two shapes (P, 2).

        Args:
            geometry: The shapes.
            checked: True for each pair of `hull_links` to check (H, H).
            most: Largest number of pairs.

        Raises:
            BadWorld: There are more than `most` pairs.
        """
        rows = {link: row for row, link in enumerate(self.hull_links)}
        links = np.array([rows[link] for link in self._links(geometry)], dtype=np.intp)
        pairs = np.triu(checked[np.ix_(links, links)], 1)
        ends = np.argwhere(pairs)
        if len(ends) > most:
            parts = len(geometry.geometryObjects) - len(self._bodies)
            raise BadWorld(
                f"{parts} shapes of the robot and {len(self._bodies)} bodies give more than "
                f"{most} pairs to check; give fewer bodies, or list pairs of links that can "
                "never touch as `allowed` in the robot file"
            )
        geometry.setCollisionPairs(pairs, True)
        return ends

    def _checked_links(self, rules: CollisionRules) -> Mask:
        """Return a symmetric matrix of all `hull_links`: True for each pair to check (H, H)."""
        links = self.hull_links
        joints = np.array([hull.parentJoint for hull in self.hulls.geometryObjects], dtype=np.intp)
        rows = {link: row for row, link in enumerate(links)}
        # Hulls on one joint never move against each other.
        checked: Mask = joints[:, None] != joints
        if rules.floor is not None:
            static = [name in self._bodies and not j for name, j in zip(links, joints, strict=True)]
            ignored = [link in rules.floor_ignores for link in links]
            checked[-1] = checked[:, -1] = ~np.logical_or(static, ignored)
            checked[-1, -1] = False
        touches = [(body.name, link) for body in self._bodies.values() for link in body.touches]
        pairs = [*touches, *(pair for pair in rules.allowed if FLOOR not in pair)]
        ends = [[rows[link] for link in pair if link in rows] for pair in pairs]
        allowed = np.array([pair for pair in ends if len(pair) == 2], dtype=np.intp).reshape(-1, 2)
        first, second = allowed.T
        checked[first, second] = checked[second, first] = False
        return checked


def geometry_of(shapes: Sequence[pin.GeometryObject]) -> pin.GeometryModel:
    """Return a geometry with some shapes, and without pairs.

    To add a shape, pinocchio copies a matrix of all pairs: 400 shapes take 15 ms. To replace the
    shapes of another geometry takes 1 ms. So the first shapes replace those of a known geometry.
    """
    known = len(shapes) // _STEP * _STEP
    geometry = _of_size(known).copy()
    for place, shape in enumerate(shapes[:known]):
        geometry.geometryObjects[place] = shape
    for shape in shapes[known:]:
        geometry.addGeometryObject(shape)
    return geometry


@lru_cache(maxsize=4)
def _of_size(count: int) -> pin.GeometryModel:
    """Return a geometry with that many equal shapes, a multiple of `_STEP`."""
    if not count:
        return pin.GeometryModel()
    geometry = _of_size(count - _STEP).copy()
    for _ in range(_STEP):
        shape = pin.GeometryObject("", 0, 0, pin.SE3.Identity(), coal.Sphere(1.0))
        geometry.addGeometryObject(shape)
    return geometry


def part_of(
    geometry: pin.GeometryModel, ends: NDArray[np.intp]
) -> tuple[pin.GeometryModel, NDArray[np.intp]]:
    """Return a new geometry with only some pairs of another one, and with only their shapes.

    Args:
        geometry: The other geometry, with all shapes.
        ends: Indices of the two shapes of each pair to keep, in the order of its pairs (P, 2).

    Returns:
        The new geometry, and the indices of the two shapes of each pair in it (P, 2).
    """
    used, places = np.unique(ends, return_inverse=True)
    part = geometry_of([geometry.geometryObjects[shape] for shape in used.tolist()])
    checked, places = np.zeros((len(used), len(used)), bool), places.reshape(ends.shape)
    checked[tuple(places.T)] = True
    part.setCollisionPairs(checked, True)
    return part, places


def placement(body: Body) -> pin.SE3:
    """Return the pose of a body in the frame of its link."""
    return pin.XYZQUATToSE3(np.array((*body.position, *body.rotation)))


def _primitive(shape: Box | Sphere | Cylinder) -> coal.CollisionGeometry:
    match shape:
        case Box(size):
            return coal.Box(*size)
        case Sphere(radius):
            return coal.Sphere(radius)
        case Cylinder(radius, length):
            return coal.Cylinder(radius, length)
