"""What became of a goal, and why."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from hardware import ActivationStopped
from skills import TaskFailed
from trees.compile.builder import Tree
from trees.compile.paths import paths

from .causes import CANCELED_CAUSE, cause_of
from .goal import Cause, GoalState


def judge(
    tree: Tree | None, error: Exception | None, canceled: bool
) -> tuple[GoalState, Cause | None]:
    """Judge a goal.

    Args:
        tree: What was run; None where it could not even be built.
        error: What failed outside the tree, if anything did.
        canceled: Whether a cancel was asked for.

    Returns:
        Its last state, and the cause where it was not done.
    """
    if error is not None and not (canceled and isinstance(error, ActivationStopped)):
        return GoalState.ABORTED, cause_of(error)
    if tree is not None and tree.root.status is Status.SUCCESS:
        return GoalState.SUCCEEDED, None
    if tree is not None and tree.root.status is Status.FAILURE:
        return GoalState.ABORTED, _of_tree(tree.root)
    return GoalState.CANCELED, CANCELED_CAUSE


def _of_tree(root: Behaviour) -> Cause:
    """The first failed node that knows why, with what every one of them says."""
    failed = list(_failed(root))
    if not failed:
        return cause_of(TaskFailed(f"{root.name} failed, as its tree has it"))
    node, error = failed[0]
    planning = getattr(error, "code", "").startswith("plan.")
    said = (f"{node.name}: {error}" if planning else str(error) for node, error in failed)
    return cause_of(error, dict(paths(root))[node], "; ".join(said))


def _failed(node: Behaviour) -> Iterator[tuple[Behaviour, Exception]]:
    """The nodes that a failure came from; what others have made good is none."""
    if node.status is not Status.FAILURE:
        return
    failure: Exception | None = getattr(node, "failure", None)
    if failure:
        yield node, failure
        return
    for child in node.children:
        yield from _failed(child)
