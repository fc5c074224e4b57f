"""`armtree new-arm`: from a maker's URDF to an arm that moves."""

import dataclasses
import json
import os
import pty
import re
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import cli
from executive.goals.moves.goal_words import read_words
from executive.replay.verification import verify
from executive.testing import SimulatedArm
from hardware import DescriptionError, load_robot
from skills.motion import Query
from skills.motion.planner import Planner
from tests.support.arms.real_arms import ROBOTS
from tests.support.arms.urdfs import urdf
from tests.support.command_line.pseudo_terminal import PseudoTerminal
from tests.support.command_line.typed import typed as type_command

ARM = ["base -> a: revolute shoulder", "a -> b: revolute elbow", "b -> c: prismatic gripper"]
# The arm, the gripper and the tool of the makers' URDFs.
MADE = {
    "so_arm_description/urdf/so101.urdf": ("wrist_roll", ["gripper"], "gripper_frame_link"),
    "panda_description/urdf/panda.urdf": (
        "panda_joint7",
        ["panda_finger_joint1", "panda_finger_joint2"],
        "panda_hand_tcp",
    ),
    "ur_description/urdf/ur5_robot.urdf": ("wrist_3_joint", [], "tool0"),
    "xarm_description/urdf/xarm7.urdf": ("joint7", [], "link_eef"),
    "z1_description/urdf/z1.urdf": ("joint6", ["jointGripper"], "link06"),
    "kinova_description/robots/kinova.urdf": ("j2s6s200_joint_6", [], "j2s6s200_link_6"),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))  # no server of another test
    (tmp_path / "arm.urdf").write_text(urdf(ARM))
    return tmp_path


def armtree(*arguments: str) -> Result:
    return CliRunner().invoke(cli, arguments)


@pytest.mark.slow
@pytest.mark.parametrize("file", MADE, ids=lambda file: Path(file).stem)
def test_two_commands_from_a_makers_urdf_to_a_motion(folder: Path, file: str) -> None:
    last, gripper, tool = MADE[file]
    result = armtree("new-arm", str(ROBOTS / file))
    assert result.exit_code == 0, result.exception
    command, *words = result.output.splitlines()[-1].removeprefix("Next, type: armtree ").split()
    robot = load_robot(folder / f"{Path(file).stem}.toml")
    assert robot.tool
    assert (robot.groups["arm"][-1], robot.tool.link) == (last, tool)
    assert list(robot.groups["gripper"]) == gripper
    assert command == "move"
    if robot.name != "my_so101":  # one arm is moved; for the others the same motion is planned
        move = read_words(words[:1], robot, {})
        goal = [robot.joint(name).boot + change for name, change in move.changes.items()]
        rest = [joint.boot for joint in robot.actuated_in("arm")[1:]]
        assert Planner(robot).plan(Query("arm", robot.boot_pose, (*goal, *rest))).duration > 0.0
        return
    moved = armtree("move", *words)
    assert moved.exit_code == 0, moved.output
    assert "SUCCEEDED" in moved.output
    (recording,) = (folder / "recordings").iterdir()
    verified = verify(recording)
    assert verified.holds, verified.text()


@pytest.mark.slow
def test_a_task_of_a_new_arm_runs_without_a_board(folder: Path) -> None:
    assert armtree("new-arm", "arm.urdf").exit_code == 0
    assert armtree("new", "3", "wave", "--robot", "arm.toml").exit_code == 0
    with SimulatedArm(trees=folder / "trees", robot=folder / "arm.toml") as arm:
        assert arm.run("wave").success


def test_what_was_guessed_is_said_and_can_be_given(folder: Path) -> None:
    said = armtree("new-arm", "arm.urdf").output
    assert "  arm        shoulder, elbow\n  gripper    gripper\n  tool       b\n" in said
    assert "  start pose all joints at 0; no links are checked\n  pairs      none\n" in said
    assert '\nWith the line `robot = "arm.toml"` in armtree.toml, --robot is not needed.\nN' in said
    (folder / "arm.toml").unlink()
    (folder / "armtree.toml").write_text('robot = "arm.toml"')
    said = armtree("new-arm", "arm.urdf").output
    assert said.endswith("\n\nNext, type: armtree move shoulder+=5deg\n")
    given = ("--gripper", "none", "--tool", "a", "-o", "other.toml")
    assert armtree("new-arm", "arm.urdf", *given).exit_code == 0
    robot = load_robot(folder / "other.toml")
    assert (robot.name, robot.groups["gripper"]) == ("other", ())
    assert robot.tool == dataclasses.replace(robot.tool, link="a")  # type: ignore[type-var]


