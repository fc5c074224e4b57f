"""A robot as pinocchio reads it: its joints, the shapes of its links, and how far they can move."""

import re
from collections import Counter
from collections.abc import Iterator

import pinocchio as pin

from hardware import Robot
from hardware.description.urdf import count_collision_shapes
from skills.motion.collision.shapes import hull, packages
from skills.motion.collision.solid import solid_of
from skills.motion.errors import ModelUnusable
from skills.motion.measures import FARTHEST

from .lever_arms import LeverArms, floor_lever_arms, lever_arms


class RobotModel:
    """What is the same of a robot in every world.

    Args:
        robot: The robot.

    Attributes:
        kinematics: pinocchio's model; followers share the coordinate of the joint they follow, and
            joints without an end have their angle.
        exact: Every primitive or mesh of the URDF.
        outer: The convex hull around those of each link.
        solids: Of each of `exact` what it encloses; None of a primitive.
        levers: Of each of `outer`; see `reach`.
        level: Those of the floor.

    Raises:
        ModelUnusable: pinocchio cannot read the URDF or one of its shapes, or a joint follows one
            that it carries.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, urdf = robot, str(robot.urdf)
        try:
            shapes = count_collision_shapes(robot.urdf, FARTHEST)
            self._loose = pin.buildModelFromUrdf(urdf)  # followers with coordinates of their own
            _check_joints(robot, self._loose)
            self.kinematics = _tied(robot, self._loose)
            self.exact: list[pin.GeometryObject] = list(
                pin.buildGeomFromUrdf(
                    self.kinematics, urdf, pin.GeometryType.COLLISION, None, packages(robot.urdf)
                ).geometryObjects
            )
            self._check_count(shapes)
            self.outer = self._hulls()
        except (OSError, RuntimeError, ValueError) as error:
            raise ModelUnusable(urdf, _why(error)) from error
        self.solids = [solid_of(shape.geometry) for shape in self.exact]
        self.floor_lever_arms = floor_lever_arms(self._loose)
        self.lever_arms = [self.lever_arms_of(shape) for shape in self.outer]

    def lever_arms_of(self, shape: pin.GeometryObject) -> LeverArms:
        """Of a shape on one of the joints."""
        joint = self._loose.getJointId(self.kinematics.names[shape.parentJoint])
        return lever_arms(self._robot, self._loose, joint, shape)

    def _check_count(self, counts: dict[str, int]) -> None:
        found = Counter(self.kinematics.frames[shape.parentFrame].name for shape in self.exact)
        for link, count in counts.items():
            if found[link] != count:
                why = f"of the {count} shapes of {link} pinocchio reads {found[link]}"
                hint = "give plain numbers, with a single space between two"
                raise ModelUnusable(str(self._robot.urdf), f"{why}; {hint}")

    def _hulls(self) -> list[pin.GeometryObject]:
        links = dict[int, list[pin.GeometryObject]]()
        for shape in self.exact:
            links.setdefault(shape.parentFrame, []).append(shape)
        return [self._hull(frame, shapes) for frame, shapes in links.items()]

    def _hull(self, frame: int, shapes: list[pin.GeometryObject]) -> pin.GeometryObject:
        name, joint = self.kinematics.frames[frame].name, shapes[0].parentJoint
        try:
            around = hull(shapes)
        except ValueError as error:
            raise ModelUnusable(str(self._robot.urdf), f"of {name} {error}") from error
        return pin.GeometryObject(name, joint, frame, pin.SE3.Identity(), around)


def _why(error: Exception) -> str:
    """What pinocchio says, less where in coal it was said."""
    said = re.search(r"Could not load resource (.*)\n(.*)", str(error))
    why = f"{said[1]} cannot be read as a mesh: {said[2]}" if said else str(error)
    return why.rstrip(".")


def _check_joints(robot: Robot, loose: pin.Model) -> None:
    """Refuse joints that hang from nothing, or too far off."""
    for joint in robot.joints:
        if not loose.existJointName(joint.name):
            why = f"{joint.name} hangs from no link that hangs from {loose.frames[1].name}"
            raise ModelUnusable(str(robot.urdf), why)
    for name, place in zip(loose.names, loose.jointPlacements, strict=True):
        off = abs(place.translation).max()
        if off > FARTHEST:
            why = f"{name} is {off:g} m off the joint before it; give at most {FARTHEST:g}"
            raise ModelUnusable(str(robot.urdf), why)


def _tied(robot: Robot, loose: pin.Model) -> pin.Model:
    """The same model, each joint at its angle or way, followers at that of the joint they follow.

    pinocchio can tie joints of a URDF itself, but wants each to come after the one it follows, and
    reads those on one link in the order of their names. Joints without an end it would have at
    their cosine and sine, which nothing else can follow.

    Raises:
        ModelUnusable: A joint follows one that it carries.
    """
    model, mimics = pin.Model(), {j.name: j.mimic for j in robot.joints if j.mimic}
    places = {0: 0}
    for i in _order(robot, loose, {name: mimic.leader for name, mimic in mimics.items()}):
        parent, place = places[loose.parents[i]], loose.jointPlacements[i]
        places[i] = model.addJoint(parent, _single(loose, i), place, loose.names[i])
    for f in loose.frames.tolist()[1:]:
        joint = places[f.parentJoint]
        model.addFrame(pin.Frame(f.name, joint, f.parentFrame, f.placement, f.type))
    for name, mimic in mimics.items():
        ids = model.getJointId(mimic.leader), model.getJointId(name)
        model = pin.transformJointIntoMimic(model, *ids, mimic.multiplier, mimic.offset)
    return model


def _single(model: pin.Model, joint: int) -> pin.JointModel:
    """A joint of a model, with one coordinate."""
    turns = model.joints[joint]
    if turns.nq == turns.nv:
        return turns
    data, still = model.createData(), pin.neutral(model)
    axis = pin.computeJointJacobian(model, data, still, joint)[3:, turns.idx_v]
    return pin.JointModelRevoluteUnaligned(axis)


def _order(robot: Robot, loose: pin.Model, leaders: dict[str, str]) -> Iterator[int]:
    """All joints, each after the one that carries it and the one it follows."""
    before = {i: {loose.parents[i]} for i in range(1, loose.njoints)}
    for name, leader in leaders.items():
        before[loose.getJointId(name)].add(loose.getJointId(leader))
    done = {0}
    while before:
        i = next((i for i, others in before.items() if others <= done), None)
        if i is None:
            name = next(name for name in leaders if loose.getJointId(name) in before)
            why = f"{name} follows {leaders[name]}, which it carries; let {leaders[name]} follow"
            raise ModelUnusable(str(robot.urdf), why)
        done.add(i)
        del before[i]
        yield i
