"""A run beside a server of this machine."""

import subprocess
from pathlib import Path

import pytest

from executive.api.outcome import GoalState, Outcome, cause_of
from executive.cli.support.run_tasks import without_server
from hardware.errors import PortBusy, PortLost
from tests.support.arms.bus_arms import so101_file
from tests.support.command_line.pseudo_terminal import ARMTREE
from tests.support.command_line.typed import typed
from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]

OTHER = "task: 11\nname: other\ndescription: Do nothing.\ntree:\n  Succeed: {}\n"


def test_a_run_on_the_arm_of_a_server_offers_to_send(serve: Serve, tmp_path: Path) -> None:
    """The unknown parameter ends the other runs before the board boots."""
    served, mine = serve(active=False), tmp_path / "mine"
    mine.mkdir()
    (mine / "11_other.yaml").write_text(OTHER)

    def refusal(*words: str) -> str:
        return typed(tmp_path, "run", *words, "--set", "x=1")[2]

    url, trees = served.server.url, ("--trees", str(served.tasks))
    own = "to run on a virtual arm instead, add --port virtual [usage]\n"
    held = "Error: an armtree server has the arm"
    assert refusal("11", *trees) == (
        f"{held}; give armtree send 11 --wait --set x=1 --server {url}; {own}"
    )
    without = f"{held}, but not this task; end it, or make it serve this task: {url}; {own}"
    assert refusal("99", *trees) == refusal("11", "--trees", str(mine)) == without
    assert refusal("11", *trees, "--port", "virtual") == ""
    assert refusal("1", "--robot", "so101") == ""


def test_a_task_with_mistakes_leaves_no_recording(tmp_path: Path) -> None:
    (tmp_path / "11_other.yaml").write_text(OTHER.replace("Succeed", "Sucked"))
    status, out, _ = typed(tmp_path, "run", "11", "--trees", str(tmp_path), "--port", "virtual")
    assert status == 3
    assert "did you mean Succeed?" in out
    assert not list(tmp_path.glob("*.mcap"))


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("-v",)])
def test_a_servo_near_its_limits_is_warned_of(tmp_path: Path, options: tuple[str, ...]) -> None:
    """With -v, the log has the line already. A process of its own has the priority of a run."""
    robot = so101_file(tmp_path)
    robot.write_text(f"{robot.read_text()}\n[guards]\nwarn_v = 13\n")
    words = ["run", "rest", "--robot", str(robot), "--port", "virtual", *options]
    ran = subprocess.run(
        [*ARMTREE, *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    line = "The servo of gripper has 12.0 V; the arm stops below 4.4 V"
    assert ran.returncode == 0, ran.stdout
    assert (ran.stdout + ran.stderr).count(line) == 1
    assert (f"warning: {line}" in ran.stdout) is not bool(options)


def test_an_arm_without_a_server_is_not_to_be_activated() -> None:
    lost = Outcome.of(1, GoalState.ABORTED, cause_of(PortLost("/dev/ttyX", "unplugged")))
    cause = without_server(lost).cause
    assert cause
    assert cause.hint == "check the cable, then run again"
    jogged = without_server(lost, "move again").cause
    assert jogged
    assert jogged.hint == "check the cable, then move again"
    other = Outcome.of(1, GoalState.ABORTED, cause_of(PortBusy("/dev/ttyX", 1)))
    assert without_server(other) == other
