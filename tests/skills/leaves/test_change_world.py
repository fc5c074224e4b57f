"""Tasks with obstacles, attached bodies, via points, relative targets and points."""

from pathlib import Path

import numpy as np
import pytest

import logs
from executive.api.outcome import Outcome
from hardware import Robot
from skills import Skill
from skills.leaves.change_world import AddBox, Attach, Detach
from skills.motion.planner import Planner
from tests.conftest import Bench, Rig, RigMaker

HEAD = """task: 7
name: try
description: Try something.
tree:
  sequence:
    - SetStart: {start: $start}
"""
GO = """
    - PlanArm: {start: $start, goal: $goal, plan: $arm_plan}
    - PlanGripper: {start: $start, goal: $goal, plan: $gripper_plan}
    - Execute: {arm_plan: $arm_plan, gripper_plan: $gripper_plan}
"""
CHECK = """
    - CheckBounds: {arm: $target, gripper: {joint_4: 0}, goal: $goal}"""


def run(rig: RigMaker, folder: Path, text: str) -> tuple[Outcome, Rig]:
    (folder / "7_try.yaml").write_text(text)
    made = rig(folder)
    return made.run(7)[0], made


def plan_of(made: Rig) -> logs.Plan:
    return next(plan for plan in made.recorded(logs.Plan) if plan.group == "arm")


def test_a_target_relative_to_now(rig: RigMaker, tmp_path: Path) -> None:
    step = "    - Shift: {start: $start, by: {joint_1: -0.3}, goal: $goal}"
    outcome, made = run(rig, tmp_path, HEAD + step + GO)
    assert outcome.success, outcome.message
    assert plan_of(made).goal == (-0.3, 0.0, 0.0)


def test_a_point_for_the_tool(rig: RigMaker, tmp_path: Path) -> None:
    step = """    - ReachPoint:
        {start: $start, point: [0, 0, 0.02], relative: true, tool: claw_support, target: $target}"""
    outcome, made = run(rig, tmp_path, HEAD + step + CHECK + GO)
    assert outcome.success, outcome.message
    assert plan_of(made).goal[0] == pytest.approx(0.0, abs=1e-6)


def test_a_point_out_of_reach_is_reported(rig: RigMaker, tmp_path: Path) -> None:
    step = "    - ReachPoint: {start: $start, point: [0.5, 0, 0.1], target: $target}"
    outcome, made = run(rig, tmp_path, HEAD + step + CHECK + GO)
    assert outcome.code == "plan.unreachable"
    assert "mm away" in outcome.message
    assert made.frames == []


def test_a_box_in_the_way_is_gone_round(rig: RigMaker, tmp_path: Path) -> None:
    step = """    - AddBox: {body: post, size: [0.03, 0.03, 0.2], position: [0.115, 0.115, 0.1]}
    - Shift: {start: $start, by: {joint_1: -1.4, joint_2: -0.6, joint_3: -0.07}, goal: $goal}
"""
    outcome, made = run(rig, tmp_path, HEAD + step + GO)
    assert outcome.success, outcome.message
    assert len(plan_of(made).waypoints) > 2


def test_a_body_is_there_for_the_tasks_that_follow(rig: RigMaker, tmp_path: Path) -> None:
    step = "    - AddSphere: {body: ball, radius: 0.01, position: [0.2, 0.2, 0.2]}\n"
    (tmp_path / "7_try.yaml").write_text(HEAD.replace("$start", "$a") + step + "    - Succeed")
    move = "    - Shift: {start: $start, by: {joint_1: -0.1}, goal: $goal}"
    then = HEAD.replace("task: 7\nname: try", "task: 8\nname: then") + move + GO
    (tmp_path / "8_then.yaml").write_text(then)
    made = rig(tmp_path)
    assert [outcome.success for outcome in made.run(7, 8)] == [True, True]
    assert [body["name"] for body in plan_of(made).world] == ["ball"]


def test_a_goal_inside_a_body_names_it(rig: RigMaker, tmp_path: Path) -> None:
    step = """    - AddSphere: {body: ball, radius: 0.05, position: [0.11, 0.02, 0.08]}
    - Shift: {start: $start, by: {joint_1: -1.4, joint_2: -0.6, joint_3: -0.07}, goal: $goal}
"""
    outcome, _ = run(rig, tmp_path, HEAD + step + GO)
    assert outcome.code == "plan.goal_in_collision"
    assert "ball" in outcome.message


