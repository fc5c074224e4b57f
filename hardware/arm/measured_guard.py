"""The measured guard: it checks the values that the board measures."""

import logging
import math
from collections.abc import Collection, Sequence

from hardware.description.guards import Guards
from hardware.drivers.board_protocol import Measurement
from hardware.errors import (
    JointNotFollowing,
    JointStalled,
    NotArrived,
    ServoTooHot,
    SupplyTooLow,
)
from hardware.joints import Joint

logger = logging.getLogger(__name__)


class MeasuredGuard:
    """Checks measurements of one activation. Not thread-safe.

    Args:
        joints: The actuated joints. The positions of prismatic joints are not checked.
        guards: The limits.
        free: Names of joints that may end a motion elsewhere, such as a gripper.
    """

    def __init__(self, joints: Sequence[Joint], guards: Guards, free: Collection[str]) -> None:
        self._joints, self._guards, self._free = joints, guards, free
        self._since = dict[tuple[str, str], float]()  # time at which a joint exceeded a limit [s]
        self._warned = set[tuple[str, str]]()

    def check(self, commanded: Sequence[float], measured: Measurement, now: float) -> None:
        """Check one measurement.

        Args:
            commanded: Commanded positions, one per joint [rad].
            measured: The measurement.
            now: Time of the measurement [s].

        Raises:
            JointStalled: A joint pushes with its full effort and does not move.
            JointNotFollowing: A joint is too far from its commanded position for too long.
            ServoTooHot: A servo is too hot.
            SupplyTooLow: The voltage of a servo is too low.
        """
        guards = self._guards
        for k, joint in enumerate(self._joints):
            error = math.degrees(abs(commanded[k] - measured.position[k]))
            error = error if joint.unit == "rad" else 0.0
            effort = abs(measured.effort[k]) if measured.effort else 0.0
            stalls = effort >= guards.stall_effort and error >= guards.stall_deg
            if self._lasts("stall", joint, stalls, now, guards.stall_s):
                raise JointStalled(joint.name, effort, guards.stall_effort, error)
            if self._lasts("error", joint, error > guards.following_deg, now, guards.following_s):
                values = math.degrees(commanded[k]), math.degrees(measured.position[k])
                raise JointNotFollowing(joint.name, *values, guards.following_deg)
            if measured.temperature:
                self._check_temperature(joint, measured.temperature[k])
            if measured.voltage:
                self._check_voltage(joint, measured.voltage[k])

    def check_arrived(self, goal: Sequence[float], measured: Measurement) -> None:
        """Check that the joints are at the end of a motion.

        Args:
            goal: Commanded positions at the end, one per joint [rad].
            measured: The last measurement.

        Raises:
            NotArrived: A joint is not at its end position.
        """
        for joint, *positions in zip(self._joints, goal, measured.position, strict=True):
            end, there = map(math.degrees, positions)
            limit = self._guards.settle_deg
            bound = joint.unit == "rad" and joint.name not in self._free
            if bound and abs(end - there) > limit:
                raise NotArrived(joint.name, end, there, limit, self._guards.settle_s)

    def _lasts(self, kind: str, joint: Joint, wrong: bool, now: float, allowed: float) -> bool:
        """Return True if a value has been wrong for longer than allowed [s]."""
        if not wrong:
            self._since.pop((kind, joint.name), None)
            return False
        return now - self._since.setdefault((kind, joint.name), now) >= allowed

    def _check_temperature(self, joint: Joint, celsius: float) -> None:
        guards = self._guards
        if celsius > guards.most_c:
            raise ServoTooHot(joint.name, celsius, guards.most_c)
        if celsius >= guards.warn_c and self._is_first("hot", joint):
            words = "The servo of %s has %.0f degrees Celsius; the arm stops above %.0f"
            logger.warning(words, joint.name, celsius, guards.most_c)

    def _check_voltage(self, joint: Joint, volts: float) -> None:
        guards = self._guards
        if volts < guards.least_v:
            raise SupplyTooLow(joint.name, volts, guards.least_v)
        if volts < guards.warn_v and self._is_first("volts", joint):
            words = "The servo of %s has %.1f V; the arm stops below %.1f V"
            logger.warning(words, joint.name, volts, guards.least_v)

    def _is_first(self, kind: str, joint: Joint) -> bool:
        first = (kind, joint.name) not in self._warned
        self._warned.add((kind, joint.name))
        return first
