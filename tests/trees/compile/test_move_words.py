"""Units of the positions of joints that slide or turn."""

from pathlib import Path

import pytest

from hardware import Robot, load_robot
from tests.support.generated.wrong_tasks import TASK
from tests.support.paths import DATA
from trees.check import check

SLIDING = [
    ("20 mm", ""),
    ("0.02 m", ""),
    ("0.02", ""),
    ("20", "did you mean 20 mm?"),
    ("20 deg", "'20 deg': no unit deg; there are cm, m, mm"),
]


@pytest.mark.parametrize("place", ["task", "pose"])
def test_a_joint_that_slides_has_a_length(tmp_path: Path, place: str) -> None:
    robot = load_robot(DATA / "seven_axes.toml")
    (finger,) = (joint.name for joint in robot.actuated if joint.unit == "m")
    for number, (written, said) in enumerate(SLIDING):
        folder, target = tmp_path / str(number) / robot.name, f"{{{finger}: {written}}}"
        folder.mkdir(parents=True)
        pose = f"poses:\n  half: {target if place == 'pose' else f'{{{finger}: 10 mm}}'}\n"
        (folder / "poses.yaml").write_text(pose)
        node = f"subtree: move_joints\n  with: {{joints: {'half' if place == 'pose' else target}}}"
        text = f"task: 20\nname: m\ndescription: x\ntree:\n  {node}\n"
        (folder / "20_m.yaml").write_text(text)
        mistakes = check(robot, folder.parent).mistakes
        assert bool(mistakes) == bool(said), (written, mistakes)
        assert said in "".join(map(str, mistakes))


def test_a_joint_that_turns_has_no_length(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "20_m.yaml").write_text(TASK.replace("20 deg", "20 mm"))
    (mistake,) = check(robot, None, [tmp_path / "20_m.yaml"]).mistakes
    assert mistake.message == "joints: '20 mm': no unit mm; there are deg, rad"
