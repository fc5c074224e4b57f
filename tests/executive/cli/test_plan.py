"""`armtree plan`: its output, its drawing and its errors."""

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from matplotlib.image import imread

from executive.cli.main import cli
from executive.code_table import look_up
from hardware import load_robot
from skills import BadTarget
from skills.motion import GoalInCollision, Plan, Query, Unreachable
from skills.motion.planner import Planner
from trees import UnknownTask

pytestmark = pytest.mark.slow

PICK = ("joint_1=-1.4", "joint_2=-0.6", "joint_3=-0.07")
POST = [{"name": "post", "box": {"size": [0.03, 0.03, 0.2]}, "position": [0.115, 0.115, 0.1]}]


def plan(folder: Path, *arguments: str) -> Result:
    return CliRunner().invoke(cli, ["plan", *arguments, "-o", str(folder / "plan.png")])


def test_a_straight_move(tmp_path: Path) -> None:
    result = plan(tmp_path, *PICK)
    assert result.exit_code == 0
    assert "Path      straight" in result.output
    assert "Duration  3.347 s" in result.output
    assert "the acceleration limit of joint_1, 28.648 deg/s²: 3.35 s (100 %)" in result.output
    assert imread(tmp_path / "plan.png").shape[:2] == (1640, 1432)


def test_a_motion_of_ten_minutes_is_drawn_too(tmp_path: Path) -> None:
    """The curves have as many points as those of a short motion, not millions."""
    shipped = load_robot()
    text = shipped.path.read_text().replace(f'"{shipped.urdf.name}"', json.dumps(str(shipped.urdf)))
    robot = tmp_path / "slow.toml"
    robot.write_text(re.sub(r"^velocity = .*", "velocity = 2.4e-3", text, flags=re.MULTILINE))
    result = plan(tmp_path, *PICK, "--robot", str(robot))
    assert result.exit_code == 0, result.output
    assert "Duration  583" in result.output
    assert (tmp_path / "plan.png").stat().st_size


@pytest.mark.parametrize(
    ("name", "begin"), [("p.svg", b"<?xml"), ("p.PDF", b"%PDF"), ("p", b"\x89PNG")]
)
def test_the_suffix_says_how_it_is_drawn(tmp_path: Path, name: str, begin: bytes) -> None:
    output = tmp_path / name
    assert CliRunner().invoke(cli, ["plan", "right", "-o", str(output)]).exit_code == 0
    assert output.read_bytes().startswith(begin)


def test_it_is_drawn_in_degrees(tmp_path: Path) -> None:
    output = tmp_path / "p.svg"
    CliRunner().invoke(cli, ["plan", "joint_1=70deg", "joint_2=0.5", "-o", str(output)])
    drawn = output.read_text()
    assert "<!-- position [deg] -->" in drawn
    assert "<!-- 60 -->" in drawn  # on an axis
    assert "<!-- speed [deg/s] -->" in drawn


def test_what_is_no_drawing_is_refused_at_once(tmp_path: Path) -> None:
    result = CliRunner().invoke(cli, ["plan", "right", "-o", str(tmp_path / "plan.jpg")])
    assert result.exit_code == 2
    assert "plan.jpg: the name of a drawing ends with one of .png, .svg, .pdf" in result.output
    assert "Goal" not in result.output


def test_round_a_body(tmp_path: Path) -> None:
    (tmp_path / "world.json").write_text(json.dumps(POST))
    world = ("--world", str(tmp_path / "world.json"))
    bare = plan(tmp_path, *PICK)
    without = (tmp_path / "plan.png").read_bytes()
    result = plan(tmp_path, *PICK, *world)
    assert result.exit_code == bare.exit_code == 0
    assert re.search(r"Path      around an obstacle, \d waypoints\n", result.output)
    times = r"Duration  (.*) s; a straight line would take (.*) s, the path is (.*) % longer\n"
    (found,) = re.findall(times, result.output)
    duration, straight, percent = map(float, found)
    assert percent == pytest.approx(100.0 * (duration / straight - 1.0), abs=0.6)
    assert (tmp_path / "plan.png").read_bytes() != without


@pytest.mark.usefixtures("undrawn")
def test_of_many_bodies_some_are_named(tmp_path: Path) -> None:
    far = [POST[0] | {"name": f"b{i}", "position": [2, 0, 0]} for i in range(25)]
    (tmp_path / "world.json").write_text(json.dumps(far))
    result = plan(tmp_path, *PICK, "--world", str(tmp_path / "world.json"))
    assert "Bodies    b0, b1, b2, " in result.output
    assert ", b19 and 5 more\n" in result.output


@pytest.mark.usefixtures("undrawn")
def test_a_timeout_can_be_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    planned, timeouts = Planner.plan, list[float]()

    def note(planner: Planner, query: Query) -> Plan:
        timeouts.append(query.timeout)
        return planned(planner, query)

    monkeypatch.setattr(Planner, "plan", note)
    assert plan(tmp_path, "1", "--planning-timeout", "0.05").exit_code == 2
    assert plan(tmp_path, *PICK, "--planning-timeout", "70").exit_code == 0
    assert set(timeouts) == {70.0}


