"""The final state of a goal and its cause."""

import math
import os

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence
from py_trees.decorators import FailureIsSuccess

from executive.api.outcome import GoalState, cause_of
from executive.goals.run_loop import decide_outcome
from hardware import ActivationStopped, BadPosition, NotActive, PortNotGiven
from hardware.errors import PortBusy, PortDenied
from skills import OutOfBounds
from skills.motion import MotionCollides, PlanCanceled, PlanTimeout
from skills.motion.errors import NotFinite, StartInCollision, StartOutOfBounds
from trees.build import Tree


class Failed(Behaviour):
    """The part of a skill that decides an outcome."""

    def __init__(self, name: str, failure: Exception | None) -> None:
        super().__init__(name)
        self.failure, self.status = failure, Status.FAILURE if failure else Status.SUCCESS

    def update(self) -> Status:
        return self.status


def tree(status: Status, *skills: Behaviour) -> Tree:
    root = Sequence("task", memory=True, children=list(skills))
    root.status = status
    return Tree(root, (), {}, "run")


def said(
    judged: Tree | None, error: Exception | None, canceled: bool
) -> tuple[GoalState, str, str]:
    state, cause = decide_outcome(judged, error, canceled)
    assert cause
    return state, cause.code, cause.message


OUT = OutOfBounds([BadPosition("joint_1 is out", "joint_1", 2.0, 1.5)])


def test_done() -> None:
    assert decide_outcome(tree(Status.SUCCESS), None, False) == (GoalState.SUCCEEDED, None)


def test_done_before_the_cancel_was_seen() -> None:
    assert decide_outcome(tree(Status.SUCCESS), None, True)[0] is GoalState.SUCCEEDED


def test_canceled() -> None:
    assert said(tree(Status.INVALID), None, True) == (
        GoalState.CANCELED,
        "goal.canceled",
        "Canceled",
    )


def test_canceled_while_the_board_booted() -> None:
    stopped = ActivationStopped("stopped")
    assert decide_outcome(tree(Status.INVALID), stopped, True)[0] is GoalState.CANCELED
    assert said(tree(Status.INVALID), stopped, False)[:2] == (
        GoalState.ABORTED,
        "hw.activation_stopped",
    )


def test_a_fault_outweighs_the_cancel() -> None:
    state, code, _ = said(tree(Status.INVALID), NotActive("x"), True)
    assert (state, code) == (GoalState.ABORTED, "hw.not_active")


ERRORS: list[tuple[Exception, str, str]] = [
    (PortNotGiven(), "hw.no_port", "No serial port provided"),
    (OUT, "goal.out_of_bounds", "Target position out of boundaries: j"),
    (ZeroDivisionError("x"), "internal", "A bug in armtree: x"),
]


@pytest.mark.parametrize(("error", "code", "words"), ERRORS)
def test_errors_outside_the_tree(error: Exception, code: str, words: str) -> None:
    state, name, message = said(None, error, False)
    assert (state, name) == (GoalState.ABORTED, code)
    assert message.startswith(words)


def test_both_planners_with_their_names() -> None:
    failed = tree(
        Status.FAILURE,
        Failed("SetStart", None),
        Failed("PlanArm", PlanTimeout(5.0)),
        Failed("PlanGripper", PlanCanceled()),
    )
    state, code, message = said(failed, None, False)
    assert (state, code) == (GoalState.ABORTED, "plan.timeout")
    assert message.startswith("One or more planners failed: PlanArm: ")
    assert "; PlanGripper: " in message


def test_planners_with_the_same_message() -> None:
    failed = tree(
        Status.FAILURE, Failed("PlanArm", PlanTimeout(5.0)), Failed("PlanGripper", PlanTimeout(5.0))
    )
    _, _, message = said(failed, None, False)
    assert message.startswith("One or more planners failed: PlanArm, PlanGripper: ")
    assert message.count(str(PlanTimeout(5.0))) == 1


def test_one_planner() -> None:
    failed = tree(Status.FAILURE, Failed("PlanArm", None), Failed("PlanGripper", PlanCanceled()))
    _, code, message = said(failed, None, False)
    assert code == "plan.canceled"
    assert message.startswith("One or more planners failed: PlanGripper: ")
    assert "PlanArm" not in message


def test_the_last_check() -> None:
    collides = MotionCollides(3, None, "gripper_left", "floor", -0.01, 0.002)
    _, code, message = said(tree(Status.FAILURE, Failed("Execute", collides)), None, False)
    assert code == "plan.motion_collides"
    assert message.startswith("The frames of the motion would cause a collision: Execute: ")


def test_a_failure_that_no_skill_explains() -> None:
    assert said(tree(Status.FAILURE), None, False) == (
        GoalState.ABORTED,
        "task.failed",
        "The task failed: task failed, although none of its skills failed",
    )


def test_a_handled_failure_is_not_the_cause() -> None:
    forgiven = FailureIsSuccess("forgiven", Failed("A", OUT))
    forgiven.status = Status.SUCCESS
    failed = tree(Status.FAILURE, forgiven, Failed("B", PlanTimeout(5.0)))
    assert said(failed, None, False)[1] == "plan.timeout"


def test_a_cause_keeps_node_joint_value_and_limit() -> None:
    _, cause = decide_outcome(tree(Status.FAILURE, Failed("CheckBounds", OUT)), None, False)
    assert cause
    assert (cause.node, cause.joint) == ("task/CheckBounds", "joint_1")
    assert (cause.value, cause.limit) == (2.0, 1.5)
    assert cause.hint == "choose a target within the limits"


@pytest.mark.parametrize(
    ("error", "value", "limit"),
    [
        (StartInCollision("a", "b", -0.01, 0.005), -0.01, 0.005),
        (StartOutOfBounds("joint_1", -2.0, -1.5, 1.5), -2.0, -1.5),
        (StartOutOfBounds("joint_1", 2.0, -1.5, 1.5), 2.0, 1.5),
        (PlanTimeout(5.0), None, 5.0),
        (NotFinite("goal", "joint_1", math.nan), None, None),
        (BadPosition("x", "joint_1", "two"), None, None),
        (BadPosition("x", "joint_1", 10**400), None, None),
        (ZeroDivisionError("x"), None, None),
    ],
)
def test_values_and_limits(error: Exception, value: float | None, limit: float | None) -> None:
    cause = cause_of(error)
    assert (cause.value, cause.limit) == (value, limit)


def test_a_hint_that_the_message_contains_is_not_repeated() -> None:
    for owner in (None, 1, os.getpid()):
        assert cause_of(PortBusy("/dev/ttyACM0", owner)).advice == ""
    cause = cause_of(PortDenied("/dev/ttyACM0", "dialout"))
    assert cause.advice == cause.hint == "join the group that owns the port, then log in again"
