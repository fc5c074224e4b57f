"""Moves: from words to goals, their recordings, and what is wrong with them."""

import math
from pathlib import Path

import pytest

import logs
from executive.api.move import Move
from executive.api.outcome import GoalState
from executive.goals.moves.goal_words import read_words
from executive.replay.verification import verify
from executive.task_runner import TaskRunner
from hardware import SimulatedClock, load_robot
from skills import BadTarget
from tests.conftest import RigMaker
from tests.support.servers.server_acts import at_frame

UPRIGHT = {"joint_1": 0.0, "joint_2": 0.0, "joint_3": 0.0, "joint_4": 0.0}


@pytest.mark.parametrize(
    ("words", "relative", "changed"),
    [
        (("joint_1=40deg",), False, {"joint_1": math.radians(40)}),
        (("joint_1=0.3", "joint_2+=0.1", "open"), False, {"joint_1": 0.3, "joint_2": 0.1}),
        (("folded", "joint_3+=0.2"), False, {"joint_1": -1.57, "joint_3": -0.7}),
        (("joint_1=5deg",), True, {"joint_1": math.radians(5)}),
        (("home",), False, {}),
        (("joint_1=0.3", "width=20mm"), False, {"joint_1": 0.3, "joint_4": -0.2158}),
    ],
)
def test_a_move_ends_where_its_words_say(
    server: RigMaker, words: tuple[str, ...], relative: bool, changed: dict[str, float]
) -> None:
    arm = server()
    sent = arm.executive.send(Move(words, relative))
    outcome = arm.executive.result(sent.identity)
    assert outcome.success
    opened = {"joint_4": -0.7} if {"open", "home"} & {*words} else {}
    found = arm.executive.where()
    assert found.commanded == pytest.approx({**UPRIGHT, **changed, **opened}, abs=1e-5)


def test_the_tool_moves_to_a_point_and_by_a_distance(server: RigMaker) -> None:
    arm = server()
    for words, relative in ((("0.1", "0.1", "10cm"), False), (("0", "0", "5mm"), True)):
        sent = arm.executive.send(Move(words, relative))
        assert arm.executive.result(sent.identity).success
    assert arm.executive.where().tool == pytest.approx((0.1, 0.1, 0.105), abs=1e-5)


def test_a_slow_move_takes_longer_and_is_verified(
    rig: RigMaker, shared_clock: SimulatedClock
) -> None:
    arm, durations = rig(), list[float]()
    with shared_clock.working():
        arm.executive.start()
        for target, speed in ((0.8, 1.0), (0.0, 0.5)):
            outcome = TaskRunner(arm.executive).run(Move((f"joint_1={target}",), speed=speed))
            assert Path(outcome.recording).name.endswith("-move.mcap")
            assert verify(Path(outcome.recording)).holds
            plan = [each for each in arm.recorded(logs.Plan) if each.group == "arm"][-1]
            durations.append(plan.duration)
            assert plan.velocity_limits[0] == speed * arm.robot.joint("joint_1").velocity
        arm.executive.close()
    assert durations[1] == pytest.approx(2 * durations[0])


def test_a_move_is_canceled_like_any_goal(rig: RigMaker, shared_clock: SimulatedClock) -> None:
    arm = rig()
    at_frame(arm, 5, arm.executive.cancel)
    with shared_clock.working():
        arm.executive.start()
        outcome = TaskRunner(arm.executive).run(Move(("folded",)))
        arm.executive.close()
    assert outcome.state is GoalState.CANCELED
    assert verify(Path(outcome.recording)).holds