@pytest.mark.usefixtures("undrawn")
def test_a_point_and_a_start(tmp_path: Path) -> None:
    result = plan(tmp_path, "0.1", "0.05", "0.08", "--start", "joint_4=-0.7")
    assert result.exit_code == 0, result.exception
    assert "Goal      joint_1 -71.1" in result.output


@pytest.mark.usefixtures("undrawn")
def test_a_pose_and_the_group_it_is_of(tmp_path: Path) -> None:
    result = plan(tmp_path, "open", "--start", "right")
    assert result.exit_code == 0, result.exception
    assert "Goal      joint_4 -40.107 deg" in result.output
    assert "the acceleration limit of joint_4" in result.output


@pytest.mark.usefixtures("undrawn")
def test_a_task(tmp_path: Path) -> None:
    result = plan(tmp_path, "1")
    assert result.exit_code == 0, result.exception
    assert "joint_1 -80.214 deg, joint_2 -34.377 deg, joint_3 -4.0107 deg" in result.output


@pytest.mark.usefixtures("undrawn")
def test_a_change_relative_to_the_start(tmp_path: Path) -> None:
    result = plan(tmp_path, "joint_1+=-0.4", "joint_2=0.2", "--start", "joint_1=-1 joint_2=0.1")
    assert result.exit_code == 0, result.exception
    assert "Goal      joint_1 -80.214 deg, joint_2 11.459 deg, joint_3 0 deg" in result.output


@pytest.mark.usefixtures("undrawn")
def test_points_on_the_way(tmp_path: Path) -> None:
    result = plan(tmp_path, "right", "--via", "joint_2=-0.3 joint_1=-0.2", "--via", "joint_1+=-1")
    assert result.exit_code == 0, result.exception
    assert "Path      through 2 points, 4 waypoints" in result.output


@pytest.mark.usefixtures("undrawn")
def test_a_direction_for_the_tool(tmp_path: Path) -> None:
    point = ("0.1", "0.05", "0.08")
    free = plan(tmp_path, *point)
    held = plan(tmp_path, *point, "--direction", "0.8", "0.4", "0.45")
    assert isinstance(held.exception, Unreachable)  # three joints cannot do both
    assert "can reach (100.0, 50.0, 80.0) mm, but its axis" in str(held.exception)
    assert free.exit_code == 0


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("goal", "found"),
    [
        (("joint_1=-40deg", "joint_2='20 deg'"), "joint_1 -40 deg, joint_2 20 deg, joint_3 0 deg"),
        (("right", "joint_1+=10 deg"), "joint_1 -70.214 deg, joint_2 -34.377 deg"),
        (("10cm", "50 mm", "0.08"), "joint_1 -71.1"),
        (("joint_1+=0", "--start", "10cm 50mm 0.08"), "joint_1 -71.1"),
        (("0", "0", "-1cm", "--relative", "--start", "10cm 50mm 9cm"), "joint_1 -71.1"),
        (("0", "0", "0", "--relative", "--tool", "claw_support"), "joint_1 0 deg"),
        (("right", "--via", "10cm 50mm 8cm"), "joint_1 -80.214 deg"),
    ],
)
def test_goals_are_written_as_in_task_files(
    tmp_path: Path, goal: tuple[str, ...], found: str
) -> None:
    result = plan(tmp_path, *goal)
    assert result.exit_code == 0, result.exception
    assert f"Goal      {found}" in result.output


@pytest.mark.usefixtures("undrawn")
def test_another_tool_gets_elsewhere(tmp_path: Path) -> None:
    point = ("0.1", "0.05", "0.08")
    there = plan(tmp_path, *point, "--offset", "0", "1cm", "0").output
    goals = [said.splitlines()[1] for said in (there, plan(tmp_path, *point).output)]
    assert [goal.split()[0] for goal in goals] == ["Goal", "Goal"]
    assert goals[0] != goals[1]
    other = ("--tool", "claw_support", "--axis", "0", "0", "1", "--direction", "0", "0", "1")
    assert "deg off the direction (0, 0, 1)" in str(plan(tmp_path, *point, *other).exception)


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        (
            ("joint_1=70dag",),
            "joint_1: '70dag': no unit dag; there are deg, rad; did you mean 70 deg",
        ),
        (("joint_1=5cm",), "joint_1: '5cm': no unit cm; there are deg, rad"),
        (("joint_1=",), "joint_1 has no value"),
        (("joint_1=.nan",), "joint_1: nan is not finite"),
        (("joint_1=[1",), "joint_1: .*is not closed"),
        (("1", "2", "3deg"), "point: '3deg': no unit deg; there are cm, m, mm"),
        (("1", "2", "x"), "point: 'x' is not a length in m, cm or mm"),
        (("right", "--relative"), "--relative needs a point for the tool"),
        (("1", "--tool", "claw_support"), "--tool needs a point for the tool"),
        (("0", "0", "0", "--axis", "0", "x", "0"), "--axis: 'x' is not a number"),
        (("0.1", "0", "0.1", "--tool", "claw"), "^--tool: the robot has no link claw; it has"),
        (("0.1", "0", "8", "cm"), "'cm' is separated from its number; write 8cm as one word, or"),
        (("0.1", "0", "0.1", "--direction", "0", "0", "0"), "^--direction: direction is 0, 0, 0"),
        (("joint_1=70", "deg"), "'deg' is separated from its number; write joint_1=70deg"),
        (("joint_1+=-0.1", "joint_1+=-0.1"), "joint_1 is given twice"),
        (("right", "--start", "joint_1=1 joint_1=1"), "joint_1 is given twice"),
        (
            ("right", "--start", "joint_1=1 joint_2"),
            "--start: 'joint_2' has no =; write joint_2=20deg",
        ),
        (("right", "--start", "joint_1=7"), r"--start: joint_1 = 401.07 deg is outside"),
        (("right", "--start", "joint_7=7"), "joint_7 is not an actuated joint"),
        (("joint_5=0.1",), "joint_5 follows joint_4; name joint_4 instead"),
        (("right", "--via", "1"), "has three, x y z, such as 0.1 0.1 8cm in quotes"),
    ],
)
def test_what_is_written_wrong_is_named(tmp_path: Path, goal: tuple[str, ...], why: str) -> None:
    result = plan(tmp_path, *goal)
    assert re.search(why, str(result.exception)), result.exception
    assert look_up(getattr(result.exception, "code", "")).exit_status not in (0, 1)


