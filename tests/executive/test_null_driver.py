"""What a robot file without a driver is good for on the command line, and what it refuses."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.main import cli
from executive.replay.verification import verify
from executive.testing import SimulatedArm
from hardware import NoDriver
from tests.support.paths import DATA

ARM = str(DATA / "seven_axes.toml")
TASK = """
task: 7
name: wave
description: Moves.
tree:
  subtree: reach
  with:
    arm: {axis_1: 1, axis_2: 0, axis_3: 0, axis_4: -90 deg, axis_5: 0, axis_6: 0, axis_7: 0}
    gripper: {finger_1: 0.02}
"""


@pytest.fixture
def trees(tmp_path: Path) -> Path:
    (tmp_path / "7_wave.yaml").write_text(TASK)
    return tmp_path


def test_check_and_show(trees: Path) -> None:
    checked = CliRunner().invoke(cli, ["check", str(trees / "7_wave.yaml"), "--robot", ARM])
    assert checked.output == "1 file is right\n"
    shown = CliRunner().invoke(cli, ["show", "7", "--trees", str(trees), "--robot", ARM])
    assert "PlanArm" in shown.output


@pytest.mark.slow
def test_plan(trees: Path) -> None:
    arguments = ["7", "--trees", str(trees), "--robot", ARM, "-o", str(trees / "plan.png")]
    result = CliRunner().invoke(cli, ["plan", *arguments])
    assert result.exit_code == 0, result.exception
    assert (trees / "plan.png").exists()
    arguments = ["finger_1=0.02", "--robot", ARM, "-o", str(trees / "plan.png")]
    result = CliRunner().invoke(cli, ["plan", *arguments])
    assert "the acceleration limit of finger_1, 2000 mm/s²:" in result.output
    assert "rad" not in result.output
    result = CliRunner().invoke(cli, ["plan", "finger_1=1", *arguments[1:]])
    assert "finger_1 = 1000 mm is outside its limits, 0 mm to 40 mm" in str(result.exception)


@pytest.mark.slow
def test_it_moves_on_the_virtual_port_and_the_recording_proves_it(trees: Path) -> None:
    with SimulatedArm(trees=trees, robot=Path(ARM)) as arm:
        outcome = arm.run(7)
        assert outcome.success, outcome.message
        assert arm.frames[-1].startswith("+001000000,+000000000,+000000000,-001570796,")
        verified = verify(Path(outcome.recording))
    assert verified.holds, verified.text()


@pytest.mark.slow
def test_run_says_that_nothing_real_moves(trees: Path) -> None:
    folders = ("--trees", str(trees), "--recordings", str(trees / "recordings"))
    result = CliRunner().invoke(cli, ["run", "7", "--robot", ARM, *folders])
    assert result.exit_code == 0, result.output
    assert "Port virtual: the robot file names no driver; nothing real moves" in result.output


@pytest.mark.parametrize("command", [["run", "7"], ["serve"]], ids=["run", "serve"])
def test_a_real_port_is_refused(trees: Path, command: list[str]) -> None:
    folders = ("--trees", str(trees), "--recordings", str(trees / "recordings"))
    arguments = [*command, "--robot", ARM, *folders, "--port", "/dev/ttyACM0"]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == NoDriver.exit_status or isinstance(result.exception, NoDriver)
    words = f"{result.output}{result.exception}"
    assert "names no driver, so nothing can be sent to the port /dev/ttyACM0" in words


@pytest.mark.slow
def test_doctor_says_so(trees: Path) -> None:
    arguments = ["doctor", "--robot", ARM, "--recordings", str(trees)]
    result = CliRunner().invoke(cli, arguments)
    assert "?   driver      no driver is named" in result.output
    assert "ok  port        virtual: nothing real moves" in result.output
    result = CliRunner().invoke(cli, [*arguments, "--port", "/dev/ttyACM0"])
    assert "NO  port" in result.output


@pytest.mark.slow
def test_what_turns_without_end_is_moved_as_the_skill_does(tmp_path: Path) -> None:
    arm = ("--robot", str(DATA / "endless.toml"), "-o", str(tmp_path / "plan.png"))
    result = CliRunner().invoke(cli, ["plan", "turn=-170deg", "--start", "turn=3", *arm])
    assert "Goal      turn 190 deg" in result.output
    result = CliRunner().invoke(cli, ["plan", "turn+=200deg", *arm])
    assert "more than half a turn" in str(result.exception)
