"""How far a body can move when a joint does: the bound that ties step and margin together.

For a joint j let lever(j) bound the travel of any point of any link, per unit of the joint, in
any configuration [m/rad]. For a hinge it is the largest distance of such a point from the axis: of
what sits between j and the next joint the distance from the axis itself, which never changes; from
there on the stretched length of the chain. For a slide it is 1. A joint with followers moves them
too, each by its multiplier. When joints move by dq,

    every point travels at most        travel(dq) = sum over j of lever(j) |dq_j|
    and so does it against any other   (each joint between two bodies is counted once)

If two configurations are less than `step` of travel apart, every one on the line between them is
less than step / 2 from one of the two, so where links keep `margin` at both, they keep more than

    margin - step / 2

all the way. Planning takes step = margin, which leaves half the margin proved; with step up to
twice the margin there is still proof of no contact.
"""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import Robot

from .bodies import objects
from .shapes import corners, packages
from .world import EMPTY, World

Array = NDArray[np.float64]


def levers(robot: Robot, world: World = EMPTY) -> Array:
    """Largest travel of any point, held bodies included, per unit of each actuated joint.

    Returns:
        (A,) [m/rad].
    """
    own = _levers(robot, world)
    total = {joint.name: own[joint.name] for joint in robot.actuated}
    for joint in robot.joints:
        if joint.mimic:
            total[joint.mimic.leader] += abs(joint.mimic.multiplier) * own[joint.name]
    return np.array([total[joint.name] for joint in robot.actuated])


def _levers(robot: Robot, world: World) -> dict[str, float]:
    """Of every moving joint, followers for themselves."""
    model = pin.buildModelFromUrdf(str(robot.urdf))
    geometry = pin.buildGeomFromUrdf(
        model, str(robot.urdf), pin.GeometryType.COLLISION, None, packages(robot.urdf)
    )
    points = [np.zeros((0, 3)) for _ in model.names]
    held = [exact for _, exact, _ in objects(model, world)]
    for shape in (*geometry.geometryObjects, *held):
        points[shape.parentJoint] = np.vstack((points[shape.parentJoint], corners(shape)))
    slides = [_slide(robot, model, name) for name in model.names]
    return _inward(model, points, slides)


def _inward(model: pin.Model, points: list[Array], slides: list[float | None]) -> dict[str, float]:
    """From the last joint to the first: stretched length from the joint on, and its lever."""
    reach, lever = [0.0] * model.njoints, dict[str, float]()
    data = model.createData()
    for j in range(model.njoints - 1, 0, -1):
        children = [c for c in range(j + 1, model.njoints) if model.parents[c] == j]
        offsets = np.array([model.jointPlacements[c].translation for c in children])
        beyond = np.array([reach[c] + (slides[c] or 0.0) for c in children])
        places = np.vstack((points[j], offsets.reshape(-1, 3)))
        extra = np.concatenate((np.zeros(len(points[j])), beyond))
        axis = _axis(model, data, j)
        off = np.linalg.norm(places - np.outer(places @ axis, axis), axis=1)
        reach[j] = float(np.max(np.linalg.norm(places, axis=1) + extra, initial=0.0))
        hinge = float(np.max(off + extra, initial=0.0))
        lever[model.names[j]] = hinge if slides[j] is None else 1.0
    return lever


def _axis(model: pin.Model, data: pin.Data, joint: int) -> Array:
    """Axis of a hinge in its own frame (3,), a unit vector; zero for a slide."""
    q = pin.neutral(model)
    jacobian = pin.computeJointJacobian(model, data, q, joint)
    column = jacobian[:, model.joints[joint].idx_v]
    return np.asarray(column[3:], dtype=np.float64)


def _slide(robot: Robot, model: pin.Model, name: str) -> float | None:
    """How far a sliding joint goes from zero [m]; None for a hinge."""
    index = model.getJointId(name)
    if name == "universe" or not model.joints[index].shortname().startswith("JointModelP"):
        return None
    joint = robot.joint(name)
    return max(abs(joint.lower), abs(joint.upper))