@pytest.mark.slow
def test_pairs_of_links_are_counted_and_missing_visual_meshes_named(folder: Path) -> None:
    box = '<collision><geometry><box size="0.01 0.01 0.01"/></geometry></collision>'
    seen = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'
    far = '<origin xyz="0 0 1"/>'
    (folder / "arm.urdf").write_text(urdf([f"{each} {far}" for each in ARM[:2]], box + seen))
    said = armtree("new-arm", "arm.urdf").output
    assert "  pairs      3 of links; not checked: 2 adjacent, 1 never\n" in said
    advice = "copy the file to that path, or correct the path in arm.urdf"
    why = f"the mesh gone.stl is not found; {advice}"
    assert f"  shapes     {why}. Only viewers need visual meshes\n" in said
    for command in ("doctor", "check"):
        assert why in armtree(command, "--robot", "arm.toml").output


@pytest.mark.slow
def test_the_gripper_opens_and_closes(folder: Path) -> None:
    short = '<limit lower="-0.02" upper="0.02" velocity="2" effort="1"/>'
    (folder / "arm.urdf").write_text(urdf([*ARM[:2], f"{ARM[2]} {short}"]))
    said = armtree("new-arm", "arm.urdf").output
    assert "open gripper 20.0 mm, closed gripper -20.0 mm, in trees/arm/poses.yaml" in said
    poses = folder / "trees/arm/poses.yaml"
    assert (
        "# pads = { c = [0.0, 0.0, 0.0], b = [0.0, 0.0, 0.0] }" in (folder / "arm.toml").read_text()
    )
    assert "If `armtree move open` closes the\n# gripper, swap the two names." in poses.read_text()
    for name, position in (("open", 0.02), ("closed", -0.02)):
        assert armtree("move", name, "--robot", "arm.toml").exit_code == 0
        where = json.loads(armtree("where", "--json", "--robot", "arm.toml").output)
        assert where["commanded"]["gripper"] == position


def test_poses_that_exist_are_kept(folder: Path) -> None:
    (folder / "trees/arm").mkdir(parents=True)
    (folder / "trees/arm/poses.yaml").write_text("poses: {open: {gripper: 0.5}}")
    assert "  poses      none saved\n" in armtree("new-arm", "arm.urdf").output
    assert (folder / "trees/arm/poses.yaml").read_text() == "poses: {open: {gripper: 0.5}}"


HULLS = (
    ("base", "0.1 0.1 2", "0 0 1"),
    ("below", "0.1 0.1 2", "0 0 -1"),
    ("upper", "0.1 0.02 0.02", "0.2 0 0"),
    ("finger", "0.1 0.02 0.02", "-0.3 0 0"),
)


def colliding(lower: str) -> str:
    """A URDF whose finger is inside the base or the link below it, if it is near its middle."""
    links = [
        f'<link name="{name}"><collision><origin xyz="{at}"/><geometry><box size="{size}"/>'
        "</geometry></collision></link>"
        for name, size, at in HULLS
    ]
    limit = '<axis xyz="0 1 0"/><limit lower="{}" upper="{}" velocity="2" effort="1"/>'
    joints = [
        f'<joint name="{child}_j" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/>{ends}</joint>'
        for child, parent, kind, at, ends in (
            ("below", "base", "fixed", "0 0 0", ""),
            ("upper", "base", "revolute", "0 0 0", limit.format("-1", "1")),
            ("finger", "upper", "revolute", "0.3 0 0", limit.format(lower, "0.25")),
        )
    ]
    return f'<robot name="r">{"".join(links + joints)}</robot>'


