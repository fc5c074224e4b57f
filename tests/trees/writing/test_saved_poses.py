"""Poses that are saved and removed keep the rest of their file, byte by byte."""

import dataclasses
import os
import re
from math import radians
from pathlib import Path

import pytest

from hardware import Robot, load_robot
from tests.support.paths import DATA, TASKS
from trees import FileError, Library
from trees.writing.saved_poses import pose_text, remove_pose, save_pose

LEFT = {"joint_1": radians(70.0), "joint_2": 0.0, "joint_3": -0.25}
WRITTEN = "left: {joint_1: 70 deg, joint_2: 0 deg, joint_3: -14.32 deg}"

BLOCK = """\
# Mine.

poses:   # by hand
    # near
    near: {joint_1: 0.1}   # [rad]

    far:
        joint_1: 1   # far
        joint_2: 0.2
    # the end
# replaced
replaces:
    - open
"""
FLOW = "poses: {near: {joint_1: 0.1}, far: {joint_1: 1, joint_2: 0.2}, open: {joint_4: -0.1}}\n"
FLOW += "replaces: [open]"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    text = BLOCK.replace("    # the end", "    open: {joint_4: -0.1}\n    # the end")
    (path := own(tmp_path)).write_text(text)
    return path


def own(folder: Path) -> Path:
    """Return the file of poses of the robot, in a folder that exists."""
    (folder / "arduinobot").mkdir()
    return folder / "arduinobot" / "poses.yaml"


def poses(folder: Path) -> dict[str, dict[str, float]]:
    return {name: dict(pose) for name, pose in Library(folder).poses()[0].items()}


