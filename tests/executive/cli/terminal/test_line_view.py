"""The lines of a run that is not on a screen."""

import pytest

import logs
from executive.cli.terminal.line_view import view_for


def test_each_step_begins_with_the_names_of_its_subtrees(
    capsys: pytest.CaptureFixture[str],
) -> None:
    paths = (
        "pick/parallel/Say",
        "pick/fetch/move_joints/SetStart",
        "pick/fetch/move_joints/go/parallel/PlanArm",
        "pick/fetch/move_joints/go/Execute",
        "pick/fetch/2:move_joints/SetStart",
        "pick/fetch/2:move_joints/go/Execute",
        "pick/2:fetch/move_joints/SetStart",
        "pick/Succeed",
    )
    with view_for(as_json=False, verbose=True) as view:
        view.put(logs.Goal(0.0, "ab" * 16, 1, "pick", 1))
        for path in paths:
            view.put(logs.NodeStatus(0.0, path, path.rpartition("/")[2], "SUCCESS", "done"))
    words = [line.split(" success")[0].strip() for line in capsys.readouterr().out.splitlines()]
    assert words == [
        *("task 1 pick", "Say", "fetch / move_joints:", "SetStart", "PlanArm", "Execute"),
        *("fetch / 2:move_joints:", "SetStart", "Execute"),
        *("2:fetch / move_joints:", "SetStart", "Succeed"),
    ]
