"""How far two bodies can move against each other when joints do: what ties step and margin.

For a body and a joint j that it hangs from let lever(j) bound the travel of any of its points, per
unit of the joint, in any configuration [m/rad]. For a hinge it is the largest distance of such a
point from the axis: of a body on j itself the distance from the axis, which never changes; of one
further out the stretched length of the chain between. For a slide it is 1. A joint that another
leads moves with that one, by its multiplier. When joints move by dq, the points of two bodies move
against each other by at most

    travel(dq) = sum of lever(j) |dq_j|    over the joints that one of them hangs from, not both

and so by no more does the distance between them change. If they keep

    margin / 2 + travel(dq / 2)

in the middle of a line that is dq long, they keep half the margin all along it.

The floor stays the same floor when it turns upright or slides along itself. So it may as well hang
from the joints that do only that, and what they move does not come nearer to it.
"""

import math
from collections.abc import Iterable, Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from hardware import Robot
from skills.motion.collision.shapes import corners

Array = NDArray[np.float64]
_LEVEL = 1e-9  # what a joint may lift per unit to count as level [m/rad, m/m]

LeverArms = dict[str, float]  # by the name of each joint that a shape hangs from


def lever_arms(robot: Robot, model: pin.Model, joint: int, shape: pin.GeometryObject) -> LeverArms:
    """Of a shape on a joint; all is [m/rad].

    Args:
        robot: Whose joints.
        model: Of them; followers have coordinates of their own.
        joint: Its index there.
        shape: What hangs from it.
    """
    found, data, reach = LeverArms(), model.createData(), 0.0
    places = np.zeros((0, 3)) if isinstance(shape.geometry, coal.Halfspace) else corners(shape)
    while joint:
        name = model.names[joint]
        slide, axis = _slide(robot, model, joint), _axis(model, data, joint)
        off = np.linalg.norm(places - np.outer(places @ axis, axis), axis=1)
        found[name] = float(off.max(initial=0.0)) + reach if slide is None else 1.0
        reach += float(np.linalg.norm(places, axis=1).max(initial=0.0)) + (slide or 0.0)
        places = model.jointPlacements[joint].translation[None, :]
        joint = model.parents[joint]
    return found


def floor_lever_arms(model: pin.Model) -> LeverArms:
    """Of the floor: the joints that only ever turn upright or slide level.

    Args:
        model: Of the joints; followers have coordinates of their own.
    """
    found, data = LeverArms(), model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    for joint in range(1, model.njoints):
        slide, turn = _motion(model, data, joint).reshape(2, 3) @ data.oMi[joint].rotation.T
        keeps = abs(slide[2]) < _LEVEL and math.hypot(turn[0], turn[1]) < _LEVEL
        before = model.parents[joint]
        if keeps and (not before or model.names[before] in found):
            found[model.names[joint]] = 0.0
    return found


def travel_bounds(
    robot: Robot, shapes: Sequence[LeverArms], pairs: Iterable[pin.CollisionPair]
) -> Array:
    """Largest travel of two shapes against each other, per unit of each actuated joint.

    Args:
        robot: Whose joints.
        shapes: The levers of each.
        pairs: Of shapes (P).

    Returns:
        (P, A) [m/rad].
    """
    columns = {joint.name: (i, 1.0) for i, joint in enumerate(robot.actuated)}
    for joint in robot.joints:
        if joint.mimic:
            leader, _ = columns[joint.mimic.leader]
            columns[joint.name] = leader, abs(joint.mimic.multiplier)
    rows = []
    for pair in pairs:
        first, second = shapes[pair.first], shapes[pair.second]
        rows.append(np.zeros(len(robot.actuated)))
        for name in sorted(first.keys() ^ second.keys()):
            column, share = columns[name]
            rows[-1][column] += share * (first | second)[name]
    return np.array(rows).reshape(-1, len(robot.actuated))


def _axis(model: pin.Model, data: pin.Data, joint: int) -> Array:
    """Axis of a hinge in its own frame (3,), a unit vector; zero for a slide."""
    return _motion(model, data, joint)[3:]


def _motion(model: pin.Model, data: pin.Data, joint: int) -> Array:
    """How a joint moves what is on it, per unit, in its own frame: (6,), straight and turning."""
    jacobian = pin.computeJointJacobian(model, data, pin.neutral(model), joint)
    return np.asarray(jacobian[:, model.joints[joint].idx_v], dtype=np.float64)


def _slide(robot: Robot, model: pin.Model, joint: int) -> float | None:
    """How far a sliding joint goes from zero [m]; None for a hinge."""
    if not model.joints[joint].shortname().startswith("JointModelP"):
        return None
    described = robot.joint(model.names[joint])
    return max(abs(described.lower), abs(described.upper))
