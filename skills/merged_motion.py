"""Plans of several groups as one motion of the whole arm."""

from collections.abc import Sequence

import numpy as np

from hardware import Robot, Schedule, servo_path

from .motion.plan import Plan
from .motion.query import Rest, Verify
from .motion.world import World

# The frames are checked as they will be played. Decoded whole degrees, turned one servo after the
# other, stray up to 15 mm from the plan at the fingertip (measured), so that this margin is smaller
# than planning's and yet proves half a millimetre everywhere [m].
_PLAYED_MARGIN = 0.001


class MergedMotion:
    """One motion out of several plans.

    Args:
        robot: Whose joints.
        start: Where the arm stands, one value per actuated joint [rad].
        plans: One per group.
        together: Whether all begin at once; else one after the other, in their order.

    Attributes:
        groups: Whose plans these are, in their order.
        together: Whether all begin at once.
        duration: Of the whole [s].
        sampled: Every row of joint positions [rad] that was asked for, by its time [s].
    """

    def __init__(
        self, robot: Robot, start: Sequence[float], plans: Sequence[Plan], together: bool
    ) -> None:
        self.groups, self.together = tuple(plan.group for plan in plans), together
        self.sampled: dict[float, list[float]] = {}
        names = [joint.name for joint in robot.actuated]
        self._start = np.array(start, dtype=float)
        self._plans: list[tuple[float, list[int], Plan]] = []
        begins = 0.0
        for plan in plans:
            columns = [names.index(name) for name in plan.joints]
            self._plans.append((begins, columns, plan))
            begins += 0.0 if together else plan.duration
        ends = [begin + plan.duration for begin, _, plan in self._plans]
        self.duration = max(ends, default=0.0)

    def rest(self, time: float, start: tuple[float, ...]) -> list[Plan | Rest]:
        """What is left of it at a time [s]: whole plans, and those that are to be timed anew.

        Args:
            time: How far it was followed [s].
            start: Where the arm stands then, one value per actuated joint [rad].
        """
        left: list[Plan | Rest] = []
        for begins, _, plan in self._plans:
            passed = time - begins
            if passed <= 0.0:
                left.append(plan)
            elif passed < plan.duration:
                left.append(Rest(plan, passed, start))
        return left

    def begins_at(self, positions: Sequence[float]) -> bool:
        """Whether the motion begins at these positions, to the bit."""
        return bool(np.array_equal(self.sample([0.0])[0], np.asarray(positions)))

    def sample(self, times: Sequence[float]) -> list[list[float]]:
        """Rows of joint positions [rad] at the given times [s], one value per actuated joint."""
        at = np.asarray(times, dtype=float)
        rows = np.tile(self._start, (len(at), 1))
        for begins, columns, plan in self._plans:
            rows[:, columns] = plan.sample(at - begins)
        plain = [[float(q) for q in row] for row in rows]
        self.sampled.update(zip(at.tolist(), plain, strict=True))
        return plain


def verify_query(
    robot: Robot, start: tuple[float, ...], schedule: Schedule, timeout: float, world: World
) -> Verify:
    """What a planner is asked about frames before they are sent.

    Args:
        robot: Whose.
        start: Where the arm stands, one value per actuated joint [rad].
        schedule: The frames.
        timeout: Time there is for the check [s].
        world: What is around the arm.
    """
    times, rows = servo_path(robot, start, schedule)
    return Verify(rows, _PLAYED_MARGIN, times, timeout, world)
