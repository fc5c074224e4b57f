"""The arguments of `armtree plan`: joints, a pose, a point for the tool, or a task."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from typing import Any

from executive.goals.moves.goal_words import TASK, Poses, is_point, read_value, read_words
from hardware import Robot
from hardware.loading.dataclass import dataclass
from skills import (
    TOOL_PORTS,
    BadTarget,
    Positions,
    SkillError,
    check_targets,
    query_tool_target,
    refuse,
    tool_target_errors,
)
from skills.motion import MotionError, Query, World
from skills.motion.planner import Planner
from trees import Library
from trees.check import compile_task
from trees.compile.port_types import declaration

from .task_motions import Motion, task_motions

_PORTS = {name: declaration(port) for name, port in TOOL_PORTS.items()}


@dataclass(frozen=True, slots=True)
class PlanRequest:
    """The arguments of `armtree plan`. Values are written as in task files.

    Attributes:
        robot: Description of the robot.
        library: Tasks and poses.
        words: The goal. One of: `JOINT=VALUE`, `JOINT+=CHANGE` and names of poses, applied in
            order, each joint at most once; x, y, z of the tool; the number or name of a task, for
            all motions that are known before a run. Joints that are not named stay at the start.
        group: Group that moves; None for the group of the named joints, else the arm.
        seed: Seed of the planner.
        start: Start, in the form of `words`, but not a task. Other joints are in the start pose of
            the robot file.
        via: Waypoints, each in the form of `start`. Other joints stay at the start.
        tool: Further inputs for a point for the tool: values of TOOL_PORTS, by port.
    """

    robot: Robot
    library: Library
    words: Sequence[str]
    group: str | None
    seed: int
    start: Sequence[str] = ()
    via: Sequence[str] = ()
    tool: Mapping[str, str] = field(default_factory=dict)

    def motions(self, planner: Planner, world: World) -> tuple[list[Motion], list[str]]:
        """Return the motions to plan. Each one starts at the end of the previous one.

        Also returns a message for each motion of a task whose goal is known only in a run.

        Raises:
            BadTarget, OutOfBounds: Goal or start cannot be read, or are invalid.
            UnknownTask, FileError: There is no such task, or its file is invalid.
            MotionError: The tool cannot reach the point.
        """
        if self.group and self.group not in self.robot.groups:
            groups = ", ".join(self.robot.groups)
            raise BadTarget(f"the robot has no group {self.group}; it has {groups}")
        boot = self.robot.by_joint(self.robot.boot_pose)
        poses = self.library.poses()[0]
        reader = _Reader(planner, self.robot, poses, "arm", self.seed, world)
        with _errors_name("--start"):
            start = boot | reader.positions(self.start, boot, {}, goal=False)
        if self.tool and not is_point(self.words, reader.poses):
            options = ", ".join(f"--{port}" for port in self.tool)
            raise BadTarget(f"{options} needs a point for the tool as GOAL; give x y z")
        word = self.words[0] if len(self.words) == 1 else ""
        number = int(word) if word.isdecimal() else self.library.names().get(word)
        if number is not None and word not in poses:
            if self.via:
                raise BadTarget("a task defines its own path; leave out --via")
            return self._motions_of_task(number, planner, tuple(start.values()), world)
        reader.group = self.group or "arm"
        named = reader.positions(self.words, start, self.tool)
        group = reader.group = self.group or self._group_of(named)
        with _errors_name("--via"):
            points = [reader.positions(each.split(), start, {}, goal=False) for each in self.via]
            via = tuple(self._target(group, point, start) for point in points)
        goal = self._target(group, named, start)
        query = Query(group, tuple(start.values()), goal, self.seed, via=via, world=world)
        return [Motion(query)], []

    def _motions_of_task(
        self, number: int, planner: Planner, position: tuple[float, ...], world: World
    ) -> tuple[list[Motion], list[str]]:
        tree = compile_task(self.robot, self.library, number, validated=True)
        motions, unknown = task_motions(
            tree, self.robot, planner, position, world, self.seed, self.group
        )
        if not motions:
            why = f"task {number} has no goal that is known before a run; a goal is known if the "
            why += "inputs of its skill, and of all skills before it, are literal values. "
            why += "".join(f"{message}. " for message in unknown)
            raise BadTarget(why + "Give joints, a pose or a point instead")
        return motions, unknown

    def _target(
        self, group: str, named: Mapping[str, float], start: Mapping[str, float]
    ) -> tuple[float, ...]:
        """Return the target of every joint of a group, from targets of some of its joints."""
        for name in named:
            (own,) = (g for g, members in self.robot.groups.items() if name in members)
            if own != group:
                why = f"{name} belongs to the {own}, but the {group} moves"
                raise BadTarget(f"{why}; leave it out, or give --group {own}")
        names = [joint.name for joint in self.robot.actuated_in(group)]
        target = Positions((name, named.get(name, start[name])) for name in names)
        check_targets(self.robot, {group: target})
        return tuple(target.values())

    def _group_of(self, named: Mapping[str, float]) -> str:
        """Return the group of all named joints."""
        for group, members in self.robot.groups.items():
            if named.keys() <= set(members):
                return group
        why = "belong to different groups; name the joints of one group only"
        raise BadTarget(f"{', '.join(named)} {why}")


@dataclasses.dataclass
class _Reader:
    """Reads words as joint positions."""

    planner: Planner
    robot: Robot
    poses: Poses
    group: str
    seed: int
    world: World

    def positions(
        self,
        words: Sequence[str],
        start: dict[str, float],
        tool: Mapping[str, str],
        *,
        goal: bool = True,
    ) -> dict[str, float]:
        """Return the positions of the joints that the words name.

        Args:
            words: The words, as in PlanRequest.
            start: Position of every actuated joint [rad].
            tool: Further inputs for a point for the tool, by port.
            goal: True if the words are the goal; False if they are the value of an option.
        """
        also = [TASK] if goal else []
        read = read_words(words, self.robot, self.poses, also, quoted=not goal)
        if read.point is not None:
            return self._reach({"point": read.point}, start, tool)
        if read.turn is not None:
            refuse(tool_target_errors(self.robot, {"turn": read.turn, "group": self.group}))
            turned = {"point": (0.0, 0.0, 0.0), "relative": True, "turn": read.turn}
            return self._reach(turned, start, {})
        return {**read.joints, **{name: start[name] + by for name, by in read.changes.items()}}

    def _reach(
        self, target: Mapping[str, Any], start: Mapping[str, float], tool: Mapping[str, str]
    ) -> dict[str, float]:
        """Return the joint positions that bring the tool to a target, given by ports."""
        given = {port: read_value(f"--{port}", text, _PORTS[port]) for port, text in tool.items()}
        for port, value in given.items():
            if errors := tool_target_errors(self.robot, {port: value}):
                raise BadTarget(f"--{port}: {errors[0]}")
        inputs = {**given, **target, "start": start, "group": self.group}
        query = query_tool_target(self.robot, inputs)
        query = replace(query, seed=self.seed, world=self.world)
        names = (joint.name for joint in self.robot.actuated_in(self.group))
        return dict(zip(names, self.planner.reach(query).positions, strict=True))


@contextmanager
def _errors_name(option: str) -> Iterator[None]:
    """Put the name of an option before the message of an error."""
    try:
        yield
    except (SkillError, MotionError) as error:
        error.args = (f"{option}: {error}",)
        raise
