"""The robot for pinocchio: joints, collision shapes of its links, and their lever arms."""

import math
import re
import sys
from collections import Counter
from collections.abc import Iterator

import coal
import numpy as np
import pinocchio as pin

from hardware import Robot
from skills.motion.arrays import Array
from skills.motion.errors import BadWorld, ModelUnusable, shown
from skills.motion.validation import MAX_MAGNITUDE, is_number

from .geometry import EnclosedVolume, convex_hull
from .motion_bounds import LeverArms, floor_lever_arms, joint_axes, lever_arms

FLOOR = "floor"  # name of the floor among the links
# Joints that move, and collision shapes, of a robot that is planned for within seconds.
_MAX_MOVING, _MAX_SHAPES = 100, 1000
_LEAST_RATE = 1e-9  # smallest limit of velocity and acceleration of a joint [rad/s, rad/s2]


class RobotModel:
    """Model of a robot without the world around it.

    Args:
        robot: The robot.

    Attributes:
        joints: Names of the actuated joints, the columns of every configuration (A).
        units: Unit of the position of each joint: `rad` or `m` (A).
        kinematics: pinocchio's model. A mimic joint has no coordinate of its own. A continuous
            joint has its angle as its coordinate.
        exact: Collision shapes of the URDF: primitives and meshes.
        hulls: Convex hull of each link's shapes.
        exact_links: Name of the link of each shape in `exact`.
        hull_links: Name of the link of each hull in `hulls`.
        links: Index of the frame of each link.
        names: Names of all frames and shapes.
        volumes: Volume inside each shape of `exact`; None for a primitive.
        lever_arms: Lever arms of each hull in `hulls`; see `motion_bounds`.
        floor_lever_arms: Lever arms of the floor.

    Raises:
        ModelUnusable: A number of the robot is out of range, pinocchio cannot read the URDF or a
            shape, or a joint follows a joint that it carries.
    """

    def __init__(self, robot: Robot) -> None:
        _check_robot(robot)
        self._robot, urdf = robot, str(robot.urdf)
        self.joints = tuple(joint.name for joint in robot.actuated)
        self.units = tuple(joint.unit for joint in robot.actuated)
        try:
            described = robot.description
            for mistake in described.shape_mistakes(MAX_MAGNITUDE):
                raise mistake
            counts = described.shape_counts()
            if (shapes := sum(counts.values())) > _MAX_SHAPES:
                raise ValueError(f"it has {shapes} collision shapes; the limit is {_MAX_SHAPES}")
            # pinocchio parses the text again, because only its reader makes frames and shapes.
            text = described.text_with_meshes(robot.mesh)
            # In this model mimic joints have their own coordinates.
            self._free = pin.buildModelFromXML(text)
            _check_placements(robot, self._free)
            self.kinematics = _with_mimic_joints(robot, self._free)
            loader = coal.CachedMeshLoader()  # loads a file once, also for several links
            geometry = pin.buildGeomFromUrdfString(
                self.kinematics,
                text,
                pin.GeometryType.COLLISION,
                package_dirs="",
                mesh_loader=loader,
            )
            self.exact: list[pin.GeometryObject] = list(geometry.geometryObjects)
            self._check_counts(counts)
            self.hulls = self._link_hulls()
        except (OSError, RuntimeError, ValueError) as error:
            raise ModelUnusable(urdf, _cause(error)) from error
        for shape in self.exact + self.hulls:
            shape.geometry.computeLocalAABB()  # coal needs the boxes for its first guess
        frames = self.kinematics.frames
        self.links = {f.name: i for i, f in enumerate(frames) if f.type == pin.FrameType.BODY}
        if FLOOR in self.links:
            raise ModelUnusable(urdf, f"a link is named {FLOOR}, like the floor; rename the link")
        self.names = {frame.name for frame in frames} | {shape.name for shape in self.exact}
        self.exact_links = [frames[shape.parentFrame].name for shape in self.exact]
        self.hull_links = [frames[shape.parentFrame].name for shape in self.hulls]
        self.volumes = [EnclosedVolume.of(shape.geometry) for shape in self.exact]
        self._axes = joint_axes(self._free)
        self.floor_lever_arms = floor_lever_arms(self._free)
        self.lever_arms = [self.lever_arms_of(shape) for shape in self.hulls]
        ids = map(self.kinematics.getJointId, self.joints)
        self._columns = [self.kinematics.joints[joint].idx_q for joint in ids]
        self._same_order = self._columns == list(range(self.kinematics.nq))

    def coordinates(self, configurations: Array) -> Array:
        """Convert configurations (N, A) [rad] to pinocchio's coordinates (nq, N), column-major."""
        if self._same_order:
            return np.ascontiguousarray(configurations).T
        q = np.zeros((self.kinematics.nq, len(configurations)), order="F")
        q[self._columns] = configurations.T
        return q

    def frame_index(self, link: str) -> int:
        """Return the index of a link's frame, or of the root frame if the name is empty.

        Raises:
            BadWorld: The robot has no such link.
        """
        if not isinstance(link, str):
            raise BadWorld(f"The link is {shown(link)}; give the name of a link, or omit it")
        if not link:
            return 0
        if link not in self.links:
            raise BadWorld(f"There is no link {link}; the links are {', '.join(self.links)}")
        return self.links[link]

    def lever_arms_of(self, shape: pin.GeometryObject) -> LeverArms:
        """Return the lever arms of a shape on one of the joints."""
        joint = self._free.getJointId(self.kinematics.names[shape.parentJoint])
        return lever_arms(self._robot, self._free, self._axes, joint, shape)

    def _check_counts(self, counts: dict[str, int]) -> None:
        """Check that pinocchio read every shape. It silently drops shapes that it cannot parse."""
        found = Counter(self.kinematics.frames[shape.parentFrame].name for shape in self.exact)
        for link, count in counts.items():
            if found[link] != count:
                why = f"pinocchio reads {found[link]} of the {count} shapes of {link}"
                hint = "give plain numbers, separated by single spaces"
                raise ValueError(f"{why}; {hint}")

    def _link_hulls(self) -> list[pin.GeometryObject]:
        links = dict[int, list[pin.GeometryObject]]()
        for shape in self.exact:
            links.setdefault(shape.parentFrame, []).append(shape)
        return [self._link_hull(frame, shapes) for frame, shapes in links.items()]

    def _link_hull(self, frame: int, shapes: list[pin.GeometryObject]) -> pin.GeometryObject:
        name, joint = self.kinematics.frames[frame].name, shapes[0].parentJoint
        try:
            hull = convex_hull(shapes)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
        return pin.GeometryObject(name, joint, frame, pin.SE3.Identity(), hull)


