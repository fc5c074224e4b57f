"""Running goals when a caller takes the arm out of *active*."""

import pytest

from executive.api.outcome import GoalState
from hardware.arm.connection import Connection
from tests.conftest import RigMaker
from tests.support.servers.server_acts import at_frame, run

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("transition", ["deactivate", "shutdown"])
def test_leaving_active_ends_a_goal_for_that_reason(
    server: RigMaker, transition: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, stop = server(), Connection.stop_and_settle

    def slowly(connection: Connection) -> None:
        stop(connection)
        arm.rest(0.2)  # the board answers late

    monkeypatch.setattr(Connection, "stop_and_settle", slowly)
    at_frame(arm, 10, lambda: arm.executive.arm_to(transition))
    outcome = run(arm, 1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.not_active")
    assert "left *active* before the goal had ended" in outcome.message
    assert arm.frames[-1] == f"({arm.frames[-2]})"
    assert run(arm, 1).code == "hw.not_active"


@pytest.mark.parametrize("transition", ["deactivate", "shutdown"])
def test_a_goal_that_stands_still_does_not_outlive_that_either(
    server: RigMaker, transition: str
) -> None:
    arm = server()
    goal = arm.executive.send(1).identity

    def act() -> None:
        arm.executive.pause(goal)
        arm.rest(1.0)
        arm.executive.arm_to(transition)

    at_frame(arm, 10, act)
    outcome = arm.executive.result(goal, 60.0)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.not_active")
    assert "left *active* before the goal had ended" in outcome.message
    assert arm.frames[-1] == f"({arm.frames[-2]})"
