"""What became of a goal, and why."""

from py_trees.common import Status

from hardware import ActivationStopped

from .builder import Tree
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
    """The code of the first failed skill, and what every failed skill says."""
    failed = [skill for skill in tree.skills if skill.failure is not None]
    if not failed:
        return INTERNAL, f"{tree.root.name} failed without a cause"
    code = getattr(failed[0].failure, "code", INTERNAL)
    heading = look_up(code).heading
    said = "; ".join(
        f"{skill.name}: {skill.failure}" if code.startswith("plan.") else str(skill.failure)
        for skill in failed
    )
    return code, f"{heading}: {said}" if heading else said