def _cause(error: Exception) -> str:
    """Return pinocchio's message without coal's file and line."""
    said = re.search(r"Could not load resource (.*)\n(.*)", str(error))
    why = f"{said[1]} cannot be read as a mesh: {said[2]}" if said else str(error)
    return why.rstrip(".")


def _check_robot(robot: Robot) -> None:
    """Check the numbers of a Robot, which may not come from a robot file.

    Raises:
        ModelUnusable: A limit, the margin, the floor, a mimic joint or the tool is out of range, or
            there are too many joints.
    """
    if (count := len(robot.joints)) > _MAX_MOVING:
        why = f"it has {count} moving joints; the limit is {_MAX_MOVING}"
        raise ModelUnusable(str(robot.urdf), why)
    rules, path, most = robot.collision, str(robot.path), MAX_MAGNITUDE
    floor = 0.0 if rules.floor is None else rules.floor
    for what, value, least in (("margin", rules.margin, 0.0), ("floor", floor, -most)):
        if not is_number(value, least, most):
            wanted = f"give a number from {least:g} to {most:g}"
            raise ModelUnusable(path, f"the {what} is {shown(value)} m; {wanted}")
    for joint in robot.joints:
        if joint.mimic and not joint.mimic.multiplier:
            leader = joint.mimic.leader
            why = f"{joint.name} follows {leader} with multiplier 0; make it a fixed joint"
            raise ModelUnusable(path, why)
        limits = (joint.lower, joint.upper, joint.velocity, joint.acceleration)
        moves = all(is_number(limit, _LEAST_RATE, sys.float_info.max) for limit in limits[2:])
        reach = most if joint.unit == "m" else math.inf
        bounded = all(is_number(limit, -reach, reach) for limit in limits[:2])
        if not (moves and bounded and joint.lower <= joint.upper):
            texts = [f"{x:g}" if isinstance(x, float) else shown(x) for x in limits]
            why = f"{joint.name} has limits [{texts[0]}, {texts[1]}] {joint.unit}, "
            why += f"{texts[2]} {joint.unit}/s, {texts[3]} {joint.unit}/s2"
            if joint.unit == "m":
                why += f"; give limits in order, from {-most:g} to {most:g} m"
            raise ModelUnusable(path, why)
        mimic = joint.mimic
        if mimic and not all(abs(x) <= most for x in (mimic.multiplier, mimic.offset)):
            why = f"{joint.name} follows {mimic.leader} with multiplier {mimic.multiplier:g} and "
            why += f"offset {mimic.offset:g} {joint.unit}; give numbers up to {most:g}"
            raise ModelUnusable(path, why)
    if robot.tool and not all(abs(x) <= most for x in robot.tool.offset):
        offset = shown(robot.tool.offset)
        why = f"the tool's offset is {offset} m; give numbers up to {most:g}"
        raise ModelUnusable(path, why)


