"""What a task puts around the arm counts before it runs, too: in `armtree check` and `plan`."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.main import cli
from hardware import Robot
from skills import BadTarget
from trees import FileError
from trees.analysis import predicted_motion
from trees.check import check

pytestmark = pytest.mark.slow

HEAD = "task: 7\nname: x\ndescription: y\ntree:\n  sequence:\n"
POST = "AddBox: {body: post, size: [3 cm, 3 cm, 3 cm], position: [0.12, 0.04, 0.07]}"
TALL = "AddBox: {body: tall, size: [3 cm, 3 cm, 20 cm], position: [0.115, 0.115, 0.1]}"
GO = "{subtree: reach, with: {arm: right, gripper: open}}"  # into the post, round the tall one
ALL = "{joint_1: -1.4, joint_2: -0.6, joint_3: -0.07, joint_4: -0.7}"  # as GO
COME = "{subtree: reach, with: {arm: upright, gripper: open}}"
# It stands off to the left, and in the hand it comes to where the block is.
BALL = "AddSphere: {body: ball, radius: 1 cm, position: [-0.1, 0.15, 0.3]}"
HOLD = "{Attach: {body: ball, link: claw_support}}"
BLOCK = "AddBox: {body: block, size: [4 cm, 4 cm, 4 cm], position: [0.17, 0.08, 0.29]}"
LEFT = (
    "{subtree: reach, with: "
    "{arm: {joint_1: 0.3, joint_2: -0.6, joint_3: 0}, gripper: {joint_4: -0.3}}}"
)
WHOLE = "{joint_1: 0.3, joint_2: -0.6, joint_3: 0, joint_4: -0.3}"
BEAM = "AddBox: {body: beam, size: [0.1, 0.1, 0.1], position: [0.5, 0, 0.5], touches: [ball]}"
TURN = "{subtree: move_joints, with: {joints: {joint_1: -80 deg, joint_4: -20 deg}}}"
FURTHER = "{subtree: move_relative, with: {by: {joint_1: -10 deg}}}"
MAYBE = "{{selector: [{{RemoveBody: {{body: {}}}}}, Succeed]}}"


def written(folder: Path, *steps: str, above: str = "") -> Path:
    path = folder / "7_x.yaml"
    text = HEAD.replace("tree:", f"{above}tree:") + "".join(f"    - {step}\n" for step in steps)
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("steps", "line", "why"),
    [
        ((POST, GO), 7, "this pose collides: .* deep in post"),
        ((POST, f"{{subtree: move_joints, with: {{joints: {ALL}}}}}"), 7,
         "this pose collides: .* deep in post"),
        ((POST, COME, GO), 8, "this pose collides: .* deep in post"),
        ((f"{{retry: {{sequence: [{{{POST}}}, {GO}]}}, attempts: 2}}",), 6, "pose .* deep in post"),
        ((f"{{repeat: {{sequence: [{COME}, {GO}, {COME}, {{{POST}}}]}}, times: 2}}",), 6,
         "this pose collides: .* deep in post"),
        ((f"{{repeat: {{sequence: [{COME}, {GO}, {COME}, {{{POST}}}]}}, times: 1}}",), 0, ""),
        ((BALL, LEFT, HOLD, BLOCK, GO), 10, "ball would be .* deep in block"),
        ((BALL, BLOCK, LEFT, HOLD, "{Detach: {body: ball}}", GO), 0, ""),
        ((BALL, "{Detach: {body: ball}}"), 7, "ball is attached to no link"),
        ((BALL, LEFT, HOLD, "{Detach: {body: ball}}", "{Detach: {body: ball}}"), 10,
         r"ball is attached to no link; .* Attach: {body: ball, link: claw_support}"),
        ((BALL, MAYBE.format("ball"), "{Detach: {body: ball}}"), 0, ""),
        ((BALL, HOLD, "{Detach: {body: ball}}"), 0, ""),
        ((GO, POST), 0, ""),
        ((GO, POST, COME), 8, "before this motion, the arm is in collision: .* deep in post"),
        ((POST, "{RemoveBody: {body: post}}", GO), 0, ""),
        ((POST, POST.replace("0.12", "-0.22"), GO), 0, ""),
        ((POST, MAYBE.format("post"), GO), 0, ""),
        ((f"parallel: [{{{POST}}}, {GO}]",), 0, ""),
        ((BALL, HOLD, BLOCK, GO), 0, ""),  # the first position of the arm is unknown
        ((POST.replace("post,", "post, touches: [later],"), GO), 0, ""),
    ],
)  # fmt: skip
def test_check_finds_a_pose_in_a_body(
    robot: Robot, tmp_path: Path, steps: tuple[str, ...], line: int, why: str
) -> None:
    path = written(tmp_path, *steps)
    mistakes = check(robot, None, [path]).mistakes
    assert [(m.place.path.name, m.place.line) for m in mistakes] == [("7_x.yaml", line)] * bool(why)
    assert not why or re.search(why, mistakes[0].message), mistakes
    assert not any("of the motion" in mistake.message for mistake in mistakes)


def planned(folder: Path, *steps: str, above: str = "") -> list[str]:
    """What `armtree plan` says of a task, motion by motion."""
    path = written(folder, *steps, above=above)
    words = ["plan", "7", "--trees", str(path.parent), "--group", "arm"]
    words += ["-o", str(folder / "plan.png")]
    result = CliRunner().invoke(cli, words)
    if result.exception:
        raise result.exception
    return re.split(r"Motion \d of \d\n", result.output)[1:] or [result.output]


@pytest.mark.usefixtures("undrawn")
def test_plan_goes_round_what_the_task_puts_there(tmp_path: Path) -> None:
    first, second = planned(tmp_path, COME, TALL, GO)
    assert "Bodies" not in first
    assert "Path      around an obstacle" in second
    assert "Bodies    tall" in second
    assert "Left out" not in first + second


@pytest.mark.usefixtures("undrawn")
def test_plan_shows_a_round_again_only_where_it_differs(tmp_path: Path) -> None:
    same = f"{{repeat: {{sequence: [{COME}, {GO}]}}, times: 3}}"
    assert len(planned(tmp_path, same)) == 2
    left_out = (
        "Unplanned x/repeat: 2 of its 3 rounds have the targets of earlier rounds and are left out"
    )
    assert left_out in all_said(tmp_path, same)
    differs = f"{{repeat: {{sequence: [{COME}, {GO}, {{{TALL}}}]}}, times: 3}}"
    reported = planned(tmp_path, differs)
    assert ["Bodies    tall" in motion for motion in reported] == [False, False, True, True]


def goals(reported: list[str]) -> list[float]:
    """Of the first joint, motion by motion [deg]."""
    found = [re.search(r"Goal +joint_1 (\S+) deg,", motion) for motion in reported]
    return [round(float(each[1]), 1) for each in found if each]


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("steps", "angles"),
    [
        ((TURN,), [-80]),
        ((TURN, FURTHER, TURN.replace("joint_1: -80 deg", "joint_2: 0.1")), [-80, -90, -90]),
        ((GO, FURTHER.replace("-10", "40")), [-80.2, -40.2]),
        ((f"{{selector: [{TURN}, {FURTHER}]}}", FURTHER), [-80]),  # its position is unknown then
        ((f"{{repeat: {{sequence: [{FURTHER}]}}, times: 3}}", FURTHER), [-10, -20, -30, -40]),
        (("{SetStart: {start: $s}}", f"{{repeat: {{sequence: [{FURTHER}]}}, times: 2}}",
          "{Target: {start: $s, joints: {joint_2: 0.1}, goal: $g}}",
          "{subtree: go, with: {start: $s, goal: $g}}"), [-10, -20, 0]),
    ],
)  # fmt: skip
def test_plan_follows_targets_of_some_joints(
    tmp_path: Path, steps: tuple[str, ...], angles: list[float]
) -> None:
    assert goals(planned(tmp_path, *steps)) == angles


def test_plan_tells_all_of_a_task_that_carries(tmp_path: Path) -> None:
    reported = planned(tmp_path, TALL, BALL, HOLD, TURN)
    assert goals(reported) == [-80]
    assert "Path      around an obstacle" in reported[0]
    assert "Bodies    tall, ball on claw_support\n" in reported[0]


def test_plan_names_what_a_task_spells_out_wrong(tmp_path: Path) -> None:
    bounds = "{CheckBounds: {arm: {joint_1: 0}, gripper: open, goal: $goal}}"
    steps = (
        "{SetStart: {start: $start}}",
        bounds,
        "{subtree: go, with: {start: $start, goal: $goal}}",
    )
    with pytest.raises(FileError, match=r"7_x.yaml:7:.* joint_2"):
        planned(tmp_path, *steps)


def test_repeats_within_each_other_are_not_walked_round_by_round(
    robot: Robot, tmp_path: Path
) -> None:
    inner = f"{{sequence: [{COME}, {GO}, {COME}, {{{POST}}}]}}"
    for _ in range(20):
        inner = f"{{repeat: {inner}, times: 2}}"
    (mistake,) = check(robot, None, [written(tmp_path, inner)]).mistakes
    assert re.search("this pose collides: .* deep in post", mistake.message)


def test_a_later_round_may_leave_the_limits(tmp_path: Path) -> None:
    round_and_round = f"{{repeat: {{sequence: [{FURTHER}]}}, times: 10}}"
    with pytest.raises(FileError, match=r"joint_1 .*-100 deg"):
        planned(tmp_path, round_and_round)


@pytest.mark.usefixtures("undrawn")
def test_the_rounds_of_a_long_loop_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(predicted_motion, "ROUNDS", 2)
    said = all_said(tmp_path, f"{{repeat: {{sequence: [{FURTHER}]}}, times: 5}}", FURTHER)
    assert "Unplanned x/repeat: its rounds after number 3 are left out" in said
    assert "Unplanned x/move_relative" in said


def test_plan_says_why_it_foresees_nothing(tmp_path: Path) -> None:
    point = "{ReachPoint: {start: $start, point: [1 m, 5 cm, 8 cm], target: $there}}"
    steps = ("{SetStart: {start: $start}}", point, "{subtree: move_joints, with: {joints: $there}}")
    with pytest.raises(BadTarget, match=r"task 7 has no goal that is known .* cannot reach"):
        planned(tmp_path, *steps)


def test_check_follows_targets_of_some_joints(robot: Robot, tmp_path: Path) -> None:
    path = written(
        tmp_path,
        POST,
        COME,
        "{subtree: move_joints, with: {joints: {joint_1: -1.4, joint_2: -0.6, joint_3: -0.07}}}",
    )
    (mistake,) = check(robot, None, [path]).mistakes
    assert re.search("this pose collides: .* deep in post", mistake.message)


def test_a_point_below_the_floor_is_a_note_if_only_the_start_pose_is_known(
    robot: Robot, tmp_path: Path
) -> None:
    low = "{subtree: move_tool, with: {point: [10 cm, 10 cm, -5 cm]}}"
    findings = check(robot, None, [written(tmp_path, low)])
    (note,) = findings.notes
    assert findings.mistakes == []
    assert re.match("from its boot pose: At the goal, .* deep in floor", note.message)


def test_a_distance_out_of_limits_is_a_note_if_only_the_start_pose_is_known(
    robot: Robot, tmp_path: Path
) -> None:
    far = FURTHER.replace("-10 deg", "100 deg")
    findings = check(robot, None, [written(tmp_path, far)])
    (note,) = findings.notes
    assert findings.mistakes == []
    assert note.message.startswith("from its boot pose: joint_1 = 100 deg is outside its limits")
    assert check(robot, None, [written(tmp_path, FURTHER)]).notes == []
    findings = check(robot, None, [written(tmp_path, COME, far, far)])
    assert ([*map(str, findings.notes)], len(findings.mistakes)) == ([], 1)


def test_plan_takes_along_what_the_task_holds(tmp_path: Path) -> None:
    first, second = planned(tmp_path, BALL, LEFT, HOLD, GO)
    assert "Bodies    ball\n" in first
    assert "Bodies    ball on claw_support\n" in second


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("steps", "above", "names"),
    [
        ((TALL, MAYBE.format("tall"), GO), "", "tall"),
        ((TALL.replace("0.115]", "$z]").replace("0.1]", "$z]"), GO),
         "parameters: {z: {type: length}}\n", "tall"),
        ((TALL, "{RemoveBody: {body: $b}}", GO), "parameters: {b: {type: text}}\n",
         "bodies named at run time, tall"),
        ((BALL, "{SetStart: {start: $s}}",
          "{ReachPoint: {start: $s, point: [1, 0.05, 0.08], target: $t}}",
          "{Target: {start: $s, joints: $t, goal: $g}}",
          "{PlanArm: {start: $s, goal: $g, plan: $a}}",
          "{PlanGripper: {start: $s, goal: $g, plan: $b}}",
          "{Execute: {arm_plan: $a, gripper_plan: $b}}", HOLD, GO),
         "", "ball"),
        ((BALL, COME, "{SetStart: {start: $s}}",
          f"{{PlanArm: {{start: $s, goal: {WHOLE}, plan: $a}}}}",
          f"{{PlanGripper: {{start: $s, goal: {WHOLE}, plan: $b}}}}",
          "{Execute: {arm_plan: $a, gripper_plan: $b}}", HOLD, GO),
         "", "ball"),
        ((BALL, MAYBE.format("ball"), BEAM, GO), "", "ball"),
    ],
)  # fmt: skip
def test_plan_says_what_it_leaves_out(
    tmp_path: Path, steps: tuple[str, ...], above: str, names: str
) -> None:
    reported = planned(tmp_path, *steps, above=above)[-1]
    assert "Path      straight" in reported
    assert f"Left out  {names}: bodies whose pose is known only in a run" in reported
    assert f"Bodies    {names}" not in reported


CUBE = "AddBox: {body: cube, size: [6 cm, 6 cm, 6 cm], position: [0, 0.1, 0.16]}"  # round the hand
AWAY = "{subtree: reach, with: {arm: right, gripper: open}}"


@pytest.mark.parametrize(
    ("steps", "notes"),
    [((CUBE, AWAY), 1), ((AWAY, CUBE), 0), ((AWAY, CUBE, AWAY), 0), ((BALL, AWAY), 0)],
)
def test_where_a_reset_puts_the_arm_is_noted_and_no_mistake(
    robot: Robot, tmp_path: Path, steps: tuple[str, ...], notes: int
) -> None:
    findings = check(robot, None, [written(tmp_path, *steps)])
    assert findings.mistakes == []
    assert len(findings.notes) == notes
    assert all("before this motion" in note.message for note in findings.notes)
    assert all(note.place.line == 7 for note in findings.notes)


REACH = "{subtree: move_tool, with: {point: [10 cm, 5 cm, 8 cm]}}"
FAR = "{subtree: move_tool, with: {point: [1 m, 5 cm, 8 cm]}}"
FOLLOW = "{subtree: follow, with: {via: [{joint_1: -0.5, joint_2: 0, joint_3: 0}], arm: right}}"


def all_said(folder: Path, *steps: str) -> str:
    written(folder, *steps)
    arguments = ["plan", "7", "--trees", str(folder), "--group", "arm"]
    arguments += ["-o", str(folder / "plan.png")]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 0, result.exception
    return result.output


@pytest.mark.usefixtures("undrawn")
def test_a_plan_follows_points_for_the_tool_and_on_the_way(tmp_path: Path) -> None:
    said = all_said(tmp_path, REACH, FOLLOW, COME)
    goals = re.findall("Goal      joint_1 (.*), joint_2", said)
    assert goals == ["-71.145 deg", "-80.214 deg", "0 deg"]
    assert "Path      through 1 point" in said
    assert "Unplanned" not in said
    assert "Start" not in said


@pytest.mark.usefixtures("undrawn")
def test_a_plan_names_the_moves_that_it_leaves_out(tmp_path: Path) -> None:
    said = all_said(tmp_path, GO, FAR, TURN, COME, COME)
    assert "Unplanned x/move_tool/Target: The tool cannot reach (1000.0, 50.0, 80.0) mm" in said
    assert "Unplanned x/move_joints/Target: its start or target is known only during a run" in said
    start = "Start     assumed to be joint_1 -80.214 deg, joint_2 -34.377 deg, "
    start += "joint_3 -4.0107 deg"
    assert said.count("Start     ") == 1
    assert said.index("Motion 2 of 3") < said.index(start) < said.index("Motion 3 of 3")