TWO_REACHES = """
task: 7
name: there_and_back
description: Twice.
tree:
  sequence:
    - subtree: reach
      with: {arm: right, gripper: open}
    - subtree: reach
      with: {arm: upright, gripper: closed}
"""


def test_a_task_of_several_motions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[str] = []  # instead of real drawings, of which each takes a second
    monkeypatch.setattr(
        "executive.preview.explanation._draw", lambda *given: drawn.append(given[-1].name)
    )
    (tmp_path / "7_there_and_back.yaml").write_text(TWO_REACHES)
    result = plan(tmp_path, "7", "--trees", str(tmp_path))
    assert result.exit_code == 0, result.exception
    said = result.output.splitlines()
    goals = [line.split()[1] for line in said if line.startswith("Goal")]
    assert goals == ["joint_1", "joint_4", "joint_1", "joint_4"]  # the arm, then the gripper
    assert "Motion 4 of 4" in said
    assert drawn == ["plan.png", "plan-2.png", "plan-3.png", "plan-4.png"]
    alone = plan(tmp_path, "7", "--trees", str(tmp_path), "--group", "gripper").output
    assert [line for line in alone.splitlines() if line.startswith("Goal")] == [
        line for line in said if line.startswith("Goal      joint_4")
    ]


@pytest.mark.usefixtures("undrawn")
def test_a_task_that_moves_nothing(tmp_path: Path) -> None:
    said = plan(tmp_path, "2", "--start", "folded closed").output
    assert "Path      none: the arm is at the goal already" in said
    assert "Motion" not in said


@pytest.mark.usefixtures("undrawn")
def test_how_long_it_took_to_get_ready_is_reported(tmp_path: Path) -> None:
    ready, _, _, _, found, *_ = plan(tmp_path, "0.1", "0.05", "0.08").output.splitlines()
    milliseconds = re.match(r"Prepared  in (\S+) ms \(model (\S+), goal (\S+)\)$", ready)
    assert milliseconds
    whole, model, goal = map(float, milliseconds.groups())
    assert whole == pytest.approx(model + goal, abs=0.02)
    assert goal > 0.5  # many descents
    assert found.startswith("Planned   in")


@pytest.mark.parametrize(
    ("goal", "error"),
    [
        (("joint_9=1",), BadTarget),
        (("rihgt",), BadTarget),
        (("joint_1=0", "joint_4=-0.5"), BadTarget),
        (("1", "--group", "legs"), BadTarget),
        (("99",), UnknownTask),
        (("joint_1=x",), BadTarget),
        (("joint_9+=1",), BadTarget),
        (("1", "--via", "right"), BadTarget),
        (("right", "--via", "joint_4=0"), BadTarget),
        (("right", "--direction", "0", "0", "1"), BadTarget),
        (("1", "2"), BadTarget),
        (("joint_2=-1.5", "joint_3=-0.5"), GoalInCollision),
        (("0.9", "0", "0.1"), Unreachable),
    ],
)
def test_refusals(tmp_path: Path, goal: tuple[str, ...], error: type[Exception]) -> None:
    result = plan(tmp_path, *goal)
    assert isinstance(result.exception, error)
    assert not (tmp_path / "plan.png").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_task_by_its_name(tmp_path: Path) -> None:
    by_name, by_number = plan(tmp_path, "pick"), plan(tmp_path, "1")
    assert by_name.exit_code == 0, by_name.exception
    goals = re.findall("^Goal .*", by_number.output, re.MULTILINE)
    assert goals
    assert re.findall("^Goal .*", by_name.output, re.MULTILINE) == goals
