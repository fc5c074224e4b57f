"""The actuated joints of one planning group, as MoveIt's JointModelGroup."""

from itertools import chain, combinations, islice

import numpy as np

from hardware import Robot
from skills.motion.arrays import Array, norms, readonly
from skills.motion.errors import BadQuery

_MAX_GOALS = 64  # largest number of equivalent goals: enough for six continuous joints


class JointGroup:
    """The actuated joints of one planning group, in the order of `robot.actuated_in(name)`.

    Args:
        robot: The robot.
        name: Name of the group.

    Attributes:
        name: Name of the group.
        joints: The joints (J).
        names: Names of the joints (J).
        columns: Indices of the joints in `robot.actuated` (J,).
        lower: Lower limits (J,) [rad]. The limits of mimic joints are included: they are converted
            to limits of their leaders.
        upper: Upper limits (J,) [rad].
        continuous: True for each joint whose pose repeats after a whole turn (J,). False for a
            continuous joint with mimic joints.
        velocity: Velocity limits (J,) [rad/s].
        acceleration: Acceleration limits (J,) [rad/s2].
        most_acceleration: Largest sum of the absolute accelerations of the joints [rad/s2]. It is
            the group's part of the robot's limit, because groups may move at the same time.

    Raises:
        BadQuery: The robot has no such group.
    """

    def __init__(self, robot: Robot, name: str) -> None:
        if name not in robot.groups:
            raise BadQuery.group(name, robot.groups)
        self.name, self.joints = name, robot.actuated_in(name)
        self.names = tuple(joint.name for joint in self.joints)
        actuated = [joint.name for joint in robot.actuated]
        self.columns = np.array([actuated.index(each) for each in self.names], dtype=np.intp)
        self.lower, self.upper = self._limits(robot)
        leaders = {joint.mimic.leader for joint in robot.joints if joint.mimic}
        free = [joint.continuous and joint.name not in leaders for joint in self.joints]
        self.continuous = np.array(free, dtype=bool)
        self.velocity = readonly([joint.velocity for joint in self.joints])
        self.acceleration = readonly([joint.acceleration for joint in self.joints])
        whole = sum(joint.acceleration for joint in robot.actuated)
        self.most_acceleration = robot.acceleration_sum * float(self.acceleration.sum()) / whole

    def limits_at(self, speed: float) -> tuple[Array, Array]:
        """Return the velocity and acceleration limits at a share of the robot's speed.

        A motion at its limits then takes 1 / speed times as long.
        """
        return speed * self.velocity, speed * speed * self.acceleration

    def _limits(self, robot: Robot) -> tuple[Array, Array]:
        limits = {joint.name: (joint.lower, joint.upper) for joint in self.joints}
        for joint in robot.joints:
            if joint.mimic and joint.mimic.leader in limits and joint.mimic.multiplier:
                mimic, (lower, upper) = joint.mimic, limits[joint.mimic.leader]
                low, high = sorted(
                    (q - mimic.offset) / mimic.multiplier for q in (joint.lower, joint.upper)
                )
                limits[mimic.leader] = max(lower, low), min(upper, high)
        lows, highs = zip(*limits.values(), strict=True) if limits else ((), ())
        return np.array(lows), np.array(highs)

    def nearest_turn(self, start: Array, goal: Array) -> Array:
        """Return a goal with continuous joints within half a turn of the start (J,) [rad]."""
        if not self.continuous.any():
            return goal
        turns = np.where(self.continuous, np.round((goal - start) / (2.0 * np.pi)), 0.0)
        return goal - 2.0 * np.pi * turns

    def equivalent_goals(self, start: Array, goal: Array) -> Array:
        """Return a goal and those with continuous joints in the other direction (G, J) [rad].

        The goal nearest to the start comes first.
        """
        turns = np.where(self.continuous, 2.0 * np.pi * np.sign(goal - start), 0.0)
        joints = np.flatnonzero(turns)
        subsets = chain.from_iterable(combinations(joints, n) for n in range(len(joints) + 1))
        chosen = [np.isin(np.arange(len(goal)), each) for each in islice(subsets, _MAX_GOALS)]
        goals = goal - np.array(chosen) * turns
        return goals[np.argsort(norms(goals - start), kind="stable")]

    def full(self, configuration: Array, positions: Array) -> Array:
        """Return a configuration with the group's joints at other positions.

        Args:
            configuration: All actuated joints (A,) [rad].
            positions: The group's joints, one row per result (N, J) [rad].

        Returns:
            All actuated joints (N, A) [rad].
        """
        rows = np.empty((len(positions), len(configuration)))
        rows[:] = configuration
        rows[:, self.columns] = positions
        return rows