def test_what_is_grasped_moves_along_and_is_checked(rig: RigMaker, tmp_path: Path) -> None:
    """A long rod in the gripper hits the table; the gripper alone would not."""
    rod = """    - AddCylinder:
        {body: rod, radius: 0.005, length: 0.15, position: [-0.015, 0.15, 0.09],
         touches: [gripper_left, gripper_right, claw_support, horizontal_arm]}
"""
    move = "    - Shift: {start: $start, by: {joint_2: -0.6}, goal: $goal}"
    outcome, _ = run(rig, tmp_path, HEAD + rod + "    - RemoveBody: {body: rod}\n" + move + GO)
    assert outcome.success, outcome.message
    hold = "    - Attach: {body: rod, link: claw_support}\n"
    outcome, _ = run(rig, tmp_path, HEAD + rod + hold + move + GO)
    assert outcome.code == "plan.goal_in_collision"
    assert "rod would be" in outcome.message


def test_via_points_are_passed_without_a_stop(rig: RigMaker, tmp_path: Path) -> None:
    points = "[{joint_1: -0.4, joint_2: 0.2, joint_3: 0}, {joint_1: -0.8, joint_2: 0, joint_3: 0}]"
    step = "    - Shift: {start: $start, by: {joint_1: -1.2}, goal: $goal}"
    move = GO.replace("plan: $arm_plan}", f"plan: $arm_plan, via: {points}}}", 1)
    outcome, made = run(rig, tmp_path, HEAD + step + move)
    assert outcome.success, outcome.message
    positions = np.array(plan_of(made).positions)
    assert abs(positions - (-0.4, 0.2, 0.0)).sum(axis=1).min() < 0.1
    speeds = abs(np.diff(positions[:, 0]))
    assert speeds[25:-25].min() > 0.2 * speeds.max()


@pytest.mark.parametrize(
    ("step", "code"),
    [
        ("Attach: {body: ghost, link: claw_support}", "plan.bad_world"),
        ("RemoveBody: {body: ghost}", "plan.bad_world"),
        ("AddMesh: {body: x, file: nope.stl, position: [0, 0, 1]}", "goal.bad_body"),
        ("AddSphere: {body: x, radius: -1, position: [0, 0, 1]}", "file.task"),
        ("AddBox: {body: x, size: [1, 1], position: [0, 0, 1]}", "file.task"),
        (
            "ReachPoint: {start: $start, point: [0, 0, 1], group: legs, target: $target}",
            "goal.bad_target",
        ),
        ("ReachPoint: {start: $start, point: [0, 1], target: $target}", "file.task"),
    ],
)
def test_mistakes(rig: RigMaker, tmp_path: Path, step: str, code: str) -> None:
    outcome, made = run(rig, tmp_path, HEAD + "    - " + step)
    assert outcome.code == code
    assert "planners failed" not in outcome.message
    assert made.frames == []


def test_a_detached_body_stays_where_it_was_put(bench: Bench, robot: Robot) -> None:
    """A planner in this process answers the requests of the bench."""
    planner = Planner(robot)

    def do(kind: type[Skill], **inputs: object) -> None:
        skill = bench.skill(kind, **inputs)
        skill.tick_once()
        for job in bench.desk.jobs:
            job.answer(planner.answer(job.request))
        bench.desk.jobs.clear()
        if skill.status.name == "RUNNING":
            skill.tick_once()
        assert skill.status.name == "SUCCESS", skill.feedback_message

    do(
        AddBox,
        body="cube",
        size=[0.02] * 3,
        position=[0.0, 0.15, 0.1],
        touches=[],
        rotation=[0.0] * 3,
    )
    do(Attach, body="cube", link="claw_support")
    held = bench.context.scene.world.body("cube")
    assert held.link == "claw_support"
    do(Detach, body="cube")
    put = bench.context.scene.world.body("cube")
    assert put.link == ""
    assert put.position == pytest.approx((0.0, 0.15, 0.1))


def test_a_body_that_is_not_attached_cannot_be_detached(rig: RigMaker, tmp_path: Path) -> None:
    steps = "    - AddBox: {body: cube, size: [0.02, 0.02, 0.02], position: [0, 0.3, 0.1]}\n"
    outcome, _ = run(rig, tmp_path, HEAD + steps + "    - Detach: {body: cube}\n")
    assert outcome.code == "plan.bad_world"
    assert "cube is attached to no link" in outcome.message
