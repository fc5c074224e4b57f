"""Leaves that plan a motion of one group of joints, in a worker process."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills.context import Planned
from skills.errors import refuse
from skills.joint_targets import configuration_errors, missing_joint_errors, target_errors
from skills.merged_motion import MergedMotion, verify_query
from skills.motion.errors import (
    GoalInCollision,
    MotionCollides,
    MotionError,
    PlanCanceled,
    StartInCollision,
)
from skills.motion.query import MIN_SPEED, Query, Result, Verify
from skills.motion.trajectory.plan import Plan
from skills.planning_skill import PlanningSkill
from skills.ports import Port, Positions

# Extra distances from obstacles for further plans [m]. The next distance is used if the frames of
# a plan come too close. With much larger distances, there is often no path (measured).
_EXTRA_DISTANCES = (0.002, 0.004, 0.008)


class _PlanGroup(PlanningSkill, register=False):
    """Plan a motion of one group. The other joints stand still during this motion."""

    validates_partial = True
    plans_goal = True
    # Groups that move before this group: they are at their goals when this group starts.
    moved_before: tuple[str, ...] = ()

    INPUT_PORTS = {
        "start": PortInformation(Positions, description="position of every actuated joint [rad]"),
        "goal": PortInformation(Positions, description="target of every actuated joint [rad]"),
        "via": PortInformation(
            list[Positions],
            default_value=[],
            description="positions of the group's joints that the motion passes in order, within "
            "10 mm and without a stop if there is room [rad]",
        ),
        "speed": Port(
            float,
            default_value=1.0,
            description="share of the robot's speed; the motion takes 1 / speed times as long",
            least=MIN_SPEED,
            most=1.0,
        ),
    }
    OUTPUT_PORTS = {"plan": PortInformation(Plan, description="motion of the group")}

    _query: Query
    _first: Plan | None = None  # the plan without extra distance
    _checked: Plan | None = None  # the plan whose frames are being checked

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Check the inputs that are known before the run."""
        ports = [port for port in ("start", "goal") if port in inputs]
        errors = [
            error for port in ports for error in configuration_errors(robot, port, inputs[port])
        ]
        for index, point in enumerate(inputs.get("via", [])):
            if point is not None:
                errors += target_errors(robot, {cls.group: point}, ("via", index))
        refuse(errors)

    def on_start(self) -> Status:
        """Send the query to a worker."""
        robot, joints = self.context.robot, self.context.robot.actuated_in(self.group)
        start, goal, via = (self.get_input(port) for port in ("start", "goal", "via"))
        refuse(missing_joint_errors(robot, "start", start))
        self.validate(robot, {"goal": goal, "via": via})
        arrived = {name for group in self.moved_before for name in robot.groups[group]}
        self._query = Query(
            group=self.group,
            start=tuple((goal if j.name in arrived else start)[j.name] for j in robot.actuated),
            goal=tuple(goal[joint.name] for joint in joints),
            seed=self.context.seed,
            timeout=self.context.timeout,
            via=tuple(tuple(point[joint.name] for joint in joints) for point in via),
            world=self.context.scene.world,
            speed=self.get_input("speed"),
        )
        self._first = self._checked = None
        return self.request(self._query)

    def on_answer(self, answer: Result) -> Status:
        """Write the plan, or first request a check of its frames.

        The frames differ from the plan, because servos turn in whole degrees and one after another.
        If the frames collide, request another plan that keeps more distance. If the frames of every
        plan collide, write the first plan: Execute then reports its collision.

        A straight plan in a world without bodies is written without a check: none of 1400 random
        plans collided. Execute checks its frames.
        """
        if isinstance(answer, Plan):
            self._first = self._first or answer
            if answer.curve.straight and not self._query.world.bodies:
                return self._finish(answer)
            self._checked = answer
            return self.request(self._frames_of(answer))
        checked, self._checked = self._checked, None
        if checked and isinstance(answer, MotionCollides):
            wider = [extra for extra in _EXTRA_DISTANCES if extra > self._query.spare]
            if wider:
                self._query = replace(self._query, spare=wider[0])
                return self.request(self._query)
        elif checked:
            return self._finish(checked)
        if self._first:
            self._query, answer = replace(self._query, spare=0.0), self._first
        return self._finish(answer)

    def _frames_of(self, plan: Plan) -> Verify:
        robot, start = self.context.robot, tuple(plan.start.tolist())
        merged = MergedMotion(robot, start, [plan], together=False)
        return verify_query(robot, start, merged.compile(), self._query.timeout, self._query.world)

    def _finish(self, answer: Result) -> Status:
        assert isinstance(answer, (Plan, MotionError))
        self.context.publish(Planned(self._query, answer))
        if isinstance(answer, StartInCollision) and self.moved_before:
            # The start of a group is the goal of the groups that move first.
            raise GoalInCollision(answer.first, answer.second, answer.distance, answer.margin)
        if isinstance(answer, MotionError):
            raise answer
        self._set_output("plan", answer)
        spent = sum(answer.milliseconds.values())
        self.feedback_message = f"{answer.duration:.2f} s of motion, found in {spent:.1f} ms"
        if not answer.duration:
            is_there = self.context.robot.actuated_in(self.group)
            self.feedback_message = "is there already" if is_there else f"no {self.group}"
        return Status.SUCCESS

    def on_halt(self) -> None:
        """Cancel the request to the planners, and publish what is known about the query."""
        super().on_halt()
        answer = self._job.answer if self._job else None
        answer = self._checked or answer  # if a plan is being checked, it is the answer
        outcome = answer if isinstance(answer, (Plan, MotionError)) else PlanCanceled()
        self.context.publish(Planned(self._query, outcome))


class PlanArm(_PlanGroup):
    """Plan a motion of the arm, with the gripper at its start position."""

    group = "arm"

    @classmethod
    def waypoints(cls, robot: Robot, inputs: Mapping[str, Any]) -> list[tuple[float, ...]]:
        """Return the points of the input `via`, one value per actuated joint of the arm [rad]."""
        names = [joint.name for joint in robot.actuated_in(cls.group)]
        return [tuple(point[name] for name in names) for point in inputs.get("via", [])]


class PlanGripper(_PlanGroup):
    """Plan a motion of the gripper, with the arm at its goal."""

    group = "gripper"
    moved_before = ("arm",)
