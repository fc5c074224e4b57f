"""What `armtree plan` is asked for: joints, a pose, a point for the tool, or a task."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

from hardware import Robot
from skills import (
    TOOL_PORTS,
    BadTarget,
    Positions,
    SkillError,
    check_distances,
    check_targets,
    check_tool,
    xyz,
)
from skills.motion import MotionError, Query, Reached, ToolQuery, World
from skills.motion.planner import Planner
from trees import UNITS, Declaration, FileError, Library, Place, fit, parse_value
from trees.analysis.check import motions_of
from trees.compile.port_types import declaration

_PORTS = {name: declaration(port) for name, port in TOOL_PORTS.items()}


@dataclass(frozen=True)
class Leg:
    """One motion to be planned.

    Attributes:
        query: What to plan.
        left_out: Bodies that are not in its world, as only a run tells where they are.
        assumed: Whether only a run tells where it starts; here, where the one before ends.
    """

    query: Query
    left_out: tuple[str, ...] = ()
    assumed: bool = False


@dataclass(frozen=True)
class Goal:
    """A goal as it was typed; values are written as in task files.

    Attributes:
        robot: Whose motion.
        library: Tasks and poses.
        words: `JOINT=VALUE`, `JOINT+=CHANGE`, each joint once, and names of poses, each on top of
            those before it, joints not named staying; x, y, z, where the tool shall be; or the
            number of a task, for all that it spells out.
        group: That moves; None for the one whose joints are named, else the arm.
        seed: Of the search.
        start: Where the arm stands, as `words` without a task; joints not named are at their boot
            pose.
        via: Points on the way, each as `start`; joints not named are as at the start.
        tool: What else is said of the point: values of TOOL_PORTS, by port.
    """

    robot: Robot
    library: Library
    words: Sequence[str]
    group: str | None
    seed: int
    start: Sequence[str] = ()
    via: Sequence[str] = ()
    tool: Mapping[str, str] = field(default_factory=dict)

    def legs(self, planner: Planner, world: World) -> tuple[list[Leg], list[str]]:
        """The motions to be planned, each from where the one before ends.

        And in words the moves of a task that are none of them, as nobody knows where they go.

        Raises:
            BadTarget, OutOfBounds: Goal or start cannot be read, or name no joint.
            UnknownTask, FileError: The task is not there, or wrong.
            MotionError: The tool cannot get there.
        """
        if self.group and self.group not in self.robot.groups:
            there = ", ".join(self.robot.groups)
            raise BadTarget(f"the robot has no group {self.group}; it has {there}")
        boot = {joint.name: joint.boot for joint in self.robot.actuated}
        asked = _Asked(planner, self.robot, self.library.poses()[0], "arm", self.seed, world)
        with _within("--start"):
            begin = boot | asked.named(self.start, boot, {}, goal=False)
        if self.tool and not asked.is_point(self.words):
            options = ", ".join(f"--{port}" for port in self.tool)
            raise BadTarget(f"{options} goes with a point for the tool; give x y z")
        if len(self.words) == 1 and self.words[0].isdecimal():
            if self.via:
                raise BadTarget("a task goes its own way; leave out --via")
            start = tuple(begin.values())
            return self._task(planner, start, world)
        asked.group = self.group or "arm"
        named = asked.named(self.words, begin, self.tool)
        asked.group = self.group or self._group(named)
        with _within("--via"):
            stations = [asked.named(each.split(), begin, {}, goal=False) for each in self.via]
            via = tuple(self._target(asked.group, each, begin) for each in stations)
        goal = self._target(asked.group, named, begin)
        start = tuple(begin.values())
        query = Query(asked.group, start, goal, self.seed, via=via, world=world)
        return [Leg(query)], []

    def _task(
        self, planner: Planner, begin: tuple[float, ...], world: World
    ) -> tuple[list[Leg], list[str]]:
        """As the skills move: the arm with the gripper as it is, then the gripper."""
        number = int(self.words[0])

        def reach(query: ToolQuery) -> Reached:
            return planner.reach(replace(query, seed=self.seed))

        motions, unknown = motions_of(
            self.robot, self.library, number, planner.carry, reach, begin, world
        )
        if not motions:
            why = (
                f"no goal of task {number} is known before it runs; one is known if the inputs of "
            )
            why += "its skill, and of all skills before it, are written down. "
            why += "".join(f"{each}. " for each in unknown)
            raise BadTarget(why + "Give joints, a pose or a point instead")
        legs, still = list[Leg](), list[Leg]()
        for motion in motions:
            for group in self.robot.groups:
                own = [joint in self.robot.actuated_in(group) for joint in self.robot.actuated]
                goal = tuple(q for q, mine in zip(motion.pose, own, strict=True) if mine)
                ends = zip(motion.pose, begin, own, strict=True)
                arrived = tuple(there if mine else here for there, here, mine in ends)
                via = motion.via if group == "arm" else ()
                query = Query(group, begin, goal, self.seed, via=via, world=motion.world)
                if group == (self.group or group):
                    asked = self.group or via or arrived != begin
                    leg = Leg(query, motion.left_out, assumed=motion.start is None)
                    (legs if asked else still).append(leg)
                begin = arrived
        return legs or still[:1], unknown

    def _target(
        self, group: str, named: Mapping[str, float], begin: Mapping[str, float]
    ) -> tuple[float, ...]:
        """Of every joint of a group."""
        joints = [joint.name for joint in self.robot.actuated_in(group)]
        self._check_group(group, named)
        target = Positions((name, named.get(name, begin[name])) for name in joints)
        check_targets(self.robot, {group: target})
        return tuple(target.values())

    def _check_group(self, group: str, named: Mapping[str, float]) -> None:
        for name in named:
            (own,) = (g for g, members in self.robot.groups.items() if name in members)
            if own != group:
                why = f"{name} is of the {own}, and what moves is the {group}"
                raise BadTarget(f"{why}; leave it out, or give --group {own}")

    def _group(self, named: Mapping[str, float]) -> str:
        """The one that all named joints belong to."""
        for group, members in self.robot.groups.items():
            if named.keys() <= set(members):
                return group
        raise BadTarget(f"{', '.join(named)} are in several groups; plan for one at a time")


@dataclass
class _Asked:
    """Reads places."""

    planner: Planner
    robot: Robot
    poses: Mapping[str, Mapping[str, float]]
    group: str
    seed: int
    world: World

    def is_point(self, words: Sequence[str]) -> bool:
        """Whether these are x, y, z."""
        return len(words) == 3 and not any("=" in word or word in self.poses for word in words)

    def named(
        self,
        words: Sequence[str],
        begin: dict[str, float],
        tool: Mapping[str, str],
        *,
        goal: bool = True,
    ) -> dict[str, float]:
        """Positions of the joints that words speak of.

        Args:
            words: As in a Goal.
            begin: Where the arm stands, all actuated joints.
            tool: What else is said of a point.
            goal: Whether they are the goal itself, not what an option takes.
        """
        _check_words(words, goal, next(joint.name for joint in self.robot.actuated))
        if self.is_point(words):
            return self._reached(words, begin, tool)
        units = {joint.name: joint.unit for joint in self.robot.actuated}
        named, once = dict[str, float](), set[str]()
        for word in words:
            name, equals, text = word.partition("=")
            joint = name.removesuffix("+")
            if equals:
                _check_names((joint,), units)
                if joint in once:
                    raise BadTarget(f"{joint} is given twice; give it once, with all of its way")
                once.add(joint)
                kind = "length" if units[joint] == "m" else "angle"
                value: float = _read(joint, text, Declaration(kind))
                if joint != name:
                    check_distances(self.robot, {joint: value})
                    value += (begin | named)[joint]
                named[joint] = value
            elif word in self.poses:
                named |= self.poses[word]
            else:
                raise BadTarget(_no_pose(word, self.poses, goal))
        _check_names(named, units)
        return named

    def _reached(
        self, words: Sequence[str], begin: Mapping[str, float], tool: Mapping[str, str]
    ) -> dict[str, float]:
        given = {port: _read(f"--{port}", text, _PORTS[port]) for port, text in tool.items()}
        for port, value in given.items():
            try:
                check_tool(self.robot, {port: value})
            except BadTarget as error:
                raise BadTarget(f"--{port}: {error}") from error
        point = _read("point", f"[{', '.join(words)}]", _PORTS["point"])
        query = ToolQuery(
            group=self.group,
            start=tuple(begin.values()),
            point=xyz("point", point),
            direction=given.get("direction"),
            link=given.get("tool", ""),
            offset=given.get("offset", (0.0, 0.0, 0.0)),
            axis=given.get("axis"),
            relative=given.get("relative", False),
            seed=self.seed,
            world=self.world,
        )
        joints = (joint.name for joint in self.robot.actuated_in(self.group))
        return dict(zip(joints, self.planner.reach(query).positions, strict=True))


def _read(what: str, text: str, wanted: Declaration) -> Any:
    """A value as it would stand in a task file."""
    if not text:
        raise BadTarget(f"{what} is given no value")

    def wrong(place: Place, why: str) -> None:
        raise BadTarget(f"{what}: {why}")

    try:
        return fit(parse_value(text, what), wanted, {}, wrong)
    except FileError as error:
        raise BadTarget(f"{what}: {error.mistakes[0].message}") from error


@contextmanager
def _within(option: str) -> Iterator[None]:
    """What is wrong with the values of an option is told with its name."""
    try:
        yield
    except (SkillError, MotionError) as error:
        error.args = (f"{option}: {error}",)
        raise


def _check_words(words: Sequence[str], goal: bool, joint: str) -> None:
    """Refuse what is one word and stands in several; the joint is for an example."""
    for word in words:
        name, equals, value = word.partition("=")
        sign = "+=" if name.endswith("+") else "="
        name = name.removesuffix("+")
        if equals and not name.strip():
            why = "names no joint; write it in one word, such as"
            raise BadTarget(f"{word!r} {why} {joint}=0.5")
        if equals and name != name.strip():
            right = f"{name.strip()}{sign}{value.strip()}"
            raise BadTarget(f"{word!r} has blanks in it; write {right}")
    for before, word in pairwise(words):
        if any(word in units for units in UNITS.values()):
            why = f"{word!r} stands apart from its number; write {before}{word} in one word"
            raise BadTarget(f"{why}, or both in quotes" if goal else why)


def _no_pose(word: str, poses: Mapping[str, object], goal: bool) -> str:
    """What may stand there instead; a task goes its own way, so only the goal may be one."""
    if goal and word.isdecimal():
        why = f"{word!r} is the number of a task, and goes alone"
        return f"{why}; plan one task at a time, or give x y z of the tool"
    there = f"{word!r} is no pose; there are {', '.join(poses)}. Or give"
    ways = "JOINT=VALUE or JOINT+=CHANGE"
    if goal:
        return f"{there} {ways}, x y z of the tool, or the number of a task"
    return f"{there} {ways} or x y z of the tool, all of it in one pair of quotes"


def _check_names(named: Collection[str], there: Collection[str]) -> None:
    for name in named:
        if name not in there:
            raise BadTarget(f"{name} is no joint that can be set; there are {', '.join(there)}")
