"""Upper bounds on the motion of two shapes against each other when joints move.

From these bounds and the margin follows the step of continuous collision checking (F. Schwarzer,
M. Saha and J.-C. Latombe, "Adaptive dynamic collision checking for single and multiple articulated
robots in complex environments", IEEE Transactions on Robotics 21, 2005).

For a shape and a joint j that carries it, lever_arm(j) bounds the travel of every point of the
shape per unit of the joint, in any configuration [m/rad]. For a revolute joint, it is the largest
distance of a point from the axis. For a shape on j itself, this distance is constant; for a shape
further out, it is bounded by the stretched length of the chain between them. For a prismatic joint,
it is 1. A mimic joint moves by its multiplier times the motion of its leader. When joints move by
dq, the points of two shapes move against each other by at most

    travel(dq) = sum of lever_arm(j) |dq_j|    over the joints that carry one of them, not both

so the distance between the shapes changes by at most this travel. If two shapes keep the distance

    margin / 2 + travel(dq / 2)

in the middle of a line of length dq, they keep half of the margin along the whole line.

The floor stays the same plane when it turns about the vertical or slides along itself. A joint with
only such motions moves nothing closer to the floor. The floor may therefore count as carried by
this joint.
"""

import math
from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import Robot
from skills.motion.arrays import Array

from .geometry import corners

_LEVEL = 1e-9  # largest vertical motion of a level joint per unit [m/rad, m/m]

LeverArms = dict[str, float]  # lever arms by joint that carries the shape [m/rad]


def lever_arms(
    robot: Robot, model: pin.Model, axes: Sequence[Array], joint: int, shape: pin.GeometryObject
) -> LeverArms:
    """Return the lever arms of a shape.

    Args:
        robot: The robot, for the limits of prismatic joints.
        model: Model of the joints, in which mimic joints have their own coordinates.
        axes: The `joint_axes` of the model.
        joint: Index in `model` of the joint that carries the shape.
        shape: The shape.
    """
    found, reach = LeverArms(), 0.0
    if not joint:
        return found
    points = np.zeros((0, 3)) if isinstance(shape.geometry, coal.Halfspace) else corners(shape)
    while joint:
        name = model.names[joint]
        slide, axis = _slide_range(robot, model, joint), axes[joint]
        radii = np.linalg.norm(points - np.outer(points @ axis, axis), axis=1)
        found[name] = float(radii.max(initial=0.0)) + reach if slide is None else 1.0
        reach += float(np.linalg.norm(points, axis=1).max(initial=0.0)) + (slide or 0.0)
        points = model.jointPlacements[joint].translation[None, :]
        joint = model.parents[joint]
    return found


def joint_axes(model: pin.Model) -> list[Array]:
    """Return the axis of each joint in its own frame: a unit vector (3,), or zero if prismatic."""
    data = model.createData()
    return [np.zeros(3), *(_motion(model, data, i)[3:] for i in range(1, model.njoints))]


def floor_lever_arms(model: pin.Model) -> LeverArms:
    """Return the lever arms of the floor: 0 for joints that turn upright or slide level.

    Args:
        model: Model of the joints, in which mimic joints have their own coordinates.
    """
    found, data = LeverArms(), model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    for joint in range(1, model.njoints):
        slide, turn = _motion(model, data, joint).reshape(2, 3) @ data.oMi[joint].rotation.T
        level = abs(slide[2]) < _LEVEL and math.hypot(turn[0], turn[1]) < _LEVEL
        parent = model.parents[joint]
        if level and (not parent or model.names[parent] in found):
            found[model.names[joint]] = 0.0
    return found


def travel_bounds(robot: Robot, shapes: Sequence[LeverArms], ends: NDArray[np.intp]) -> Array:
    """Return the largest travel of two shapes against each other, per unit of each actuated joint.

    Args:
        robot: The robot.
        shapes: Lever arms of each shape.
        ends: Indices of the two shapes of each pair (P, 2).

    Returns:
        (P, A) [m/rad].
    """
    columns = {joint.name: (i, 1.0) for i, joint in enumerate(robot.actuated)}
    for joint in robot.joints:
        if joint.mimic:
            leader, _ = columns[joint.mimic.leader]
            columns[joint.name] = leader, abs(joint.mimic.multiplier)
    names = sorted(set[str]().union(*shapes))
    shares = np.zeros((len(names), len(robot.actuated)))
    for row, name in enumerate(names):
        column, share = columns[name]
        shares[row, column] = share
    # NaN: the joint does not carry the shape.
    arms = np.array([[arms.get(name, np.nan) for name in names] for arms in shapes])
    first, second = arms.reshape(len(shapes), len(names))[ends.T]
    travels: Array = np.where(np.isnan(first) != np.isnan(second), np.fmax(first, second), 0.0)
    return travels @ shares


def _motion(model: pin.Model, data: pin.Data, joint: int) -> Array:
    """Return the velocity of a joint's frame per unit of the joint (6,): linear, then angular.

    It is expressed in the frame of the joint.
    """
    jacobian = pin.computeJointJacobian(model, data, pin.neutral(model), joint)
    columns = jacobian.reshape(6, -1)  # pinocchio returns a vector for one joint
    return np.asarray(columns[:, model.joints[joint].idx_v], dtype=np.float64)


def _slide_range(robot: Robot, model: pin.Model, joint: int) -> float | None:
    """Return the largest distance of a prismatic joint from 0 [m]; None if revolute."""
    if not model.joints[joint].shortname().startswith("JointModelP"):
        return None
    described = robot.joint(model.names[joint])
    return max(abs(described.lower), abs(described.upper))
