"""A hand-guided arm: its servos have no torque, so that a person can move it."""

import math
from contextlib import suppress
from dataclasses import replace

from hardware import Ability, Arm, HardwareError, Link, RealClock, Robot, State
from skills import Blocked


class HandGuidedArm:
    """The leader of another arm. It measures its positions, and receives no motions.

    Args:
        robot: The robot. Its board must be able to measure, and to switch its torque.
        link: Link to its board.

    Attributes:
        following: True while the other arm shall follow. False makes it stop following.
        blocked: Reason that the other arm does not follow; None if it follows.

    Raises:
        NotAble: The board cannot measure or switch its torque.
    """

    def __init__(self, robot: Robot, link: Link) -> None:
        robot.require(Ability.MEASURE)
        robot.require(Ability.TORQUE)
        self.robot, self.following = robot, False
        self.blocked: Blocked | None = None
        # A person may move the arm beyond its limits, and it must then hold this position.
        self._arm = Arm(_beyond_limits(robot), link, RealClock())

    def open(self) -> None:
        """Open the port. The arm holds its position.

        Raises:
            HardwareError: The port or the board failed.
        """
        self._arm.configure()
        self._arm.activate()

    def release(self) -> None:
        """Switch the torque off. The arm falls unless a person holds it.

        Raises:
            HardwareError: The board failed.
        """
        self._arm.switch_torque(on=False)

    def close(self) -> bool:
        """Hold the position of the arm, and close the port. Return True if the arm holds."""
        held = False
        with suppress(HardwareError):
            self._arm.switch_torque(on=True)
            held = True
        if self._arm.state is not State.UNCONFIGURED:
            self._arm.shutdown()
        return held

    def where(self) -> tuple[float, ...]:
        """Return the measured positions of the leader, one per actuated joint [rad].

        Raises:
            HardwareError: The arm is lost.
        """
        if failure := self._arm.failure:
            raise failure
        self._arm.check_active()
        measured = self._arm.measured
        assert measured  # the arm failed before it was active
        return measured.position

    def positions(self) -> tuple[float, ...] | None:
        """Return what `where` returns [rad], or None to stop following. Raises like `where`."""
        return self.where() if self.following else None

    def show(self, blocked: Blocked | None) -> None:
        """Store the reason that the other arm does not follow."""
        self.blocked = blocked


def _beyond_limits(robot: Robot) -> Robot:
    """Return a robot whose joints may be a whole turn outside their limits."""
    joints = (
        replace(joint, lower=joint.lower - math.tau, upper=joint.upper + math.tau)
        for joint in robot.joints
    )
    return replace(robot, joints=tuple(joints))
