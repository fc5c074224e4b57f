"""Proof that no path exists: a single joint would have to pass a position in collision.

If only one joint moves two links against each other, their distance depends only on that joint. On
every path, a joint with limits passes all positions between its start and its goal. A continuous
joint passes these or all the others. If the two links are too close at one of these positions,
there is no path. A sampling-based search cannot prove this. (Proofs for other cases: J. Basch, L.
J. Guibas, D. Hsu and A. T. Nguyen, "Disconnection proofs for motion planning", ICRA 2001.)
"""

import numpy as np

from skills.motion.arrays import Array
from skills.motion.errors import Barred
from skills.motion.robot_model.joint_group import JointGroup

from .motion_validator import MotionValidator

_SAMPLES = 64


def check_passable(validator: MotionValidator, start: Array, goal: Array) -> None:
    """Check the pairs of links that a single joint moves.

    Args:
        validator: Checks motions of the group.
        start: A free point (J,) [rad].
        goal: Another free point (J,) [rad].

    Raises:
        Barred: There is no path, in either direction of any continuous joint.
    """
    alone = np.flatnonzero((validator.lever_arms > 0.0).sum(axis=1) == 1)
    movers = validator.lever_arms[alone].argmax(axis=1)
    for joint in np.unique(movers).tolist():
        pairs = frozenset(alone[movers == joint].tolist())
        ends = _single_joint_goals(validator.group, joint, start, goal)
        barriers = [_barrier(validator, start, end, pairs) for end in ends]
        if barriers and (barrier := barriers[0]) and all(barriers):
            raise barrier


def _single_joint_goals(group: JointGroup, joint: int, start: Array, goal: Array) -> list[Array]:
    """Return the goals of motions of a single joint; every path contains one of these motions.

    The list is empty if this is not known for the joint.
    """
    end = start.copy()
    end[joint] = goal[joint]
    if np.isfinite([group.lower[joint], group.upper[joint]]).any():
        return [end]
    # A whole turn of a continuous joint changes the pose of the joints that mimic it.
    return list(group.equivalent_goals(start, end)) if group.continuous[joint] else []


def _barrier(
    validator: MotionValidator, start: Array, goal: Array, pairs: frozenset[int]
) -> Barred | None:
    """Return the error for the first collision of a pair of links on a line, or None."""
    shares = np.linspace(0.0, 1.0, _SAMPLES)[:, None]
    rows, checker = validator.full(start + shares * (goal - start)), validator.checker
    distance = validator.guaranteed
    hit = checker.first_collision(rows, distance, pairs)
    if hit is None:
        return None
    row = rows[hit : hit + 1]
    pair = next(
        k for k in sorted(pairs) if checker.first_collision(row, distance, frozenset((k,))) == 0
    )
    scene, mover = checker.scene, np.argmax(validator.lever_arms[pair])
    joint = int(validator.group.columns[mover])
    ends = scene.hulls.collisionPairs[pair]
    links = scene.hull_links[ends.first], scene.hull_links[ends.second]
    model = scene.robot_model
    return Barred(model.joints[joint], float(row[0, joint]), model.units[joint], *links)
