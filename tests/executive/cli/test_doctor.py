"""`armtree doctor`, as a person types it."""

import json
import os
import shlex
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import cli
from hardware import SerialLink, load_robot
from hardware.drivers.servo_errors import CalibrationMissing
from tests.hardware.bring_up.test_checks import bus, vanish
from tests.support.arms.bus_arms import bus_arm
from tests.support.arms.hardware_rigs import Pty
from tests.support.paths import DATA

pytestmark = pytest.mark.slow


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A copy of the shipped robot."""
    shipped = load_robot().path
    shutil.copy(shipped.with_suffix(".urdf"), tmp_path)
    return Path(shutil.copy(shipped, tmp_path))


def doctor(folder: Path, *arguments: str) -> Result:
    return CliRunner().invoke(
        cli, ["doctor", *arguments], env={"ARMTREE_RECORDINGS": str(folder / "recordings")}
    )


def lines(result: Result) -> dict[str, str]:
    """The details of the checks, by name."""
    return {line[4:16].strip(): line[16:] for line in result.output.splitlines()}


def test_all_is_well(tmp_path: Path) -> None:
    result = doctor(tmp_path)
    assert result.exit_code == 0
    assert list(lines(result))[:8] == [
        "robot", "pose", "boot wait", "tasks", "planner", "recorder", "free disk", "port",
    ]  # fmt: skip
    assert result.output.splitlines()[-1] == "Next, type: armtree run 0"


def test_it_ends_with_what_to_type_next_with_every_option_that_was_given(
    tmp_path: Path, robot: Path
) -> None:
    given = ["--port", "virtual", "--robot", str(robot), "--trees", str(tmp_path)]
    given += ["--recordings", str(tmp_path / "my runs")]
    result = doctor(tmp_path, "--open", *given)
    assert result.exit_code == 0
    command = result.output.splitlines()[-1].removeprefix("Next, type: ")
    assert shlex.split(command) == ["armtree", "run", "0", *given]


def test_with_another_arm_it_ends_with_what_runs_without_a_task(tmp_path: Path) -> None:
    arm = ["--robot", str(DATA / "endless.toml")]
    result = doctor(tmp_path, *arm)
    assert result.exit_code == 0, result.output
    assert lines(result)["tasks"] == "no task for endless"
    command = shlex.split(result.output.splitlines()[-1].removeprefix("Next, type: "))
    assert command[:2] == ["armtree", "move"]
    assert command[-2:] == arm
    own = {"XDG_RUNTIME_DIR": str(tmp_path)}  # no server of another test
    moved = CliRunner().invoke(cli, [*command[1:], "--recordings", str(tmp_path)], env=own)
    assert moved.exit_code == 0, moved.output


def test_it_shows_the_direction_in_which_an_arm_that_measures_grips(tmp_path: Path) -> None:
    guess = "; guessed without pads: if it is wrong, change grips in the robot file"
    assert lines(doctor(tmp_path, "--robot", "so101"))["grip"] == (
        f"closing, towards gripper -10.0 deg{guess}"
    )
    robot = bus_arm(tmp_path)
    assert lines(doctor(tmp_path, "--robot", str(robot)))["grip"] == (
        "closing, towards joint_4 0.0 deg"
    )
    robot.write_text(f'{robot.read_text()}\n[guards]\ngrips = "opening"\n')
    assert lines(doctor(tmp_path, "--robot", str(robot)))["grip"] == (
        "opening, towards joint_4 -90.0 deg"
    )


def test_a_missing_calibration_needs_no_open_port(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    port = Pty().port
    result = doctor(tmp_path, "--robot", "so101", "--port", port)
    assert result.exit_code == CalibrationMissing.exit_status
    assert f"-> type armtree calibrate --robot so101 --port {port}" in result.output
    assert "run 0" not in result.output


def test_a_boot_pose_in_collision(tmp_path: Path, robot: Path) -> None:
    text = robot.read_text()
    for name, boot in (("[joints.joint_2]", "-1.5"), ("[joints.joint_3]", "-0.5")):
        before, after = text.split(name)
        text = before + name + after.replace("boot = 0.0", f"boot = {boot}", 1)
    robot.write_text(text)
    result = doctor(tmp_path, "--robot", str(robot))
    assert lines(result)["planner"].startswith("in its boot pose, ")
    assert "of the motion" not in result.output
    assert "choose another boot pose in the robot file" in result.output


def test_what_stands_in_the_environment_need_not_be_typed(tmp_path: Path, robot: Path) -> None:
    environment = {"ARMTREE_ROBOT": str(robot), "ARMTREE_RECORDINGS": str(tmp_path / "x")}
    result = CliRunner().invoke(cli, ["doctor"], env=environment)
    assert result.output.splitlines()[-1] == "Next, type: armtree run 0"


@pytest.mark.parametrize(
    ("firmware", "pose", "opening"),
    [
        (
            "stock",
            "after a reset the arm is at "
            "joint_1 0.0 deg, joint_2 0.0 deg, joint_3 0.0 deg, joint_4 0.0 deg",
            "it resets the board, and the arm moves to its boot pose",
        ),
        (
            "armtree",
            "the board reports the pose of the arm",
            "it resets the board, and the arm stays where it is",
        ),
    ],
)
def test_it_opens_only_with_the_option_and_says_before_what_that_does(
    tmp_path: Path, robot: Path, firmware: str, pose: str, opening: str
) -> None:
    answers = {
        "stock": (
            "?",
            "opened; received nothing; stock never answers, so a board may be missing",
        ),
        "armtree": ("ok", "booted; received armtree 1 "),
    }
    text = robot.read_text().replace('firmware = "stock"', f'firmware = "{firmware}"')
    robot.write_text(text)
    assert "opening" not in lines(doctor(tmp_path, "--robot", str(robot)))
    result = doctor(tmp_path, "--open", "--robot", str(robot))
    assert result.exit_code == 0
    said = lines(result)
    assert said["pose"] == pose
    assert said["boot wait"] == f"2 s after the port opens; {firmware} needs 1 s"
    assert said["opening"] == opening
    mark, what = answers[firmware]
    assert f"{mark:<4}board" in result.output
    assert said["board"].startswith(what)
    assert list(said).index("opening") < list(said).index("board")


@pytest.mark.parametrize(
    ("port", "status", "what", "remedy"),
    [
        ("/dev/ttyNOPE", 6, "/dev/ttyNOPE: No such file or directory", "plug the board in"),
        ("/dev/null", 6, "/dev/null is not a serial port", "give another --port"),
        ("", 3, "no port is given", "give --port PORT, or --port virtual"),
    ],
)
def test_a_port_that_will_not_do(
    tmp_path: Path, port: str, status: int, what: str, remedy: str
) -> None:
    result = doctor(tmp_path, "--port", port)
    assert result.exit_code == status
    assert f"NO  port        {what}\n                -> {remedy}" in result.output
    assert result.output.splitlines()[-1] == "Fix the lines with NO."


def test_a_board_that_opening_does_not_reset(tmp_path: Path, robot: Path) -> None:
    """Only a person knows the pose of its arm."""
    line = Pty()
    text = robot.read_text().replace("boot_wait_s = 2.0", "boot_wait_s = 1.0")
    robot.write_text(
        text.replace('firmware = "stock"', 'firmware = "stock"\nreset_on_open = false')
    )
    result = doctor(tmp_path, "--open", "--port", line.port, "--robot", str(robot))
    line.vanish()
    os.close(line.slave)
    assert result.exit_code == 0
    said = lines(result)
    assert said["pose"] == "nothing resets the board: a run needs --pose"
    assert said["opening"] == "the board is not reset, and the arm stays where it is"
    assert "a board may be missing; the pose is unknown: a run needs --pose" in said["board"]


def test_a_port_of_another_armtree(tmp_path: Path) -> None:
    line = Pty()
    link = SerialLink(line.port, 115200)
    link.open()
    result = doctor(tmp_path, "--port", line.port)
    link.close()
    line.vanish()
    os.close(line.slave)
    assert result.exit_code == 9  # as for a run
    assert f"NO  ours alone  the program with process id {os.getpid()} uses it" in result.output


def test_a_wrong_robot_file(tmp_path: Path, robot: Path) -> None:
    robot.write_text(robot.read_text().replace('letter = "s"', 'letter = "ss"'))
    result = doctor(tmp_path, "--robot", str(robot))
    assert result.exit_code == 3  # as for a run
    assert f"NO  robot       {robot}:" in result.output
    assert "Serial ports:" in result.output


def test_recordings_that_cannot_be_written(tmp_path: Path) -> None:
    result = doctor(tmp_path, "--recordings", "/proc/nowhere")
    assert result.exit_code == 10
    assert "NO  recorder    /proc/nowhere: " in result.output


def test_a_board_that_does_not_start_is_reported_with_the_way_out_once(
    tmp_path: Path, robot: Path
) -> None:
    line = Pty()  # no program at the other end
    text = robot.read_text().replace('firmware = "stock"', 'firmware = "armtree"')
    robot.write_text(text.replace("boot_wait_s = 2.0", "boot_wait_s = 1.0"))
    result = doctor(tmp_path, "--open", "--port", line.port, "--robot", str(robot))
    line.vanish()
    os.close(line.slave)
    assert result.exit_code == 6
    assert "NO  board       Within 1 s, the board" in result.output
    assert "see the message" not in result.output


def test_a_report_has_all_of_it_in_one_file(tmp_path: Path) -> None:
    with bus(tmp_path, vanish(3)) as port:
        report = tmp_path / "report.json"
        options = ["--open", "--port", port, "--robot", str(tmp_path / "arm.toml")]
        options += ["--report", str(report), "--recordings", str(tmp_path)]
        result = doctor(tmp_path, *options)
    assert result.exit_code == 6, result.output
    assert "3 of 4 answer" in result.output
    written = json.loads(report.read_text())
    assert written["versions"]["armtree"]
    (servos,) = (each for each in written["checks"] if each["name"] == "servos")
    assert servos["code"] == "hw.servo_missing"
    assert [each["servo"] for each in servos["values"]] == [1, 2, 3]
    assert {"firmware", "voltage", "temperature", "kept"} <= servos["values"][0].keys()
