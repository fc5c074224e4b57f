"""A leaf that moves the arm along plans."""

from py_trees.ports import PortInformation

from hardware import Schedule
from skills.merged_motion import MergedMotion
from skills.motion.trajectory.plan import Plan
from skills.streamed_motion import StreamedMotion


class Execute(StreamedMotion):
    """Check the frames of a motion, then send them. Succeed when the last frame is executed."""

    INPUT_PORTS = {
        "arm_plan": PortInformation(Plan, description="the arm's motion"),
        "gripper_plan": PortInformation(Plan, description="the gripper's motion"),
        "together": PortInformation(
            bool,
            default_value=False,
            description="true if the gripper moves with the arm, false if after it",
        ),
    }

    def compile_motion(self, start: tuple[float, ...]) -> tuple[Schedule, MergedMotion | None]:
        """Return the schedule of frames for both plans, and the merged motion."""
        plans: list[Plan] = [self.get_input("arm_plan"), self.get_input("gripper_plan")]
        return self.merge(start, plans, self.get_input("together"))
