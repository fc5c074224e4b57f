"""`armtree pose`, as a user types it."""

import json
from pathlib import Path

import pytest

from tests.support.command_line.typed import typed as type_command
from tests.support.servers.serving import Served, Typed

pytest_plugins = ["tests.support.servers.server_fixtures"]


@pytest.fixture
def folder(tmp_path: Path, picked: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory without a server, and a recording of task 1 in `runs`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return picked.parent


@pytest.mark.slow
def test_a_pose_from_a_recording_to_a_task(folder: Path) -> None:
    status, out, error = type_command(folder, "pose", "save", "there")
    assert (status, error) == (0, "")
    assert out.startswith(
        "trees/arduinobot/poses.yaml\nthere        joint_1 -80.21 deg, joint_2 -34.38"
    )
    assert "runs/pick.mcap; the arm may have moved since then" in out
    assert out.endswith("without joint_4; --group all saves every joint\n")
    status, out, _ = type_command(folder, "pose", "save", "all", "--group", "all")
    assert (status, "without" in out) == (0, False)
    assert type_command(folder, "check", "--robot", "so101")[0] == 0
    rows = [
        json.loads(line) for line in type_command(folder, "pose", "ls", "--json")[1].splitlines()
    ]
    found = {row["pose"]: row["source"] for row in rows}
    assert found["there"] == "trees/arduinobot/poses.yaml:3"
    assert (found["folded"], found["home"]) == ("shipped", "home of the robot file")
    shown = type_command(folder, "pose", "show", "there")[1]
    assert "joint_1      -80.21 deg" in shown
    assert "mm\nfrom         trees/arduinobot/poses.yaml:3" in shown
    assert "there" in type_command(folder, "pose", "ls")[1]
    assert type_command(folder, "pose", "rm", "all")[0] == 0
    assert "all:" not in Path("trees/arduinobot/poses.yaml").read_text()


def test_a_pose_with_a_joint_of_another_robot(folder: Path) -> None:
    Path("trees").mkdir()
    Path("trees/poses.yaml").write_text("poses: {far: {elbow: 0.10471975511965978}}\n")
    listed = type_command(folder, "pose", "ls")[1]
    assert "far          elbow, which arduinobot does not have\n" in listed


@pytest.mark.parametrize(
    ("words", "status", "why"),
    [
        (["save", "folded"], 3, "pose folded is shipped; give another name"),
        (["save", "home"], 3, "pose home is the robot's own; give another name, or --replace"),
        (["save", "a b"], 3, "of a joint or a unit; did you mean a_b?"),
        (["save", "x", "--group", "grip"], 2, "there are all, arm, gripper; did you mean gripper?"),
        (["save", "x", "--server", "http://localhost:1"], 13, "no server answers"),
        (["save", "x", "--recordings", "none"], 13, "no recording in none holds a pose"),
        (["rm", "folded"], 3, "pose folded is shipped and cannot be removed"),
        (["show", "folde"], 3, "did you mean folded?"),
    ],
)
def test_what_is_wrong_is_one_line(folder: Path, words: list[str], status: int, why: str) -> None:
    Path("trees").mkdir()
    found, out, error = type_command(folder, "pose", *words)
    assert (found, out) == (status, "")
    assert why in error
    assert list(Path("trees").iterdir()) == []


@pytest.mark.slow
def test_the_pose_of_a_server(
    typed: tuple[Served, Typed], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    served, type_in = typed
    monkeypatch.chdir(tmp_path)
    status, _, error = type_in("pose", "save", "here")
    assert (status, "move it first [hw.not_active]" in error) == (6, True)
    served.executive.arm_to("activate")
    assert "joint_1 0 deg" in type_in("pose", "save", "here")[1]
