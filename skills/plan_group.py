"""Planning one group of joints, in a worker process."""

from py_trees.common import Status
from py_trees.ports import PortInformation

from .base import Planned, Skill
from .motion import GoalInCollision, MotionError, Plan, PlanCanceled, Query, StartInCollision
from .pending import Pending
from .positions import Positions


class _PlanGroup(Skill, register=False):
    """Plan a motion of one group; the other joints stand still meanwhile."""

    group: str
    # Groups that are already at their goal when this one begins to move.
    moved_before: tuple[str, ...] = ()

    INPUT_PORTS = {
        "start": PortInformation(Positions, description="where the arm stands [rad]"),
        "goal": PortInformation(Positions, description="target of every actuated joint [rad]"),
    }
    OUTPUT_PORTS = {"plan": PortInformation(Plan, description="the motion of this group")}

    _pending: Pending | None = None

    @property
    def busy(self) -> bool:
        """Whether the planner still works."""
        return self._pending is not None and not self._pending.done

    def on_start(self) -> Status:
        """Hand the query to a worker."""
        robot = self.context.robot
        start, goal = self.get_input("start"), self.get_input("goal")
        arrived = {name for group in self.moved_before for name in robot.groups[group]}
        self._query = Query(
            group=self.group,
            start=tuple((goal if j.name in arrived else start)[j.name] for j in robot.actuated),
            goal=tuple(goal[joint.name] for joint in robot.leaders(self.group)),
            seed=self.context.seed,
            timeout=self.context.timeout,
        )
        self._pending = Pending(self.context, self._query)
        return Status.RUNNING

    def on_running(self) -> Status:
        """Take the answer when it is there."""
        assert self._pending
        if not self._pending.done:
            return Status.RUNNING
        answer = self._pending.answer
        assert isinstance(answer, (Plan, MotionError))
        self.context.tell(Planned(self._query, answer))
        if isinstance(answer, StartInCollision) and self.moved_before:
            # Its start is where the task sends the groups that move before it.
            raise GoalInCollision(answer.first, answer.second, answer.distance, answer.margin)
        if isinstance(answer, MotionError):
            raise answer
        self._set_output("plan", answer)
        spent = sum(answer.milliseconds.values())
        self.feedback_message = f"{answer.duration:.2f} s of motion, found in {spent:.1f} ms"
        return Status.SUCCESS

    def on_halt(self) -> None:
        """Cancel the planner, and tell of the plan that will not be."""
        if self._pending:
            self._pending.cancel()
            answer = self._pending.answer
            told = answer if isinstance(answer, (Plan, MotionError)) else PlanCanceled()
            self.context.tell(Planned(self._query, told))


class PlanArm(_PlanGroup):
    """Plan the arm's motion, with the gripper as it is."""

    group = "arm"


class PlanGripper(_PlanGroup):
    """Plan the gripper's motion, with the arm at its goal."""

    group = "gripper"
    moved_before = ("arm",)