@pytest.mark.parametrize(
    ("words", "relative", "speed", "code", "why"),
    [
        (("joint_9=1",), False, 1.0, "goal.bad_target", "joint_9 is not an actuated joint"),
        (("gripper=20mm",), False, 1.0, "goal.bad_target", "joint; write width=20mm"),
        (("x=0.1", "z=8cm", "y=0"), False, 1.0, "goal.bad_target", "tool write 0.1 0 8cm"),
        (("x=0.1", "y=0.1"), False, 1.0, "goal.bad_target", "x is not an actuated joint; there"),
        (("joint_1=70dg",), False, 1.0, "goal.bad_target", "did you mean 70 deg?"),
        (("joint_1=",), False, 1.0, "goal.bad_target", "joint_1 has no value"),
        (("joint_1=.nan",), False, 1.0, "goal.bad_target", "is not finite"),
        (("joint_1=91deg",), False, 1.0, "goal.out_of_bounds", "-90 deg to 90 deg"),
        (("joint_1=100deg", "joint_2=8"), False, 1.0, "goal.out_of_bounds", "did you mean 8 deg?"),
        (("joint_1=100deg", "joint_2=99deg"), False, 1.0, "goal.out_of_bounds", "; joint_2"),
        (("joint_1=70",), False, 1.0, "goal.out_of_bounds", "90 deg; did you mean 70 deg?"),
        (("joint_1=1.5708",), False, 1.0, "goal.out_of_bounds", "1.570796 rad: write 90 deg"),
        (("joint_1=9",), True, 1.0, "goal.out_of_bounds", "180 deg; did you mean 9 deg?"),
        (("joint_1=5",), True, 1.0, "goal.out_of_bounds", "5 rad, and the limit is 3.141593 rad"),
        (("width=200mm",), False, 1.0, "goal.out_of_bounds", "0.8 mm to 105.8 mm"),
        (("width=20",), False, 1.0, "goal.out_of_bounds", "did you mean 20 mm?"),
        (("width=5mm",), True, 1.0, "goal.bad_target", "such as width=20mm"),
        (("20mm",), False, 1.0, "goal.bad_target", "JOINT=VALUE or width=20mm"),
        (("joint_1=200deg",), True, 1.0, "goal.out_of_bounds", "more than its range, 180 deg"),
        (("foldd",), False, 1.0, "goal.bad_target", "did you mean folded?"),
        (("folded",), True, 1.0, "goal.bad_target", "folded is a pose, not a change"),
        (("0.1", "0.1"), False, 1.0, "goal.bad_target", "has three, x y z, such as"),
        (("0.1", "0.1", "x"), False, 1.0, "goal.bad_target", "point"),
        (("pitch=5deg",), True, 1.0, "goal.bad_target", "cannot turn its tool in place: it has 3"),
        (("pitch=5deg",), False, 1.0, "goal.bad_target", "is a change of the tool's orientation"),
        (("roll+=",), False, 1.0, "goal.bad_target", "roll has no value"),
        (("roll=",), False, 1.0, "goal.bad_target", "write roll+=5deg"),
        (("roll",), False, 1.0, "goal.bad_target", "'roll' is not a pose"),
        (
            ("pick",),
            False,
            1.0,
            "goal.bad_target",
            "pick is a task, not a target; `armtree run pick` runs it",
        ),
        (
            ("to", "folded"),
            False,
            1.0,
            "goal.bad_target",
            "'to' is not a pose; leave it out: folded",
        ),
        (("gripper=open",), False, 1.0, "goal.bad_target", "open is a pose: write open"),
        (("[0.1,", "0.1,", "0.2]"), False, 1.0, "goal.bad_target", "brackets; write 0.1 0.1 0.2"),
        (("pitch+=5deg", "roll"), False, 1.0, "goal.bad_target", "write roll+=5deg"),
        (("pitch+=5deg", "folded"), False, 1.0, "goal.bad_target", "cannot be combined"),
        (("yaw+=5deg", "joint_1=0"), False, 1.0, "goal.bad_target", "make two moves"),
        (
            ("yaw=5deg", "yaw=5deg"),
            True,
            1.0,
            "goal.bad_target",
            "twice; give it once, with the sum",
        ),
        (("0.1", "0.1", "8"), False, 1.0, "goal.bad_target", "did you mean 0.1 0.1 8cm?"),
        (("100", "0.1", "80"), False, 1.0, "goal.bad_target", "did you mean 100mm 0.1 80mm?"),
        (("joint_1 = 20 deg",), False, 1.0, "goal.bad_target", "write joint_1=20deg"),
        (("joint_1", "20"), False, 1.0, "goal.bad_target", "value; write joint_1=20deg"),
        (("joint_1", "200"), False, 1.0, "goal.bad_target", "value; write joint_1=200"),
        (("joint_1", "+=", "100"), False, 1.0, "goal.bad_target", "value; write joint_1+=100deg"),
        (("joint_1:20",), False, 1.0, "goal.bad_target", "has no =; write joint_1=20deg"),
        (("joint_1=0", "joint_1=1"), False, 1.0, "goal.bad_target", "is given twice; give it once"),
        (("joint_1=0", "joint_1+=1"), False, 1.0, "goal.bad_target", "twice; give it once"),
        (
            ("joint_1+=0.1", "joint_1+=1"),
            *(False, 1.0, "goal.bad_target"),
            "once, with the sum of its changes",
        ),
        ((), False, 1.0, "goal.bad_target", "needs a target"),
        (("folded",), False, 1.01, "goal.bad_target", "not between 0.01 and 1"),
        (("folded",), False, math.nan, "goal.bad_target", "not between 0.01 and 1"),
    ],
)
def test_a_wrong_move_is_refused(
    server: RigMaker, words: tuple[str, ...], relative: bool, speed: float, code: str, why: str
) -> None:
    arm = server()
    answer = arm.executive.send(Move(words, relative, speed))
    assert (answer.accepted, answer.code) == (False, code)
    assert why in answer.message
    assert ("sum" in answer.message) == ("sum" in why)
    assert answer.cause
    assert answer.cause.hint == ""  # the message says it
    assert not answer.message.startswith(("Target position", "The target"))
    assert not arm.frames


