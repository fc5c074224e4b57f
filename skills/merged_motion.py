"""Merges the plans of several groups into one motion of the whole arm."""

from collections.abc import Sequence

from hardware import Robot, Schedule, compile_schedule, servo_path

from .errors import StartMoved
from .motion.query import Rest, Verify
from .motion.trajectory.plan import Plan
from .motion.world import World

# Margin for the collision check of frames, as the board executes them [m]. Servos turn in whole
# degrees and one after the other, so the fingertip deviates up to 15 mm from the plan (measured).
# Therefore this margin is smaller than the margin of planning. It still guarantees half a
# millimetre everywhere.
_PLAYED_MARGIN = 0.001
_ROUNDING = 1e-6  # [rad]


class MergedMotion:
    """One motion that consists of several plans.

    Args:
        robot: Description of the robot.
        start: Position of the arm at the start, one value per actuated joint [rad].
        plans: Plans of different groups.
        together: True if all plans start at the same time; False if each plan starts at the end of
            the previous plan.

    Attributes:
        groups: Group of each plan.
        together: True if all plans start at the same time.
        duration: Duration of the whole motion [s].
        sampled: Rows of positions that `sample` has returned, by time [s].
    """

    def __init__(
        self, robot: Robot, start: Sequence[float], plans: Sequence[Plan], together: bool
    ) -> None:
        self.groups, self.together = tuple(plan.group for plan in plans), together
        self.sampled: dict[float, list[float]] = {}
        self._robot = robot
        names = [joint.name for joint in robot.actuated]
        self._start = [float(q) for q in start]
        self._plans: list[tuple[float, list[int], Plan]] = []
        begins = 0.0
        for plan in plans:
            columns = [names.index(name) for name in plan.joints]
            self._plans.append((begins, columns, plan))
            begins += 0.0 if together else plan.duration
        ends = [begin + plan.duration for begin, _, plan in self._plans]
        self.duration = max(ends, default=0.0)

    def compile(self) -> Schedule:
        """Return the schedule of frames for the motion. Raises the errors of `compile_schedule`."""
        return compile_schedule(self._robot, self._start, self.sample, self.duration)

    def rest(self, time: float, start: tuple[float, ...]) -> list[Plan | Rest]:
        """Return what remains of a stopped motion.

        A gripper that was loosened to hold an object does not move again.

        Args:
            time: Time of the stop, from the start of the motion [s].
            start: Position of the stopped arm, one value per actuated joint [rad].

        Returns:
            A plan that had not started yet as it is. For a plan that was stopped on its way, a
            request to time the rest of its path again.

        Raises:
            StartMoved: A joint that is not of the gripper is not at the position of the stop.
        """
        left: list[Plan | Rest] = []
        (stopped,) = self.sample([time])
        holding = set(moved_gripper(self._robot, stopped, start))
        for begins, columns, plan in self._plans:
            passed = time - begins
            if holding.intersection(columns):
                continue
            if passed <= 0.0:
                left.append(plan)
            elif passed < plan.duration:
                left.append(Rest(plan, passed, start))
        return left

    def begins_at(self, positions: Sequence[float]) -> bool:
        """Return True if the motion starts exactly at these positions."""
        return self.sample([0.0]) == [[*positions]]

    def sample(self, times: Sequence[float]) -> list[list[float]]:
        """Return positions for each time [s]: a row with one value per actuated joint [rad]."""
        rows = [[*self._start] for _ in times]
        for begins, columns, plan in self._plans:
            moved = plan.sample([time - begins for time in times]).tolist()
            for row, positions in zip(rows, moved, strict=True):
                for column, position in zip(columns, positions, strict=True):
                    row[column] = position
        self.sampled.update(zip(times, rows, strict=True))
        return rows


def differs(a: float, b: float) -> bool:
    """Return True if two positions differ by more than a rounding error [rad]."""
    return abs(a - b) > _ROUNDING


def moved_gripper(robot: Robot, before: Sequence[float], start: Sequence[float]) -> list[int]:
    """Return the indices of the gripper's joints that are not at their expected position.

    Args:
        robot: Description of the robot.
        before: Expected position of the arm, one value per actuated joint [rad].
        start: Actual position of the arm, one value per actuated joint [rad].

    Raises:
        StartMoved: A joint that is not of the gripper is not at its expected position.
    """
    gripper = robot.groups.get("gripper", ())
    moved = [k for k, (a, b) in enumerate(zip(before, start, strict=True)) if differs(a, b)]
    for name in (robot.actuated[k].name for k in moved):
        if name not in gripper:
            raise StartMoved(f"{name} is not at the start of the motion; plan again")
    return moved


def verify_query(
    robot: Robot, start: tuple[float, ...], schedule: Schedule, timeout: float, world: World
) -> Verify:
    """Return the request to check frames for collisions before they are sent.

    Args:
        robot: Description of the robot.
        start: Position of the arm before the first frame, one value per actuated joint [rad].
        schedule: The frames.
        timeout: Longest time for the check [s].
        world: World around the arm.
    """
    times, rows = servo_path(robot, start, schedule)
    return Verify(rows, _PLAYED_MARGIN, times, timeout, world)
