"""What `armtree plan` is asked for: joints, a pose, a point for the tool, or a task."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from executive.building.check import targets_of
from hardware import Robot
from skills import BadTarget, Positions, check_targets, three
from skills.motion import Query, ToolQuery, World
from skills.motion.planner import Planner
from trees import Library


@dataclass(frozen=True)
class Goal:
    """A goal as it was typed.

    Attributes:
        robot: Whose motion.
        library: Tasks and poses.
        words: `JOINT=VALUE` or `JOINT+=CHANGE` [rad], joints not named staying; the name of a
            pose; three numbers, where the tool shall be [m]; or the number of a task, for all that
            it spells out.
        group: That moves; None for the one whose joints are named, else the arm.
        seed: Of the search.
        via: Points on the way, each in words as a goal of joints and poses.
        direction: Where the tool shall point, with a goal of three numbers.
    """

    robot: Robot
    library: Library
    words: Sequence[str]
    group: str | None
    seed: int
    via: Sequence[str] = ()
    direction: tuple[float, float, float] | None = None

    def queries(self, planner: Planner, start: Sequence[str], world: World) -> list[Query]:
        """The motions to be planned, each from where the one before ends.

        Raises:
            BadTarget, OutOfBounds: Goal or start cannot be read, or name no joint.
            UnknownTask, FileError: The task is not there, or wrong.
            MotionError: The tool cannot get there.
        """
        if self.group and self.group not in self.robot.groups:
            there = ", ".join(self.robot.groups)
            raise BadTarget(f"the robot has no group {self.group}; it has {there}")
        begin, group = self._start(start), self.group or "arm"
        a_point = len(self.words) == 3 and not any("=" in word for word in self.words)
        if self.direction and not a_point:
            raise BadTarget("a direction goes with a point for the tool; give x y z")
        if len(self.words) == 1 and self.words[0].isdecimal():
            if self.via:
                raise BadTarget("a task goes its own way; leave out --via")
            return self._task(int(self.words[0]), group, begin, world)
        if a_point:
            point = three("point", [_number(word) for word in self.words])
            tool = ToolQuery(group, begin, point, self.direction, seed=self.seed, world=world)
            goal = planner.reach(tool).positions
        else:
            group, goal = self._joints(self.words, begin, self.group)
        via = tuple(self._joints(words.split(), begin, group)[1] for words in self.via)
        return [Query(group, begin, goal, self.seed, via=via, world=world)]

    def _task(self, number: int, group: str, begin: tuple[float, ...], world: World) -> list[Query]:
        """As the skills move: the arm with the gripper as it is, the gripper where the arm goes."""
        poses = targets_of(self.robot, self.library, number)
        if not poses:
            why = "it finds its way while it runs; give joints, a pose or a point"
            raise BadTarget(f"task {number} spells out no whole target: {why}")
        own = [joint in self.robot.leaders(group) for joint in self.robot.actuated]
        queries = []
        for pose in poses:
            goal = tuple(q for q, mine in zip(pose, own, strict=True) if mine)
            rows = zip(pose, begin, own, strict=True)
            arrived = group == "gripper"
            start = tuple(then if arrived and not mine else now for then, now, mine in rows)
            queries.append(Query(group, start, goal, self.seed, world=world))
            begin = pose
        return queries

    def _start(self, words: Sequence[str]) -> tuple[float, ...]:
        values = self._values(words, {joint.name: joint.boot for joint in self.robot.actuated})
        _check_names(values, [joint.name for joint in self.robot.actuated])
        return tuple(values.get(joint.name, joint.boot) for joint in self.robot.actuated)

    def _joints(
        self, words: Sequence[str], begin: tuple[float, ...], group: str | None
    ) -> tuple[str, tuple[float, ...]]:
        """The group that moves, and where to."""
        names = [joint.name for joint in self.robot.actuated]
        now = dict(zip(names, begin, strict=True))
        values = self._values(words, now)
        group = group or self._group(values)
        joints = self.robot.leaders(group)
        _check_names(values, [joint.name for joint in joints])
        target = Positions(
            (joint.name, values.get(joint.name, now[joint.name])) for joint in joints
        )
        check_targets(self.robot, {group: target})
        return group, tuple(target.values())

    def _group(self, values: Mapping[str, float]) -> str:
        """The one that all named joints belong to."""
        _check_names(values, [joint.name for joint in self.robot.actuated])
        for group, members in self.robot.groups.items():
            if values.keys() <= set(members):
                return group
        raise BadTarget(f"{', '.join(values)} are in several groups; plan for one at a time")

    def _values(self, words: Sequence[str], now: Mapping[str, float]) -> dict[str, float]:
        """Of `JOINT=VALUE`, of `JOINT+=CHANGE` from now, and of poses; the later ones count."""
        values, poses = dict[str, float](), self.library.poses()[0]
        for word in words:
            name, equals, number = word.partition("=")
            if equals:
                joint = name.removesuffix("+")
                values[joint] = _number(number) + (now.get(joint, 0.0) if joint != name else 0.0)
            elif word in poses:
                values |= poses[word]
            else:
                raise BadTarget(f"{word!r} is no {_choices(poses)}")
        return values


def _choices(poses: Mapping[str, object]) -> str:
    return (
        f"pose; there are {', '.join(poses)}. Or give JOINT=VALUE or JOINT+=CHANGE [rad], "
        "x y z of the tool [m], or the number of a task"
    )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise BadTarget(f"{text!r} is no number; write JOINT=VALUE, or x y z") from error


def _check_names(values: Mapping[str, float], names: Sequence[str]) -> None:
    for name in values:
        if name not in names:
            raise BadTarget(f"{name} is no joint that can be set; there are {', '.join(names)}")
