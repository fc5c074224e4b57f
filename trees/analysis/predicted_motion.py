"""Predicted motion: the motions of a task and the world during each, from the text of the task."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import Any

from py_trees.behaviour import Behaviour

from hardware import Joint, Robot
from hardware.loading.dataclass import dataclass
from hardware.spelling import closest
from skills import Positions, Skill, WorldChange
from skills.motion import (
    EMPTY,
    Body,
    Carry,
    GoalInCollision,
    MotionError,
    Query,
    Reached,
    ToolQuery,
    Unreachable,
    World,
)
from trees.compile.compiler import CompiledTree
from trees.compile.leaf import Leaf
from trees.compile.port_types import known_skills
from trees.compile.skill_hooks import Pose, SkillHooks
from trees.errors import Mistake, Place
from trees.nodes.kind import Flow
from trees.reading.lines import added_above
from trees.reading.literals import in_unit_of

_INSIDE = 1e-3  # distance of a suggested point from the limit of the reach [m]
ROUNDS = 100  # largest number of predicted rounds of all loops, without their first rounds
_UNNAMED = "bodies named at run time"
_UNKNOWN = "its start or target is known only during a run"


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion to a target that is known before the run.

    Attributes:
        node: Node with the target.
        place: Place of the target in a file.
        pose: Target of the actuated joints [rad].
        start: Configuration before the motion [rad]; None if unknown before the run.
        world: World during the motion.
        left_out: Names of bodies that are not in `world`, because their presence or pose is unknown
            before the run.
        via: Waypoints before the target: positions of the joints of the group `arm` [rad].
        speeds: Fraction of the robot's speed, by group; 1 for groups that are not listed.
    """

    node: Behaviour = field(compare=False)
    place: Place
    pose: Pose
    start: Pose | None
    world: World
    left_out: tuple[str, ...]
    # Skills that plan the same motion add these values one after the other.
    via: tuple[Pose, ...] = field(default=(), compare=False)
    speeds: Mapping[str, float] = field(default_factory=dict, compare=False)

    def queries(self, robot: Robot, start: Pose, seed: int = 1) -> Iterator[Query]:
        """Yield the planner's query for each group. As in a run, the gripper moves after the arm.

        Args:
            robot: The robot.
            start: Configuration before the motion [rad].
            seed: Seed of the planner.
        """
        for group in robot.groups:
            own = [joint in robot.actuated_in(group) for joint in robot.actuated]
            yield Query(
                group,
                start,
                tuple(q for q, mine in zip(self.pose, own, strict=True) if mine),
                seed,
                via=self.via if group == "arm" else (),
                world=self.world,
                speed=self.speeds.get(group, 1.0),
            )
            pairs = zip(self.pose, start, own, strict=True)
            start = tuple(there if mine else here for there, here, mine in pairs)

    def least_time(self, robot: Robot) -> float:
        """Return the least duration [s]: that of the slowest joint; 0 if the start is unknown."""
        least = 0.0
        for group in robot.groups if self.start else ():
            for joint, begin, end in zip(robot.actuated, self.start or (), self.pose, strict=True):
                if joint in robot.actuated_in(group):
                    share = self.speeds.get(group, 1.0)
                    least = max(least, _least_time(joint, abs(end - begin)) / share)
        return least


@dataclass(frozen=True, slots=True)
class PredictedMotions:
    """The motions of a task.

    Attributes:
        motions: Motions with a known target, in order.
        unknown: Missing motions, by node: the reason that a node has an unknown target, or the
            rounds of a loop that are left out.
        absent: Bodies that a task uses and that are certainly missing: name of the body, a similar
            name of a present body or "", and place of the node, by place of the use.
        mistakes: Mistakes of points that the tool cannot reach without a collision, and of detached
            bodies that no link carries.
        times: Least time that a skill needs to move the arm [s], by skill.
    """

    motions: list[Motion] = field(default_factory=list)
    unknown: dict[Behaviour, str] = field(default_factory=dict)
    absent: dict[Place, tuple[str, str, Place]] = field(default_factory=dict)
    mistakes: list[Mistake] = field(default_factory=list)
    times: dict[Behaviour, float] = field(default_factory=dict)


