"""Collision checks before a run: finds unusable bodies and configurations in collision."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace

from hardware import Robot
from hardware.description.neighbours import advice_for_contact
from skills.motion import (
    EMPTY,
    BadWorld,
    Body,
    MotionCollides,
    MotionError,
    PlanTimeout,
    Pool,
    Reached,
    ToolQuery,
    Verify,
    WorkerDied,
    World,
)
from trees.compile.compiler import CompiledTree
from trees.compile.skill_hooks import Pose, SkillHooks
from trees.errors import Mistake, Place

from .planned_times import PlannedTimes
from .predicted_motion import predict_motions
from .unreachable_nodes import check_outcomes, slow_children

_Use = tuple[Place, str]  # place that uses a configuration, and message for a collision


@dataclass
class CollisionChecks:
    """Checks bodies and configurations, all with one planner process.

    Args:
        robot: The robot.
        pool: Planner processes. `mistakes` starts and closes them.
        world: Bodies around the arm before each task.

    Attributes:
        poses: Places and configurations [rad] to check.
        trees: Compiled tasks and subtrees.
        tasks: The tasks among them.
        notes: Notes about configurations that could not be checked. Also notes that assume that the
            arm is in its start pose: about first motions that start in collision, points out of
            reach, and timeouts shorter than their motions.
        absent: Bodies that a task uses but does not add: name of the body, a similar name or "",
            and place of the node, by place of the use.
    """

    robot: Robot
    pool: Pool
    world: World = EMPTY
    poses: list[tuple[Place, Pose]] = field(default_factory=list)
    trees: list[CompiledTree] = field(default_factory=list)
    tasks: list[CompiledTree] = field(default_factory=list)
    notes: list[Mistake] = field(default_factory=list)
    absent: dict[Place, tuple[str, str, Place]] = field(default_factory=dict)
    _found: list[Mistake] = field(default_factory=list)

    def mistakes(self) -> Iterator[Mistake]:
        """Yield the mistakes that a planner finds. Fill `notes` and `absent`."""
        if not (self.poses or self.trees):
            return
        with closing(self.pool):
            self.pool.start()
            broken = set[Body]()
            for body, places in self._bodies().items():
                if error := self._load_error(body):
                    broken.add(body)
                    yield from (Mistake(place, f"{body.name}: {error}") for place in places)
            configurations, boot = self._configurations(), self.robot.boot_pose
            first_worlds = self._first_worlds()
            yield from self._found
            for (pose, world), uses in configurations.items():
                places = [place for place, _ in uses]
                if not broken.isdisjoint(world.bodies):
                    continue
                if hit := self._collision(pose, world, places):
                    yield from (Mistake(place, f"{message}: {hit}") for place, message in uses)
            for world, place in first_worlds.items():
                new = (boot, world) not in configurations and broken.isdisjoint(world.bodies)
                if new and (hit := self._collision(boot, world, [place])):
                    named = self.robot.firmware.words.start_pose
                    why = f"in its {named}, before this motion, the arm is in collision"
                    self.notes.append(Mistake(place, f"{why}: {hit}"))

    def _load_error(self, body: Body) -> BadWorld | WorkerDied | None:
        """Return the error of loading a body, or None."""
        # Other tasks may add the bodies that this body touches.
        alone = World((replace(body, touches=frozenset()),))
        answer = self.pool.ask(Verify([self.robot.boot_pose], 0.0, world=alone))
        return answer if isinstance(answer, (BadWorld, WorkerDied)) else None

    def _collision(self, pose: Pose, world: World, places: Sequence[Place]) -> str:
        """Return a message about a collision in a configuration, or an empty text.

        If the configuration cannot be checked, for example in time, add a note for each place.
        """
        answer = self.pool.ask(Verify([pose], self.robot.collision.margin, world=world))
        # A subtree may name bodies that only its users add.
        if not isinstance(answer, MotionError) or isinstance(answer, BadWorld):
            return ""
        if not isinstance(answer, MotionCollides):
            why = f": {answer}"
            if isinstance(answer, PlanTimeout):
                why = f" within {answer.timeout:g} s"
            self.notes += (Mistake(place, f"not checked for collisions{why}") for place in places)
            return ""
        advice = advice_for_contact(self.robot, answer.first, answer.second)
        return f"{answer.contact}; {advice}" if advice else answer.contact

    def _bodies(self) -> dict[Body, list[Place]]:
        """Return all added bodies, and their places in the files."""
        bodies: dict[Body, list[Place]] = {}
        for tree in self.trees:
            for leaf in tree.leaves.values():
                if body := tree.hooks.body(leaf):
                    bodies.setdefault(body, []).append(leaf.place)
        return bodies

    def _configurations(self) -> dict[tuple[Pose, World], list[_Use]]:
        """Predict all motions. Return the uses of each configuration in each world."""
        found: dict[tuple[Pose, World], list[_Use]] = {}
        goal, start = "this pose collides", "before this motion, the arm is in collision"
        for place, pose in self.poses:
            found.setdefault((pose, self.world), []).append((place, goal))
        for tree in self.trees:
            task = any(tree is each for each in self.tasks)
            reach = self._unreachable if task else None
            predicted = predict_motions(
                tree, self.robot, self.pool.carry, world=self.world, reach=reach
            )
            if task:
                self.absent |= predicted.absent
                self._found += dict.fromkeys(predicted.mistakes)
                check_outcomes(tree, predicted.times)
                self._found += tree.mistakes.found
            for motion in predicted.motions:
                if motion.start and (motion.start, motion.world) not in found:
                    found[motion.start, motion.world] = [(motion.place, start)]
                found.setdefault((motion.pose, motion.world), []).append((motion.place, goal))
        return found

    def _first_worlds(self) -> dict[World, Place]:
        """Return each world of a motion that begins in the start pose, and the place of the motion.

        Also adds notes for tasks that begin in the start pose: points out of reach, moves by a
        distance that leave the limits of a joint, and timeouts shorter than their motions. A
        timeout that is too short from any pose is a mistake. Its message has the planned time from
        the start pose.
        """
        worlds, boot = dict[World, Place](), self.robot.boot_pose
        for tree in self.tasks:
            # A refusal that only this start causes is a note, not a mistake.
            hooks = SkillHooks(tree.hooks.doubtful)
            times = PlannedTimes(tree, self.robot, self.pool.ask)
            found = predict_motions(
                tree,
                self.robot,
                self.pool.carry,
                boot,
                self.world,
                hooks=hooks,
                reach=self.pool.reach,
                duration=times.duration,
            )
            start, known = self.robot.firmware.words.start_pose, {m.place for m in self._found}
            self.notes += [
                replace(each, message=f"from its {start}: {each.message}")
                for each in dict.fromkeys((*found.mistakes, *hooks.mistakes))
                if each.place not in known
            ]
            if times:
                notes = {note.place: note for note in slow_children(tree, found.times, start)}
                self._found = [notes.pop(each.place, each) for each in self._found]
                self.notes += () if tree.mistakes.found else notes.values()
            for motion in found.motions:
                if motion.start == boot:
                    worlds.setdefault(motion.world, motion.place)
        return worlds

    def _unreachable(self, query: ToolQuery) -> Reached:
        """Raise an error even for a point in reach: its solution is known only during a run."""
        self.pool.reach(query)
        raise MotionError("known during a run")
