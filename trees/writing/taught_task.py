"""A task that is taught step by step. Its file always has all steps."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NoReturn

from hardware import Robot, write_file
from hardware.loading.dataclass import dataclass
from hardware.printable import plural
from skills import wait_node
from trees.declarations import Declaration
from trees.errors import BadArguments, FileError, Mistake, Place
from trees.export.schema import NAME
from trees.reading.grammar import parse_value
from trees.reading.library import Library
from trees.reading.literals import fit

from .new_task import prepare_file
from .saved_poses import pose_text
from .taught_path import Sample, simplify, split

_HEAD = """\
# yaml-language-server: $schema={schema}
task: {number}
name: {name}
description: Taught in {steps}.
tree:
  sequence:
"""
_MOVE = "    - subtree: move_joints\n      with: {{joints: {}}}\n"
_SAME = 1e-3  # positions with a smaller difference are equal [rad], [m]


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a task.

    Attributes:
        words: Description of the step, for people.
        nodes: Texts of the nodes of the step in the file.
        positions: Position of every joint after the step [rad], [m]; empty for a wait.
    """

    words: str
    nodes: tuple[str, ...]
    positions: Mapping[str, float]


class TaughtTask:
    """A task file that grows step by step. Every change writes the whole file again.

    Args:
        robot: The robot.
        folder: Folder of the user's files. It is created if it does not exist.
        number: Number of the task.
        name: Name of the task.

    Attributes:
        path: The file. It exists if there is at least one step.
        steps: The steps.

    Raises:
        FileError: Number or name are in use or invalid, or the file cannot be written. Methods that
            change the steps also raise it, and then leave the steps unchanged.
    """

    def __init__(self, robot: Robot, folder: Path, number: int, name: str) -> None:
        self.path = prepare_file(robot, folder, number, name)
        self.steps: tuple[Step, ...] = ()
        self._robot, self._folder = robot, folder
        self._number, self._name = number, name

    def move(self, positions: Mapping[str, float]) -> Step | None:
        """Add a step from the last pose to `positions`. Return it, or None if both are equal.

        The first step moves every joint, so that the task can begin anywhere.

        Args:
            positions: Position of every actuated joint [rad], [m].

        Raises:
            PoseOutsideLimits: A joint is outside its limits.
        """
        positions = self._within(positions)
        words, nodes = self._moves(positions)
        if not nodes:
            return None
        return self._add(Step(f"move to {', '.join(words)}", tuple(nodes), positions))

    def follow(self, samples: Sequence[Sample]) -> Step | None:
        """Add a hand-guided path, simplified to waypoints.

        Args:
            samples: Positions of every actuated joint along the path [rad], [m].

        Returns:
            The step; None if the arm did not move.

        Raises:
            PoseOutsideLimits: A joint is outside its limits in a sample.
        """
        samples = [self._within(sample) for sample in samples]
        if not samples:
            return None
        joints = [joint.name for joint in self._robot.actuated_in("arm")]
        gripper = [joint.name for joint in self._robot.actuated_in("gripper")]
        nodes, points = self._moves(samples[0])[1], 0
        for part, held in split(self._robot, samples, gripper):
            waypoints = simplify(self._robot, part, joints)[1:]
            if waypoints and len({tuple(each[name] for name in joints) for each in part}) > 1:
                *via, end = (self._pose(each, joints) for each in waypoints)
                listed = "".join(f"\n          - {each}" for each in via) or " []"
                nodes.append(f"    - subtree: follow\n      with:\n        via:{listed}\n")
                nodes[-1] += f"        arm: {end}\n"
                points += len(waypoints)
            if any(abs(q - part[0][name]) > _SAME for name, q in held.items()):
                nodes.append(_MOVE.format(self._pose(held, gripper)))
        if not nodes:
            return None
        return self._add(Step(f"path of {plural(points, 'point')}", tuple(nodes), samples[-1]))

    def _within(self, positions: Mapping[str, float]) -> Mapping[str, float]:
        """Return measured positions within the limits of the joints.

        Raises:
            FileError: The joints are of another robot.
            PoseOutsideLimits: A joint is outside its limits.
        """
        names = [joint.name for joint in self._robot.actuated]
        if {*names} != positions.keys():
            why = f"names the joints {', '.join(names)}, but the arm has {', '.join(positions)}"
            raise FileError.at(self._robot.path, f"{why}; give --robot")
        within = self._robot.within_limits([positions[name] for name in names])
        return self._robot.by_joint(within)

    def _moves(self, positions: Mapping[str, float]) -> tuple[list[str], list[str]]:
        """Return the moves from the last pose to `positions`: words for people, and nodes."""
        before = next((step.positions for step in reversed(self.steps) if step.positions), {})
        poses, _ = Library(self._folder, self._robot.name).poses()
        words, nodes = list[str](), list[str]()
        for group in self._robot.groups:
            joints = self._robot.actuated_in(group)
            target = {joint.name: positions[joint.name] for joint in joints}
            if not target or _same(target, {name: before.get(name) for name in target}):
                continue
            known = (name for name, pose in poses.items() if _same(target, pose))
            nodes.append(_MOVE.format(pose := next(known, self._pose(target, [*target]))))
            words.append(pose.strip("{}"))
        return words, nodes

    def _pose(self, positions: Mapping[str, float], names: Sequence[str]) -> str:
        """Return the positions of some joints as text for a file."""
        return pose_text(self._robot, {name: positions[name] for name in names})

    def wait(self, duration: str) -> Step:
        """Add a wait, such as `500 ms`, and return it.

        Raises:
            BadArguments: The text is not a duration.
        """

        def wrong(place: Place, why: str, _: object = None) -> NoReturn:
            raise FileError([Mistake(place, why)])

        longest = Declaration("duration", least=0.0)
        try:
            seconds = fit(parse_value(duration, "wait"), longest, {}, wrong)
        except FileError as error:
            raise BadArguments(error.mistakes) from None
        node = f"    - {wait_node(f'{seconds:g} s')}\n"
        return self._add(Step(f"wait {seconds:g} s", (node,), {}))

    def undo(self) -> Step | None:
        """Remove and return the last step; None if there is no step."""
        if not self.steps:
            return None
        last = self.steps[-1]
        self._write(self.steps[:-1])
        return last

    def _add(self, step: Step) -> Step:
        self._write((*self.steps, step))
        return step

    def _write(self, steps: tuple[Step, ...]) -> None:
        count = plural(len(steps), "step")
        text = _HEAD.format(schema=NAME, number=self._number, name=self._name, steps=count)
        text += "".join(node for step in steps for node in step.nodes)
        try:
            if steps:
                write_file(self.path, text.encode())
            else:
                self.path.unlink(missing_ok=True)
        except OSError as error:
            why = f"cannot be written: {error.strerror}; make room, then repeat the step"
            raise FileError.at(self.path, why) from error
        self.steps = steps


def _same(one: Mapping[str, float], other: Mapping[str, float | None]) -> bool:
    return one.keys() == other.keys() and all(
        q is not None and abs(one[name] - q) < _SAME for name, q in other.items()
    )
