"""The measured guard: it checks the values that the board measures."""

import logging
import math
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress

from hardware.description.guards import Guards
from hardware.drivers.board_protocol import Measurement
from hardware.errors import JointNotFollowing, JointStalled, NotArrived, ServoTooHot, SupplyTooLow
from hardware.joints import Joint

logger = logging.getLogger(__name__)


_STANDS = 0.05  # largest velocity of a joint that stands still [rad/s]
_LEAST_SQUEEZE = 0.1  # smaller differences are within the dead zone of a servo [deg]


class MeasuredGuard:
    """Checks measurements of one activation. Thread-safe.

    A gripper may close on an object. It then stands still and pushes. `loosened` returns a pose in
    which it pushes less: the difference from its measured position is a third of the present one,
    and at most `squeeze_deg`. For a gripper that is blocked in the other direction, the limits of
    the other joints apply.

    Args:
        joints: The actuated joints. The positions of prismatic joints are not checked.
        guards: The limits.
        grips: Direction in which each joint of the gripper grips, by name: 1 or -1.
    """

    def __init__(self, joints: Sequence[Joint], guards: Guards, grips: Mapping[str, int]) -> None:
        self._joints, self._guards, self._grips = joints, guards, grips
        self._since = dict[tuple[str, str], float]()  # time at which a joint exceeded a limit [s]
        self._warned = set[tuple[str, str]]()
        self._stalled = set[str]()  # names of grippers that have pushed for too long
        self._measured: Measurement | None = None
        self._time = -math.inf  # time of the last measurement [s]
        self._effect = ""  # effect of a fault on the arm
        self._lock = threading.Lock()

    def check(
        self,
        commanded: Sequence[float],
        measured: Measurement,
        now: float,
        active: bool = True,
        follows: bool = True,
    ) -> None:
        """Check one measurement.

        Args:
            commanded: Commanded positions, one per joint [rad].
            measured: The measurement.
            now: Time of the measurement [s].
            active: False if a fault moves nothing, because the arm is not active yet.
            follows: False if the joints are on their way to the commanded positions, and may be far
                from them.

        Raises:
            JointStalled: A joint pushes with its full effort and does not move.
            JointNotFollowing: A joint is too far from its commanded position for too long.
            ServoTooHot: A servo is too hot.
            SupplyTooLow: The voltage of a servo is too low.
        """
        with self._lock:
            self._measured, self._time = measured, now
            self._effect = self._guards.effect if active else ""
            for k, joint in enumerate(self._joints):
                if joint.unit == "rad":
                    self._check_position(k, commanded[k], measured, now, follows)
                if measured.temperature:
                    self._check_temperature(joint, measured.temperature[k])
                if measured.voltage:
                    self._check_voltage(joint, measured.voltage[k])

    def _standing_effort(self, k: int, measured: Measurement) -> float:
        """Return the effort of a joint that stands still and draws current; 0 for others."""
        moves = measured.velocity and abs(measured.velocity[k]) > _STANDS
        idles = measured.current and abs(measured.current[k]) < self._guards.stall_a
        return 0.0 if moves or idles or not measured.effort else abs(measured.effort[k])

    def _check_position(
        self, k: int, commanded: float, measured: Measurement, now: float, follows: bool
    ) -> None:
        guards, joint, there = self._guards, self._joints[k], measured.position[k]
        error, effort = math.degrees(abs(commanded - there)), self._standing_effort(k, measured)
        closes = self._may_grip(joint, commanded - there)
        pushes = closes and effort >= guards.grip_effort and error >= _LEAST_SQUEEZE
        if self._lasts("grip", joint, pushes, now, guards.stall_s):
            self._stalled.add(joint.name)
        else:
            self._stalled.discard(joint.name)
        stalls = not closes and effort >= guards.stall_effort and error >= guards.stall_deg
        if self._lasts("stall", joint, stalls, now, guards.stall_s):
            opens = joint.name in self._grips
            raise JointStalled(joint.name, effort, guards.stall_effort, error, self._effect, opens)
        # Without a measured effort, the difference may be that of a gripper that holds an object.
        holds = not measured.effort or abs(measured.effort[k]) >= guards.grip_effort
        far = follows and error > guards.following_deg and not (closes and holds)
        if self._lasts("error", joint, far, now, guards.following_s):
            values = math.degrees(commanded), math.degrees(there)
            raise JointNotFollowing(joint.name, *values, guards.following_deg, self._effect)

    def _may_grip(self, joint: Joint, ahead: float) -> bool:
        """Return True if a gripper's joint is commanded to grip further, so it may hold an object.

        Args:
            joint: The joint.
            ahead: Commanded minus measured position [rad].
        """
        return self._grips.get(joint.name, 0) * ahead > 0

    def loosened(self, commanded: Sequence[float], now: float) -> tuple[float, ...] | None:
        """Return a pose in which stalled grippers push less; None if none is stalled.

        Args:
            commanded: Commanded positions, one per joint [rad].
            now: Present time [s]. From now, `stall_s` must pass until a gripper is stalled again.
        """
        with self._lock:
            if not self._stalled or not self._measured:
                return None
            pose, squeeze = list(commanded), math.radians(self._guards.squeeze_deg)
            for k, joint in enumerate(self._joints):
                if joint.name in self._stalled:
                    there = self._measured.position[k]
                    less = (commanded[k] - there) / 3
                    near = there + min(max(less, -squeeze), squeeze)
                    pose[k] = min(max(near, joint.lower), joint.upper)
                    self._since["grip", joint.name] = now
            self._stalled.clear()
            return tuple(pose)

    @property
    def stalled(self) -> bool:
        """True if a gripper has pushed against an object for too long."""
        return bool(self._stalled)

    @property
    def settle_s(self) -> float:
        """Longest time from the last frame until the joints arrive [s]; 0 without measurements."""
        return self._guards.settle_s if self._measured else 0.0

    def has_settled(self, goal: Sequence[float], since: float) -> bool:
        """Return True if the joints are at the end of a motion, and no gripper pushes too hard.

        Args:
            goal: Commanded positions at the end, one per joint [rad].
            since: Time of the end [s]. An earlier measurement does not count.
        """
        with suppress(NotArrived):
            self.check_arrived(goal)
            with self._lock:
                pushes = any(kind == "grip" for kind, _ in self._since)
                return self._time > since and not pushes
        return False

    def check_arrived(self, goal: Sequence[float]) -> None:
        """Check that the joints are at the end of a motion. A gripper may hold an object.

        Args:
            goal: Commanded positions at the end, one per joint [rad].

        Raises:
            NotArrived: A joint is not at its end position.
        """
        if self._measured is None:
            return
        for joint, *positions in zip(self._joints, goal, self._measured.position, strict=True):
            end, there = map(math.degrees, positions)
            limit = self._guards.settle_deg
            bound = joint.unit == "rad" and not self._may_grip(joint, end - there)
            if bound and abs(end - there) > limit:
                raise NotArrived(joint.name, end, there, limit, self._guards.settle_s)

    def _lasts(self, kind: str, joint: Joint, wrong: bool, now: float, allowed: float) -> bool:
        """Return True if a value has been wrong for the time `allowed` [s] or longer."""
        if not wrong:
            self._since.pop((kind, joint.name), None)
            return False
        return now - self._since.setdefault((kind, joint.name), now) >= allowed

    def _check_temperature(self, joint: Joint, celsius: float) -> None:
        guards = self._guards
        if celsius > guards.most_c:
            raise ServoTooHot(joint.name, celsius, guards.most_c, self._effect)
        if celsius >= guards.warn_c and self._is_first("hot", joint):
            words = "The servo of %s has %.0f degrees Celsius; the arm stops above %.0f"
            logger.warning(words, joint.name, celsius, guards.most_c)

    def _check_voltage(self, joint: Joint, volts: float) -> None:
        guards = self._guards
        if volts < guards.least_v:
            raise SupplyTooLow(joint.name, volts, guards.least_v, self._effect)
        if volts < guards.warn_v and self._is_first("volts", joint):
            words = "The servo of %s has %.1f V; the arm stops below %.1f V"
            logger.warning(words, joint.name, volts, guards.least_v)

    def _is_first(self, kind: str, joint: Joint) -> bool:
        first = (kind, joint.name) not in self._warned
        self._warned.add((kind, joint.name))
        return first
