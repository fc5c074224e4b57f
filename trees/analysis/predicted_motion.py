"""What is around the arm by the time of each motion, as far as a task spells it out."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy

from hardware import Robot
from skills import Positions, Skill, WorldChange
from skills.motion import EMPTY, Body, Carry, MotionError, Reached, ToolQuery, World
from trees.compile.builder import target_of
from trees.compile.leaf import Leaf
from trees.compile.skill_hooks import Asking, Pose
from trees.errors import Place
from trees.nodes.control import Guard, Repeat, Retry, Timeout, WaitFor

# What these hold has been done, in its order, wherever the tree goes on behind them.
_IN_TURN = (composites.Sequence, Guard, Retry, Timeout, WaitFor)
_UNNAMED = "bodies named at run time"
_UNKNOWN = "only a run of the task tells from where, or where to"


@dataclass(frozen=True)
class Motion:
    """A target that follows from what a task spells out.

    Attributes:
        place: Where it is written.
        pose: Values of the actuated joints [rad].
        start: Where the arm stands before [rad]; None where only the run tells.
        world: What is around the arm when it goes there.
        left_out: Names of bodies that are not in that world, as only the run tells whether they are
            there, and where.
        via: Points that the arm passes on the way there: values of its own joints [rad].
    """

    place: Place
    pose: Pose
    start: Pose | None
    world: World
    left_out: tuple[str, ...]
    via: tuple[Pose, ...] = ()


@dataclass(frozen=True)
class Foreseen:
    """What follows from what a task spells out.

    Attributes:
        motions: In their order.
        unknown: Nodes that move the arm too, each with why nobody knows where to.
    """

    motions: list[Motion]
    unknown: dict[Behaviour, str]


def foresee(
    root: Behaviour,
    leaves: Iterable[Leaf],
    robot: Robot,
    carry: Callable[[Carry], Body],
    start: Pose | None = None,
    world: World = EMPTY,
    *,
    asking: Asking,
    reach: Callable[[ToolQuery], Reached] | None = None,
) -> Foreseen:
    """The motions of a task, each in the world as the task has made it by then.

    Args:
        root: Of the task's tree.
        leaves: Its skills.
        robot: The robot.
        carry: Hands a body over to another link; may raise a MotionError.
        start: Where the arm stands at first [rad]; None where that is not known.
        world: What is around it at first.
        asking: Asks the code of its skills; knows the nodes that are wrong.
        reach: Says where the joints are for the tool to be at a point; may raise a MotionError.
            None where nobody shall be asked, and such a point is as good as unknown.
    """
    walk = _Walk({leaf.skill: leaf for leaf in leaves}, robot, carry, asking, reach)
    walk.through(root, _Now(world, start))
    return Foreseen(walk.motions, walk.unknown)


@dataclass(frozen=True)
class _Now:
    """What is known at one moment.

    Attributes:
        world: Bodies.
        pose: Where the arm stands.
        unsure: Names of bodies that may be there.
        keys: Configurations by key, and targets of some joints.
    """

    world: World
    pose: Pose | None
    unsure: frozenset[str] = frozenset()
    keys: Mapping[str, Positions] = field(default_factory=dict)

    def having(self, body: Body) -> "_Now":
        """With a body, in place of one of its name."""
        unsure = self.unsure - {body.name}
        new = replace(body, touches=body.touches - unsure)
        known = {each.name: each for each in self.world.bodies} | {body.name: new}
        return replace(self, world=World(tuple(known.values())), unsure=unsure)

    def without(self, names: Iterable[str]) -> "_Now":
        """With these bodies gone."""
        gone = frozenset(names)
        rest = tuple(body for body in self.world.bodies if body.name not in gone)
        return replace(self, world=World(rest), unsure=self.unsure - gone)

    def lost(self) -> "_Now":
        """With nothing known of where the arm stands."""
        return replace(self, pose=None, keys={})

    def unsure_of(self, names: Iterable[str]) -> "_Now":
        """With these bodies known no more."""
        now = self.without(names)
        unsure = now.unsure | frozenset(names)
        rest = (replace(body, touches=body.touches - unsure) for body in now.world.bodies)
        return replace(now, world=World(tuple(rest)), unsure=unsure)


class _Walk:
    def __init__(
        self,
        leaves: Mapping[Behaviour, Leaf],
        robot: Robot,
        carry: Callable[[Carry], Body],
        asking: Asking,
        reach: Callable[[ToolQuery], Reached] | None,
    ) -> None:
        self._leaves, self._robot, self._carry = leaves, robot, carry
        self._asking, self._reach = asking, reach
        self._why = _UNKNOWN  # the next target is not known
        self.unknown: dict[Behaviour, str] = {}
        self._again = False  # within the second round of a repeat
        self.motions: list[Motion] = []

    def through(self, node: Behaviour, now: _Now) -> _Now:
        """What is known after a node."""
        if isinstance(node, Skill):
            return self._after(self._leaves[node], now)
        if isinstance(node, Dummy):  # whatever was meant may have changed anything
            return now.unsure_of((_UNNAMED, *(body.name for body in now.world.bodies))).lost()
        if isinstance(node, _IN_TURN):
            for child in node.children:
                now = self.through(child, now)
            return now
        if isinstance(node, Repeat):
            return self._repeated(node, now)
        ways = [now]  # of a selector, a parallel: nobody knows how far each child comes
        for child in node.children:
            ways.append(self.through(child, _common(ways)))
        return _common(ways)

    def _repeated(self, node: Repeat, now: _Now) -> _Now:
        """What every round leaves; of the second one, the motions that the first has not."""
        once = self.through(node.decorated, now)
        if node.times == 1 or once == now:  # any further round would be the same
            return once
        if self._again:  # else repeats within each other double the rounds at every level
            return _common((now, once))
        first, self._again = len(self.motions), True
        twice = self.through(node.decorated, once)
        self._again = False
        known = {(motion.pose, motion.world) for motion in self.motions[:first]}
        again = self.motions[first:]
        self.motions[first:] = [m for m in again if (m.pose, m.world) not in known]
        return _common((once, twice))

    def _after(self, leaf: Leaf, now: _Now) -> _Now:
        kind = type(leaf.skill)
        ports = kind.input_ports().keys() & leaf.keys.keys()
        found = {port: now.keys[leaf.keys[port]] for port in ports if leaf.keys[port] in now.keys}
        inputs = {**leaf.known, **found}
        poses = self._asking.poses(leaf, self._robot, inputs)
        for pose in poses:
            left_out = tuple(sorted(now.unsure))
            self.motions.append(Motion(target_of(leaf), pose, now.pose, now.world, left_out))
            now = replace(now, pose=pose)
        if not poses and "goal" in (*kind.output_ports(), *leaf.inputs):  # found by other means
            now = replace(now, pose=None)
            self.unknown.setdefault(leaf.skill, self._why)
            self._why = _UNKNOWN
        now = self._written(leaf, now)
        if self._reach and kind.tool_output in leaf.keys:
            now = self._reached(leaf, inputs, self._reach, now)
        self._pass(leaf, inputs)
        if kind.world_change:
            now = self._changed(leaf, kind.world_change, now)
        return now

    def _written(self, leaf: Leaf, now: _Now) -> _Now:
        """With the configuration that a skill writes, and no other that it may write."""
        outputs = {leaf.keys[port] for port in type(leaf.skill).output_ports() if port in leaf.keys}
        keys = {key: value for key, value in now.keys.items() if key not in outputs}
        key = leaf.keys.get(type(leaf.skill).pose_output)
        if now.pose and key in outputs:
            names = (joint.name for joint in self._robot.actuated)
            keys[key] = Positions(zip(names, now.pose, strict=True))
        return replace(now, keys=keys)

    def _reached(
        self,
        leaf: Leaf,
        inputs: Mapping[str, Any],
        reach: Callable[[ToolQuery], Reached],
        now: _Now,
    ) -> _Now:
        """With the target that brings the tool to a point, where all of it is known."""
        query = self._asking.tool_query(leaf, self._robot, inputs)
        if not query:
            return now
        try:
            answer = reach(replace(query, world=now.world))
        except MotionError as error:
            self._why = str(error)
            return now
        names = (joint.name for joint in self._robot.actuated_in(query.group))
        target = Positions(zip(names, answer.positions, strict=True))
        key = leaf.keys[type(leaf.skill).tool_output]
        return replace(now, keys={**now.keys, key: target})

    def _pass(self, leaf: Leaf, inputs: Mapping[str, Any]) -> None:
        """Have the motion to a goal pass the points on its way."""
        goal = tuple(inputs.get("goal", {}).values())
        if goal and self.motions and self.motions[-1].pose == goal:
            via = self._asking.waypoints(leaf, self._robot, inputs)
            self.motions[-1] = replace(self.motions[-1], via=tuple(via) or self.motions[-1].via)

    def _changed(self, leaf: Leaf, change: WorldChange, now: _Now) -> _Now:
        """With the body that a skill adds, hands over or removes."""
        skill, known = leaf.skill, leaf.known
        if "body" not in known:
            return now.unsure_of((_UNNAMED, *(body.name for body in now.world.bodies)))
        name = known["body"]
        if change is WorldChange.REMOVES:
            return now.without((name,))
        if skill in self._asking.doubtful:
            return now.unsure_of((name,))
        adds = change is WorldChange.ADDS
        body = self._asking.body(leaf) if adds else self._carried(skill, known, now)
        return now.having(body) if body else now.unsure_of((name,))

    def _carried(self, skill: Skill, known: Mapping[str, Any], now: _Now) -> Body | None:
        """A body in its new hands; None where it is not known where these are."""
        link = known.get("link") if "link" in skill.input_ports() else ""
        if now.pose is None or link is None:
            return None
        try:
            return self._carry(Carry(now.world, known["body"], link, now.pose))
        except MotionError:  # the body is not known here
            return None


def _common(ways: Sequence[_Now]) -> _Now:
    """What is known whichever way was taken."""
    first, *others = ways
    unsure = {name for way in ways for name in way.unsure}
    bodies = {body for way in ways for body in way.world.bodies}
    unsure |= {body.name for body in bodies if any(body not in way.world.bodies for way in ways)}
    pose = first.pose if all(way.pose == first.pose for way in others) else None
    keys = {
        key: q for key, q in first.keys.items() if all(q == way.keys.get(key) for way in others)
    }
    return replace(first, pose=pose, keys=keys).unsure_of(unsure)
