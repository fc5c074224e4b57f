"""What became of a goal, and why."""

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from hardware import ActivationStopped
from skills import TaskFailed

from .building.builder import Tree
from .codes import CANCELED, INTERNAL, OK, look_up
from .goal import GoalState


def judge(tree: Tree | None, error: Exception | None, canceled: bool) -> tuple[GoalState, str, str]:
    """Judge a goal.

    Args:
        tree: What was run; None where it could not even be built.
        error: What failed outside the tree, if anything did.
        canceled: Whether a cancel was asked for.

    Returns:
        Its last state, the code of the cause, and the cause in words.
    """
    if error is not None and not (canceled and isinstance(error, ActivationStopped)):
        code = getattr(error, "code", INTERNAL)
        heading = look_up(code).heading
        return GoalState.ABORTED, code, f"{heading}: {error}" if heading else str(error)
    if tree is not None and tree.root.status is Status.SUCCESS:
        return GoalState.SUCCEEDED, OK, "Done"
    if tree is not None and tree.root.status is Status.FAILURE:
        return GoalState.ABORTED, *_causes(tree)
    return GoalState.CANCELED, CANCELED, look_up(CANCELED).heading


def _causes(tree: Tree) -> tuple[str, str]:
    """The code of the first failed node that knows why, and what every one of them says."""
    failed = list(_failed(tree.root))
    if not failed:
        return TaskFailed.code, f"{tree.root.name} failed, as its tree has it"
    code = getattr(failed[0][1], "code", INTERNAL)
    heading = look_up(code).heading
    said = "; ".join(
        f"{name}: {failure}" if code.startswith("plan.") else str(failure)
        for name, failure in failed
    )
    return code, f"{heading}: {said}" if heading else said


def _failed(node: Behaviour) -> Iterator[tuple[str, Exception]]:
    """The nodes that a failure came from; what others have made good is none."""
    if node.status is not Status.FAILURE:
        return
    failure: Exception | None = getattr(node, "failure", None)
    if failure:
        yield node.name, failure
        return
    for child in node.children:
        yield from _failed(child)