def _check_placements(robot: Robot, free: pin.Model) -> None:
    """Check that every joint is connected to the root, at a valid distance from its parent.

    Raises:
        ValueError: A joint is not connected, or it is too far away.
    """
    for joint in robot.joints:
        if not free.existJointName(joint.name):
            why = f"{joint.name} is not connected to {free.frames[1].name}; connect its parent link"
            raise ValueError(why)
    for name, placement in zip(free.names, free.jointPlacements, strict=True):
        off = abs(placement.translation).max()
        if off > MAX_MAGNITUDE:
            why = f"{name} is {off:g} m from its parent joint; give at most {MAX_MAGNITUDE:g}"
            raise ValueError(why)


def _with_mimic_joints(robot: Robot, free: pin.Model) -> pin.Model:
    """Return a copy of a model in which mimic joints share their leaders' coordinates.

    pinocchio can read mimic joints only if each one comes after its leader, but it reads the joints
    of one link in the order of their names. It represents a continuous joint by cosine and sine,
    which a mimic joint cannot follow. Here the coordinate of a continuous joint is its angle.

    Raises:
        ValueError: A joint follows a joint that it carries.
    """
    model, mimics = pin.Model(), {j.name: j.mimic for j in robot.joints if j.mimic}
    copies = {0: 0}
    for i in _leaders_first(free, {name: mimic.leader for name, mimic in mimics.items()}):
        parent, placement = copies[free.parents[i]], free.jointPlacements[i]
        copies[i] = model.addJoint(parent, _with_one_coordinate(free, i), placement, free.names[i])
    for f in free.frames.tolist()[1:]:
        joint = copies[f.parentJoint]
        model.addFrame(pin.Frame(f.name, joint, f.parentFrame, f.placement, f.type))
    for name, mimic in mimics.items():
        ids = model.getJointId(mimic.leader), model.getJointId(name)
        model = pin.transformJointIntoMimic(model, *ids, mimic.multiplier, mimic.offset)
    return model


def _with_one_coordinate(model: pin.Model, joint: int) -> pin.JointModel:
    original = model.joints[joint]
    if original.nq == original.nv:
        return original
    data, neutral = model.createData(), pin.neutral(model)
    axis = pin.computeJointJacobian(model, data, neutral, joint).reshape(6, -1)[3:, original.idx_v]
    return pin.JointModelRevoluteUnaligned(axis)


def _leaders_first(free: pin.Model, leaders: dict[str, str]) -> Iterator[int]:
    """Yield all joints, each after its parent and its leader.

    Raises:
        ValueError: There is no such order, because a joint follows a joint that it carries.
    """
    before = {i: {free.parents[i]} for i in range(1, free.njoints)}
    for name, leader in leaders.items():
        before[free.getJointId(name)].add(free.getJointId(leader))
    done = {0}
    while before:
        i = next((i for i, others in before.items() if others <= done), None)
        if i is None:
            name = next(name for name in leaders if free.getJointId(name) in before)
            why = f"{name} follows {leaders[name]}, which it carries; let {leaders[name]} follow"
            raise ValueError(why)
        done.add(i)
        del before[i]
        yield i