def predict_motions(
    tree: CompiledTree,
    robot: Robot,
    carry: Callable[[Carry], Body],
    start: Pose | None = None,
    world: World = EMPTY,
    *,
    hooks: SkillHooks | None = None,
    reach: Callable[[ToolQuery], Reached] | None = None,
    duration: Callable[[Leaf, Motion], float] | None = None,
) -> PredictedMotions:
    """Predict the motions of a task, and the world during each motion.

    Args:
        tree: The compiled task.
        robot: The robot.
        carry: Callback that fixes a body to another link. It may raise a MotionError.
        start: Configuration before the task [rad]; None if unknown.
        world: World before the task.
        hooks: Caller of the hooks of skills. Default: that of the tree.
        reach: Callback that returns joint positions for a point of the tool. It may raise a
            MotionError. If None, targets that are given as points are unknown.
        duration: Callback that returns the time of a skill for a motion [s]. Default: the least
            time.
    """
    duration = duration or (lambda _, motion: motion.least_time(robot))
    walk = _Walk(tree, robot, carry, hooks or tree.hooks, reach, duration, ROUNDS)
    walk.through(tree.root, _State(world, start))
    return walk.found


@dataclass(frozen=True, slots=True)
class _State:
    """The known state at one moment of a task.

    Attributes:
        world: Bodies that are certainly present.
        pose: Configuration of the arm [rad]; None if unknown.
        unsure: Names of bodies that may be present.
        keys: Known joint positions on the blackboard, by full name of the key.
    """

    world: World
    pose: Pose | None
    unsure: frozenset[str] = frozenset()
    keys: Mapping[str, Positions] = field(default_factory=dict)

    def with_body(self, body: Body) -> "_State":
        """Return the state with a body, which replaces a body of the same name."""
        unsure = self.unsure - {body.name}
        new = replace(body, touches=body.touches - unsure)
        return replace(self, world=self.world.adding(new), unsure=unsure)

    def without(self, names: Iterable[str]) -> "_State":
        """Return the state without bodies of these names."""
        gone = frozenset(names)
        rest = tuple(body for body in self.world.bodies if body.name not in gone)
        return replace(self, world=World(rest), unsure=self.unsure - gone)

    def lost(self) -> "_State":
        """Return the state with an unknown configuration of the arm and no known keys."""
        return replace(self, pose=None, keys={})

    def unsure_of(self, names: Iterable[str]) -> "_State":
        """Return the state in which bodies of these names are possibly present."""
        now = self.without(names)
        unsure = now.unsure | frozenset(names)
        rest = (replace(body, touches=body.touches - unsure) for body in now.world.bodies)
        return replace(now, world=World(tuple(rest)), unsure=unsure)


