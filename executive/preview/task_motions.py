"""The motions of a task that are known before it runs, as planning queries."""

from dataclasses import replace
from typing import TYPE_CHECKING

from hardware import Robot
from hardware.loading.dataclass import dataclass
from skills.motion import Pool, Query, Reached, ToolQuery, World
from trees import FileError
from trees.analysis.predicted_motion import predict_motions
from trees.compile.compiler import CompiledTree
from trees.compile.node_paths import paths

if TYPE_CHECKING:
    from skills.motion.planner import Planner


@dataclass(frozen=True, slots=True)
class Motion:
    """One motion to plan.

    Attributes:
        query: The planning query.
        left_out: Bodies that the world lacks, because their pose is known only in a run.
        assumed_start: True if the start is known only in a run. The query then starts at the end of
            the previous motion.
        node: Path of the node with the target; empty for a motion without a task.
    """

    query: Query
    left_out: tuple[str, ...] = ()
    assumed_start: bool = False
    node: str = ""


def task_motions(
    tree: CompiledTree,
    robot: Robot,
    solver: "Planner | Pool",
    position: tuple[float, ...],
    world: World,
    seed: int,
    wanted: str | None = None,
) -> tuple[list[Motion], list[str]]:
    """Return the motions of a task, by group. As in a run, the gripper moves after the arm.

    Args:
        tree: The checked task.
        robot: The robot.
        solver: Planner or planner processes, which compute the poses in the prediction.
        position: Configuration before the task [rad].
        world: World before the task.
        seed: Seed of the planner.
        wanted: Group of the returned motions; None for all groups.

    Returns:
        The motions, and a message for each motion whose target is known only in a run. Groups that
        are already at their target are left out if another group moves.

    Raises:
        FileError: A skill refuses an input.
    """

    def reach(query: ToolQuery) -> Reached:
        return solver.reach(replace(query, seed=seed))

    found = predict_motions(tree, robot, solver.carry, position, world, reach=reach)
    if broken := tree.hooks.mistakes:
        raise FileError(broken)
    nodes = dict(paths(tree.root))
    moving, still = list[Motion](), list[Motion]()
    for motion in found.motions:
        for query in motion.queries(robot, position, seed):
            if query.group == (wanted or query.group):
                own = robot.actuated_in(query.group)
                here = zip(robot.actuated, query.start, strict=True)
                moves = query.goal != tuple(q for joint, q in here if joint in own)
                start_unknown, node = motion.start is None, nodes[motion.node]
                each = Motion(query, motion.left_out, start_unknown, node)
                (moving if wanted or query.via or moves else still).append(each)
        position = motion.pose
    return moving or still[:1], [f"{nodes[node]}: {why}" for node, why in found.unknown.items()]