def test_the_first_pose_makes_the_file(robot: Robot, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "trees"
    path = save_pose(robot, folder, "left", LEFT)
    assert path == folder / "arduinobot" / "poses.yaml"
    assert path.read_text().splitlines()[1:] == ["poses:", f"  {WRITTEN}"]
    assert poses(folder)["left"] == pytest.approx(LEFT, abs=1e-4)
    assert os.listdir(folder) == ["arduinobot"]


def test_another_pose_is_one_more_line(robot: Robot, file: Path) -> None:
    before = file.read_text()
    save_pose(robot, file.parent.parent, "left", LEFT)
    assert file.read_text() == before.replace("    # the end", f"    {WRITTEN}\n    # the end")
    remove_pose(robot, file.parent.parent, "left")
    assert file.read_text() == before


def test_a_pose_is_replaced_where_it_is(robot: Robot, file: Path) -> None:
    before, pose = file.read_text(), WRITTEN.removeprefix("left: ")
    save_pose(robot, file.parent.parent, "near", LEFT, replace=True)
    assert file.read_text() == before.replace("{joint_1: 0.1}", pose)
    save_pose(robot, file.parent.parent, "far", LEFT, replace=True)
    assert f"    far: {pose}\n    open:" in file.read_text()
    assert set(poses(file.parent.parent)) >= {"near", "far", "open", "upright"}


def test_removed_poses_leave_the_comments(robot: Robot, file: Path) -> None:
    before = file.read_text()
    remove_pose(robot, file.parent.parent, "near")
    assert file.read_text() == before.replace("    near: {joint_1: 0.1}   # [rad]\n", "")
    remove_pose(robot, file.parent.parent, "open")
    assert "replaces:" not in file.read_text()
    assert poses(file.parent.parent)["open"] == {"joint_4": -0.7}
    remove_pose(robot, file.parent.parent, "far")
    assert "poses: {}" in file.read_text()
    save_pose(robot, file.parent.parent, "left", LEFT)
    assert f"poses:\n  {WRITTEN}" in file.read_text()
    assert "# replaced" in file.read_text()


def test_poses_in_one_line(robot: Robot, tmp_path: Path) -> None:
    (path := own(tmp_path)).write_text(FLOW)
    save_pose(robot, tmp_path, "left", LEFT)
    assert path.read_text() == FLOW.replace("-0.1}}", f"-0.1}}, {WRITTEN}}}")
    remove_pose(robot, tmp_path, "near")
    remove_pose(robot, tmp_path, "left")
    assert path.read_text() == FLOW.replace("near: {joint_1: 0.1}, ", "")


def test_a_shipped_pose_is_replaced_in_the_file_of_the_user(robot: Robot, tmp_path: Path) -> None:
    shipped = [path.read_text() for path in TASKS.rglob("poses.yaml")]
    with pytest.raises(FileError, match="pose folded is shipped; give another name"):
        save_pose(robot, tmp_path, "folded", LEFT)
    assert os.listdir(tmp_path) == []
    path = save_pose(robot, tmp_path, "folded", LEFT, replace=True)
    save_pose(robot, tmp_path, "right", LEFT, replace=True)
    assert path.read_text().splitlines()[-1] == "replaces: [folded, right]"
    assert poses(tmp_path)["folded"]["joint_1"] == pytest.approx(radians(70.0))
    remove_pose(robot, tmp_path, "folded")
    assert path.read_text().splitlines()[-1] == "replaces: [right]"
    with pytest.raises(FileError, match="pose folded is shipped and cannot be removed"):
        remove_pose(robot, tmp_path, "folded")
    assert [path.read_text() for path in TASKS.rglob("poses.yaml")] == shipped


def test_poses_of_another_robot_are_in_its_folder(robot: Robot, tmp_path: Path) -> None:
    other = dataclasses.replace(robot, name="other")
    path = save_pose(other, tmp_path, "left", LEFT)
    assert path == tmp_path / "other" / "poses.yaml"
    assert "left" in Library(tmp_path, "other").poses()[0]
    assert "left" not in poses(tmp_path)


def test_a_position_at_a_limit_stays_within_it(robot: Robot, tmp_path: Path) -> None:
    limits = {joint.name: joint.upper for joint in robot.actuated}
    save_pose(robot, tmp_path, "edge", limits)
    for name, q in poses(tmp_path)["edge"].items():
        assert q <= limits[name]
        assert q == pytest.approx(limits[name], abs=1e-4)


def test_positions_are_written_for_people(tmp_path: Path) -> None:
    robot = load_robot(DATA / "seven_axes.toml")
    finger = next(joint for joint in robot.actuated if joint.unit == "m")
    names = [joint.name for joint in robot.actuated_in("arm")][:2]
    positions = {names[0]: -3.8e-18, names[1]: radians(0.024723), finger.name: 0.0152500001}
    assert pose_text(robot, positions) == (
        f"{{{names[0]}: 0 deg, {names[1]}: 0.02 deg, {finger.name}: 15.25 mm}}"
    )
    assert pose_text(robot, {names[0]: -2.9}) == f"{{{names[0]}: -2.9}}"  # -166.158 deg


@pytest.mark.parametrize("name", ["", "2nd", "a b", "a/b", "joint_1", "deg", "ä", "-x"])
def test_a_bad_name_is_refused(robot: Robot, tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError, match=re.escape(f"{name!r} cannot be the name of a pose")):
        save_pose(robot, tmp_path / "trees", name, LEFT)
    assert os.listdir(tmp_path) == []


def test_what_is_wrong_changes_nothing(robot: Robot, file: Path) -> None:
    before = file.read_text()
    with pytest.raises(FileError, match="has a pose near already; give --replace"):
        save_pose(robot, file.parent.parent, "near", LEFT)
    with pytest.raises(FileError, match=r"no pose nea is here; there are .*did you mean near"):
        remove_pose(robot, file.parent.parent, "nea")
    assert file.read_text() == before
    file.write_text(wrong := before.replace("far:", "far: 1\n    bad:"))
    with pytest.raises(FileError, match="far"):
        save_pose(robot, file.parent.parent, "left", LEFT)
    assert file.read_text() == wrong
    file.write_text(json := '{"poses": {"near": {"joint_1": 0.1}}}')
    with pytest.raises(FileError, match="edit the file by hand"):
        save_pose(robot, file.parent.parent, "folded", LEFT, replace=True)
    assert file.read_text() == json


def test_a_folder_that_cannot_be_written(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="cannot be created"):
        save_pose(robot, tmp_path / "file", "left", LEFT)
