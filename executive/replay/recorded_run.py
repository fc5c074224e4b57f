"""A recorded run for all checks: its robot, and its records, which are read once."""

from dataclasses import dataclass
from functools import cached_property

from hardware import Robot
from logs import Plan, Record, Recording, Schedule
from skills.motion.planner import Planner

_planners: dict[str, Planner] = {}


@dataclass(frozen=True)
class RecordedRun:
    """A recorded run.

    Attributes:
        recording: The recording.
        records: Its records for checks, in file order.
        robot: The recorded robot.
    """

    recording: Recording
    records: tuple[Record, ...]
    robot: Robot

    @property
    def planner(self) -> Planner:
        """The planner for the robot, shared by all runs with the same robot files.

        The path of restored robot files contains their digest. Use the planner only for a run with
        a plan: other recordings may lack the meshes.

        Raises:
            ModelUnusable: The robot is unusable for planning.
        """
        key = str(self.robot.path)
        if key not in _planners:
            _planners[key] = Planner(self.robot)
        return _planners[key]

    def start(self, record: Plan | Schedule) -> tuple[float, ...]:
        """Return the start of a motion: one position per actuated joint [rad]."""
        return tuple(record.start[joint.name] for joint in self.robot.actuated)

    @cached_property
    def joints_difference(self) -> str:
        """First plan or schedule whose joints are not the robot's, in words; empty if none."""
        robot = self.robot
        actuated = {joint.name for joint in robot.actuated}
        for record in self.records:
            if not isinstance(record, Plan | Schedule):
                continue
            groups = (record.group,) if isinstance(record, Plan) else record.groups
            if unknown := [group for group in groups if group not in robot.groups]:
                there = ", ".join(robot.groups)
                return f"the group {unknown[0]} is recorded, but the robot has the groups {there}"
            if record.start.keys() != actuated:
                start = ", ".join(record.start)
                return f"the recorded start has the joints {start}, not those of the robot"
            if isinstance(record, Plan):
                joints = tuple(joint.name for joint in robot.actuated_in(record.group))
                if record.joints != joints:
                    named = ", ".join(record.joints)
                    return f"the group {record.group} is recorded with the joints {named}"
        return ""
