"""Planning one group of joints, in a worker process."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot, compile_schedule
from skills.context import Planned
from skills.errors import refuse
from skills.merged_motion import MergedMotion, verify_query
from skills.motion.errors import (
    GoalInCollision,
    MotionCollides,
    MotionError,
    PlanCanceled,
    StartInCollision,
)
from skills.motion.plan import Plan
from skills.motion.query import Query, Result, Verify
from skills.planning_skill import PlanningSkill
from skills.ports import Positions

from .check_bounds import check_whole, wrong_targets, wrong_whole

# Distance that is kept more by a way round something, where the frames of the first would come too
# near it. Much more and there often is no such way at all (measured) [m].
_SPARE = 0.002


class _PlanGroup(PlanningSkill, register=False):
    """Plan a motion of one group; the other joints stand still meanwhile."""

    validates_partial = True
    plans_goal = True
    group: str
    # Groups that are already at their goal when this one begins to move.
    moved_before: tuple[str, ...] = ()

    INPUT_PORTS = {
        "start": PortInformation(Positions, description="where the arm stands [rad]"),
        "goal": PortInformation(Positions, description="target of every actuated joint [rad]"),
        "via": PortInformation(
            list[Positions],
            default_value=[],
            description="positions of the group's joints to pass on the way, in order [rad]",
        ),
    }
    OUTPUT_PORTS = {"plan": PortInformation(Plan, description="the motion of this group")}

    _query: Query
    _first: Plan | None = None  # a way round something, whose frames are being checked

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check what is spelled out."""
        ports = [port for port in ("start", "goal") if port in inputs]
        wrong = [error for port in ports for error in wrong_whole(robot, port, inputs[port])]
        for number, point in enumerate(inputs.get("via", [])):
            if point is not None:
                wrong += wrong_targets(robot, {cls.group: point}, ("via", number))
        refuse(wrong)

    def on_start(self) -> Status:
        """Hand the query to a worker."""
        robot, leaders = self.context.robot, self.context.robot.actuated_in(self.group)
        start, goal, via = (self.get_input(port) for port in ("start", "goal", "via"))
        check_whole(robot, "start", start)
        self.validate(robot, {"goal": goal, "via": via})
        arrived = {name for group in self.moved_before for name in robot.groups[group]}
        self._query = Query(
            group=self.group,
            start=tuple((goal if j.name in arrived else start)[j.name] for j in robot.actuated),
            goal=tuple(goal[joint.name] for joint in leaders),
            seed=self.context.seed,
            timeout=self.context.timeout,
            via=tuple(tuple(point[joint.name] for joint in leaders) for point in via),
            world=self.context.scene.world,
        )
        self._first = None
        return self.ask(self._query)

    def on_answer(self, answer: Result) -> Status:
        """Have the frames of a way round something checked, and a wider way tried; hand it on."""
        if isinstance(answer, Plan) and not answer.curve.straight and not self._first:
            self._first = answer
            return self.ask(self._frames_of(answer))
        if self._first and not self._query.spare and isinstance(answer, MotionCollides):
            self._query = replace(self._query, spare=_SPARE)
            return self.ask(self._query)
        if self._first and not isinstance(answer, Plan):  # Execute says what is wrong with it
            self._query, answer = replace(self._query, spare=0.0), self._first
        return self._tell(answer)

    def _frames_of(self, plan: Plan) -> Verify:
        robot, start = self.context.robot, tuple(plan.start.tolist())
        merged = MergedMotion(robot, start, [plan], together=False)
        schedule = compile_schedule(robot, start, merged.sample, merged.duration)
        return verify_query(robot, start, schedule, self._query.timeout, self._query.world)

    def _tell(self, answer: Result) -> Status:
        assert isinstance(answer, (Plan, MotionError))
        self.context.publish(Planned(self._query, answer))
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
        super().on_halt()
        answer = self._pending.answer if self._pending else None
        if self._first and not self._query.spare:  # that was about its frames
            answer = self._first
        told = answer if isinstance(answer, (Plan, MotionError)) else PlanCanceled()
        self.context.publish(Planned(self._query, told))


class PlanArm(_PlanGroup):
    """Plan the arm's motion, with the gripper as it is."""

    group = "arm"

    @classmethod
    def waypoints(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """The points of the input `via`."""
        names = [joint.name for joint in robot.actuated_in(cls.group)]
        return [tuple(point[name] for name in names) for point in inputs.get("via", [])]


class PlanGripper(_PlanGroup):
    """Plan the gripper's motion, with the arm at its goal."""

    group = "gripper"
    moved_before = ("arm",)
