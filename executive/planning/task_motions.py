"""The motions of a task that are known before it runs, as planning queries."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from hardware import Robot
from skills.motion import Body, Carry, Query, Reached, ToolQuery, World
from trees import Library, Located
from trees.check import motions_of


class Solver(Protocol):
    """What a prediction asks of a planner. Both may raise a MotionError."""

    def carry(self, request: Carry) -> Body:
        """Return a body at the same pose, attached to another link."""
        ...

    def reach(self, query: ToolQuery) -> Reached:
        """Return joint positions that bring the tool to a point."""
        ...


@dataclass(frozen=True)
class Motion:
    """One motion to plan.

    Attributes:
        query: The planning query.
        left_out: Bodies that are missing in its world, because their place is known only in a run.
        assumed_start: True if the start is known only in a run. The query then starts at the end of
            the motion before it.
        node: Path of the node with the target; empty if no task has it.
    """

    query: Query
    left_out: tuple[str, ...] = ()
    assumed_start: bool = False
    node: str = ""


def task_motions(
    robot: Robot,
    library: Library,
    number: int,
    solver: Solver,
    position: tuple[float, ...],
    world: World,
    seed: int,
    wanted: str | None = None,
    arguments: Mapping[str, Located] | None = None,
) -> tuple[list[Motion], list[str]]:
    """Return the motions of a task, group by group. As in a run, the gripper moves after the arm.

    Args:
        robot: The robot.
        library: Files of the task.
        number: Number of the task.
        solver: Answers requests of the prediction.
        position: Configuration before the task [rad].
        world: World before the task.
        seed: Seed of the planner.
        wanted: Group whose motions are returned; None for those of all groups.
        arguments: Values of the task's parameters; None if they are not known.

    Returns:
        The motions, without those of groups that are at their target already, unless there is no
        other; and a message for each motion whose target is known only in a run.

    Raises:
        UnknownTask: No task has that number.
        FileError: The files have mistakes, or a skill refuses an input.
    """

    def reach(query: ToolQuery) -> Reached:
        return solver.reach(replace(query, seed=seed))

    predicted, unknown = motions_of(
        robot, library, number, solver.carry, reach, position, world, arguments
    )
    moving, still = list[Motion](), list[Motion]()
    for node, motion in predicted:
        for query in motion.queries(robot, position, seed):
            if query.group == (wanted or query.group):
                own = robot.actuated_in(query.group)
                here = zip(robot.actuated, query.start, strict=True)
                moves = query.goal != tuple(q for joint, q in here if joint in own)
                found = Motion(query, motion.left_out, motion.start is None, node)
                (moving if wanted or query.via or moves else still).append(found)
        position = motion.pose
    return moving or still[:1], unknown
