"""Whether the results in a recording are those of what was run."""

from collections.abc import Sequence

from executive.codes import CANCELED, OK
from executive.goals.goal import GoalState
from logs import Goal, NodeStatus, Record, Result, Sent

_SUCCESS = "SUCCESS"


def result_difference(story: Sequence[Record]) -> str:
    """What contradicts a result first: itself, the goals, the frames or the tree; or nothing.

    Args:
        story: What was recorded, in its order.
    """
    goals = {(record.goal_id, record.task): record for record in story if isinstance(record, Goal)}
    sent: list[Sent] = []
    root, status = "", ""
    for record in story:
        match record:
            case Sent() if record.joints:
                sent.append(record)
            case NodeStatus():
                root = root or record.path
                status = record.status if record.path == root else status
            case Result():
                goal = goals.get((record.goal_id, record.task))
                if goal is None:
                    return f"the result is of task {record.task}, of which no goal is recorded"
                words = _states_difference(record, status)
                words = words or ("" if goal.elsewhere else _frames_difference(record, sent))
                if words:
                    return words
    return ""


def _states_difference(result: Result, root: str) -> str:
    """Between what a result says of its end, and the root's last status, empty where none ran."""
    done = result.state == GoalState.SUCCEEDED.name
    canceled = result.state == GoalState.CANCELED.name
    if (result.success, result.code == OK, result.code == CANCELED) != (done, done, canceled):
        said = f"success {result.success} and {result.code}"
        return f"the result is {result.state}, it says {said}"
    if root and ((done and root != _SUCCESS) or (canceled and root == _SUCCESS)):
        return f"the result is {result.state}, the tree ended {root}"
    return ""


def _frames_difference(result: Result, sent: Sequence[Sent]) -> str:
    if result.frames != len(sent):
        return f"the result tells of {result.frames} frames, {len(sent)} are recorded"
    if sent and sent[-1].time > result.time:
        return f"{sent[-1].text} was sent after the result before which it is recorded"
    return ""