def test_collisions_that_are_not_checked_and_poses_that_were_moved_are_named(folder: Path) -> None:
    (folder / "arm.urdf").write_text(colliding("-0.25"))
    said = armtree("new-arm", "arm.urdf", "--gripper", "none").stderr
    why = "collide in the start pose, and no free pose was found. Collisions between them are not"
    assert re.search(rf"warning: (base|below) and finger(, \w+ and finger)? {why} checked", said)
    (folder / "arm.urdf").write_text(colliding("-2"))
    said = armtree("new-arm", "arm.urdf", "--gripper", "finger_j", "-o", "b.toml").stderr
    why = "pose closed: at finger_j 14.3 deg the gripper collides in the start pose; saved finger_j"
    assert f"warning: {why} -" in said
    assert "not checked" not in said


def test_all_wrong_options_are_reported_at_once(folder: Path) -> None:
    wrong = ("--gripper", "left", "--tool", "hand", "-o", "no/arm.toml")
    said = armtree("new-arm", "arm.urdf", *wrong).output
    for each in (
        "no folder no",
        "left is not a joint that moves",
        "there is no link hand",
    ):
        assert each in said


def test_at_a_terminal_it_asks_for_the_tool(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = pty.openpty()
    with open(slave, closefd=False) as terminal, open(master, "wb", buffering=0) as person:
        monkeypatch.setattr("sys.stdin", terminal)
        person.write(b"elbow\nc\n")
        cli.main(["new-arm", "arm.urdf"], standalone_mode=False)
        monkeypatch.undo()
    os.close(slave)
    tool = load_robot(folder / "arm.toml").tool
    assert tool
    assert tool.link == "c"


@pytest.mark.slow
def test_the_question_for_the_tool_breaks_no_name_and_ends_its_line_at_ctrl_c(folder: Path) -> None:
    links = [f"finger_{side}_{part}" for side in ("left", "right") for part in ("inner", "outer")]
    joints = [f"c -> {link}: fixed {link}_weld" for link in links]
    (folder / "arm.urdf").write_text(urdf([*ARM, *joints]))
    with PseudoTerminal(folder, "new-arm", "arm.urdf") as terminal:
        terminal.until("Link of the tool [")
        terminal.type("hand\n")
        terminal.until("there is no link hand; there are a, b", *links, "outer\nLink of the tool")
        terminal.type("\x03")
        status, printed = terminal.end()
    assert (status, printed.endswith("^C\n")) == (130, True)


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_an_arm_may_have_one_joint(folder: Path, kind: str) -> None:
    (folder / "one.urdf").write_text(urdf([f"base -> a: {kind} turn"]))
    assert armtree("new-arm", "one.urdf").exit_code == 0
    robot = load_robot(folder / "one.toml")
    assert Planner(robot).plan(Query("arm", robot.boot_pose, (0.1,))).duration > 0.0


def test_no_file_is_overwritten(folder: Path) -> None:
    (folder / "arm.toml").write_text("mine")
    status, _, error = type_command(folder, "new-arm", "arm.urdf")
    assert status == 2
    assert "arm.toml exists; delete it, or give another file with -o" in error
    assert "no folder no" in armtree("new-arm", "arm.urdf", "-o", "no/arm.toml").output
    assert (folder / "arm.toml").read_text() == "mine"


def test_a_urdf_that_is_wrong_leaves_no_file(folder: Path) -> None:
    (folder / "wrong.urdf").write_text(urdf([*ARM, "c -> d: screw thread"]))
    for name, why in (("wrong.urdf", "thread is screw"), ("none.urdf", "No such file"), (".", "")):
        result = armtree("new-arm", name)
        assert isinstance(result.exception, DescriptionError)
        assert why in str(result.exception)
    assert not (folder / "wrong.toml").exists()


def test_the_robots_that_ship_are_listed_and_found_by_name(folder: Path) -> None:
    said = armtree("robots").output
    assert "arduinobot   arm: joint_1" in said
    assert "tasks: home, pick, rest, wave" in said
    firmware = Path(said.splitlines()[-1].removeprefix("Firmware for an Uno or a Nano: "))
    assert firmware.read_text().startswith(":10000000")
    assert "wave" in armtree("tasks", "--robot", "so101").output
    (folder / "armtree.toml").write_text('robot = "so101"')
    assert "wave" in armtree("tasks").output
    wrong = armtree("tasks", "--robot", "so10")
    assert "robots are arduinobot, so101; did you mean so101?" in str(wrong.exception)