@dataclasses.dataclass
class _Walk:
    _tree: CompiledTree
    _robot: Robot
    _carry: Callable[[Carry], Body]
    _hooks: SkillHooks
    _reach: Callable[[ToolQuery], Reached] | None
    _duration: Callable[[Leaf, Motion], float]
    _rounds_left: int  # rounds that may still be added
    found: PredictedMotions = field(default_factory=PredictedMotions)
    _why: str = _UNKNOWN  # reason that the next target is unknown
    # The motion to the last target: None if the arm has reached it, empty if it is unknown.
    _ahead: tuple[Motion, ...] | None = None

    def through(self, node: Behaviour, now: _State) -> _State:
        """Return the state after a node."""
        if leaf := self._tree.leaves.get(node):
            return self._after(leaf, now)
        control = self._tree.controls.get(node)
        if not control:  # a placeholder: the intended node may change anything
            return now.unsure_of((_UNNAMED, *(body.name for body in now.world.bodies))).lost()
        flow = control.kind.flow(control.options)
        if flow is Flow.SEQUENCE:
            return self._rounds(node, control.kind.rounds(control.options), now)
        states = [now]  # any number of its children may have run
        before, after = self._ahead, list[tuple[Motion, ...] | None]()
        for child in node.children:
            # A later child may start where an earlier one has stopped.
            self._ahead = before if flow is Flow.PARALLEL or not after else ()
            states.append(self.through(child, _common(states)))
            after.append(self._ahead)
        self._ahead = after[-1] if all(each == after[-1] for each in after) else ()
        return _common(states)

    def _rounds(self, node: Behaviour, rounds: int | None, now: _State) -> _State:
        """Return the known state after the last round of a loop. Add the motions of all rounds.

        If the number of rounds is unknown, add the motions of the first two rounds. A round is left
        out if earlier motions have the same targets and worlds.
        """
        motions = self.found.motions
        before = len(motions)
        states = [self._in_turn(node, now)]
        moves, stable, shown = len(motions) > before, states == [now], 1
        while not stable and len(states) < (rounds or 2) and self._rounds_left:
            self._rounds_left -= 1  # all loops share it, because nested loops multiply the work
            first = len(motions)
            states.append(self._in_turn(node, states[-1]))
            stable = states[-1] == states[-2]
            known = {(motion.pose, motion.world) for motion in motions[:first]}
            if all((motion.pose, motion.world) in known for motion in motions[first:]):
                del motions[first:]
            else:
                shown += 1
        if not stable and len(states) != rounds:  # also if the number of rounds is unknown
            self.found.unknown[node] = f"its rounds after number {len(states)} are left out"
            return _common(states)
        if rounds is None:
            return _common(states)
        if moves and shown < rounds:
            left = f"{rounds - shown} of its {rounds} rounds"
            self.found.unknown[node] = f"{left} have the targets of earlier rounds and are left out"
        return states[-1]

    def _in_turn(self, node: Behaviour, now: _State) -> _State:
        for child in node.children:
            now = self.through(child, now)
        return now

    def _after(self, leaf: Leaf, now: _State) -> _State:
        kind = type(leaf.skill)
        ports = kind.input_ports().keys() & leaf.keys.keys()
        found = {port: now.keys[leaf.keys[port]] for port in ports if leaf.keys[port] in now.keys}
        inputs = {**leaf.known, **found}
        poses = self._hooks.poses(leaf, self._robot, inputs)
        for pose in poses:
            left_out = tuple(sorted(now.unsure))
            place = leaf.target_place
            motion = Motion(leaf.skill, place, pose, now.pose, now.world, left_out)
            self.found.motions.append(motion)
            self._ahead = (motion,) if now.pose and self._ahead is None else ()
            now = replace(now, pose=pose)
        # Without poses, the target is found during the run.
        if not poses and "goal" in {*kind.output_ports(), *leaf.inputs}:
            now, self._ahead = replace(now, pose=None), ()
            self.found.unknown.setdefault(leaf.skill, self._why)
            self._why = _UNKNOWN
        if leaf.skill.moves:
            times = self.found.times
            time = sum(self._duration(leaf, motion) for motion in self._ahead or ())
            times[leaf.skill] = min(times.get(leaf.skill, math.inf), time)
            self._ahead = None
        now = self._written(leaf, now)
        if kind.tool_output in leaf.keys:
            now = self._reached(leaf, inputs, now)
        if kind.plans_goal:
            self._pass(leaf, inputs)
        if kind.world_change:
            now = self._changed(leaf, kind.world_change, now)
        return now

    def _written(self, leaf: Leaf, now: _State) -> _State:
        """Return the state after a skill has written its outputs to the blackboard."""
        outputs = {leaf.keys[port] for port in type(leaf.skill).output_ports() if port in leaf.keys}
        keys = {key: value for key, value in now.keys.items() if key not in outputs}
        key = leaf.keys.get(type(leaf.skill).pose_output)
        if now.pose and key in outputs:
            keys[key] = Positions(self._robot.by_joint(now.pose))
        return replace(now, keys=keys)

    def _reached(self, leaf: Leaf, inputs: Mapping[str, Any], now: _State) -> _State:
        """Return the state with the joint positions for a known point of the tool."""
        query = self._reach and self._hooks.tool_query(leaf, self._robot, inputs)
        if not self._reach or not query:
            return now
        try:
            answer = self._reach(replace(query, world=now.world))
        except MotionError as error:
            self._why = str(error)
            if isinstance(error, Unreachable):
                self.found.mistakes.append(self._unreachable(leaf, query, error))
            elif isinstance(error, GoalInCollision):
                self.found.mistakes.append(Mistake(_place_of_point(leaf), str(error)))
            return now
        names = (joint.name for joint in self._robot.actuated_in(query.group))
        target = Positions(zip(names, answer.positions, strict=True))
        key = leaf.keys[type(leaf.skill).tool_output]
        return replace(now, keys={**now.keys, key: target})

    def _unreachable(self, leaf: Leaf, query: ToolQuery, error: Unreachable) -> Mistake:
        """Return the mistake of an unreachable point. Suggests a reachable point near it."""
        point = leaf.written.get("point")
        if not point or query.relative or query.direction or not self._reach:
            return Mistake(_place_of_point(leaf), str(error))
        pairs = zip(error.nearest, error.point, strict=True)
        inside = [near - _INSIDE * (far - near) / error.distance for near, far in pairs]
        text, (x, y, z) = in_unit_of(point, inside)
        instead = point.instead(text)
        try:
            self._reach(replace(query, point=(x, y, z)))
        except MotionError as again:
            instead = None if isinstance(again, Unreachable) else instead
        return Mistake(point.place, str(error), instead)

    def _pass(self, leaf: Leaf, inputs: Mapping[str, Any]) -> None:
        """Add waypoints and speed of a skill to the last motion, if the skill plans this motion."""
        goal, motions = tuple(inputs.get("goal", {}).values()), self.found.motions
        if goal and motions and motions[-1].pose == goal:
            last, speed = motions[-1], inputs.get("speed")
            via = tuple(self._hooks.waypoints(leaf, self._robot, inputs)) or last.via
            own = {leaf.skill.group: speed} if speed else {}
            motions[-1] = replace(last, via=via, speeds={**last.speeds, **own})
            self._ahead = (motions[-1],) if self._ahead == (last,) else self._ahead

    def _changed(self, leaf: Leaf, change: WorldChange, now: _State) -> _State:
        """Return the state after a skill has added, moved or removed a body."""
        skill, known = leaf.skill, leaf.known
        if "body" not in known:
            return now.unsure_of((_UNNAMED, *(body.name for body in now.world.bodies)))
        name = known["body"]
        there = {*now.unsure, *(body.name for body in now.world.bodies)}
        uses = change is not WorldChange.ADDS and skill not in self._hooks.doubtful
        place = leaf.written["body"].place if "body" in leaf.written else leaf.place
        if uses and not {name, _UNNAMED} & there:
            near = closest(name, there - {_UNNAMED})
            if change is WorldChange.REMOVES and len(there) == 1:
                (near,) = there
            self.found.absent[place] = (name, near, leaf.place)
        loose = any(body.name == name and not body.link for body in now.world.bodies)
        detaches = change is WorldChange.ATTACHES and "link" not in skill.input_ports()
        if uses and detaches and loose:
            self.found.mistakes.append(self._loose(leaf, name))
        if change is WorldChange.REMOVES:
            return now.without((name,))
        if skill in self._hooks.doubtful:
            return now.unsure_of((name,))
        adds = change is WorldChange.ADDS
        body = self._hooks.body(leaf) if adds else self._carried(skill, known, now)
        return now.with_body(body) if body else now.unsure_of((name,))

    def _loose(self, leaf: Leaf, name: str) -> Mistake:
        """Return the mistake of a body that is detached although no link carries it."""
        attaching = next(
            skill
            for skill, kind in known_skills().items()
            if kind.world_change is WorldChange.ATTACHES and "link" in kind.input_ports()
        )
        tool = self._robot.tool
        node = f"{attaching}: {{body: {name}, link: {tool.link if tool else '…'}}}"
        why = f"{name} is attached to no link; attach it above, such as with {node}"
        right = added_above(leaf.place, node) if tool else None
        return Mistake(leaf.place, f"{why}, or leave this node out", right)

    def _carried(self, skill: Skill, known: Mapping[str, Any], now: _State) -> Body | None:
        """Return a body fixed to its new link; None if its link or pose is unknown."""
        link = known.get("link") if "link" in skill.input_ports() else ""
        if now.pose is None or link is None:
            return None
        try:
            return self._carry(Carry(now.world, known["body"], link, now.pose))
        except MotionError:  # the body is unknown here
            return None


def _place_of_point(leaf: Leaf) -> Place:
    """Return the place of the tool's point; the place of the skill if it has no point."""
    return leaf.written["point"].place if "point" in leaf.written else leaf.place


def _least_time(joint: Joint, distance: float) -> float:
    """Return the shortest time of a motion of one joint, from standstill to standstill [s]."""
    if joint.continuous:
        distance = min(distance % math.tau, -distance % math.tau)
    speed = min(joint.velocity, math.sqrt(distance * joint.acceleration))
    return distance / speed + speed / joint.acceleration if speed else 0.0


def _common(states: Sequence[_State]) -> _State:
    """Return the part of several states that is equal in all of them."""
    first, *others = states
    unsure = {name for each in states for name in each.unsure}
    bodies = {body for each in states for body in each.world.bodies}
    unsure |= {
        body.name for body in bodies if any(body not in each.world.bodies for each in states)
    }
    pose = first.pose if all(each.pose == first.pose for each in others) else None
    keys = {
        key: q for key, q in first.keys.items() if all(q == each.keys.get(key) for each in others)
    }
    return replace(first, pose=pose, keys=keys).unsure_of(unsure)