def test_a_pose_may_have_the_name_of_a_turn() -> None:
    robot, poses = load_robot(), {"roll": {"joint_1": 1.0}}
    assert read_words(("roll", "joint_2=0.5"), robot, poses).joints == {
        "joint_1": 1.0,
        "joint_2": 0.5,
    }
    assert read_words(("roll+=0.5",), robot, poses).turn == (0.5, 0.0, 0.0)
    with pytest.raises(BadTarget, match="'roll' cannot be combined with roll, pitch, yaw"):
        read_words(("pitch+=5deg", "roll"), robot, poses)


def test_a_change_out_of_bounds_is_known_from_the_start(server: RigMaker) -> None:
    arm = server()
    for code in ("ok", "goal.out_of_bounds"):
        answer = arm.executive.send(Move(("joint_1=50deg",), relative=True))
        outcome = arm.executive.result(answer.identity)
        assert outcome.code == code
    assert "joint_1 = 100 deg is outside its limits, -90 deg to 90 deg" in outcome.message


def test_a_move_that_its_tree_refuses_has_no_place(
    rig: RigMaker, shared_clock: SimulatedClock
) -> None:
    """The words of a move are in no file of the user."""
    arm = rig()
    with shared_clock.working():
        arm.executive.start()
        outcome = TaskRunner(arm.executive).run(Move(("joint_1=170deg",), relative=True))
        arm.executive.close()
    assert outcome.code == "goal.out_of_bounds"
    assert "move.yaml" not in outcome.text()
    assert verify(Path(outcome.recording)).holds


def test_a_robot_names_its_home(server: RigMaker, tmp_path: Path) -> None:
    shipped = load_robot()
    assert shipped.home == ("upright", "open")
    for home, code in (("nowhere", "goal.bad_target"), ("joint_2=0.1", "ok"), ("", "ok")):
        robot = tmp_path / "robot.toml"
        text = shipped.path.read_text().replace('"upright open"', f'"{home}"')
        robot.write_text(text.replace('"arduinobot.urdf"', f'"{shipped.urdf}"'))
        arm = server(robot=load_robot(robot))
        answer = arm.executive.send(Move(("home",)))
        assert answer.code == code
        if code == "ok":
            assert arm.executive.result(answer.identity).success
            commanded = arm.executive.where().commanded
            assert commanded == {**UPRIGHT, "joint_2": 0.1 if home else 0.0}
        else:
            assert f"{robot}: home: 'nowhere' is not a pose" in answer.message


def test_a_pose_of_ones_own_is_home(server: RigMaker, tmp_path: Path) -> None:
    (tmp_path / "poses.yaml").write_text("poses: {home: {joint_1: 0.4}}\n")
    arm = server(tasks=tmp_path)
    assert arm.executive.result(arm.executive.send(Move(("home",))).identity).success
    assert arm.executive.where().commanded == {**UPRIGHT, "joint_1": 0.4}


def test_where_an_arm_is_that_is_not_active(server: RigMaker) -> None:
    found = server(active=False).executive.where()
    assert (found.commanded, found.tool, found.measured) == (None, None, None)
    assert found.units == dict.fromkeys(UPRIGHT, "rad")
