"""A recording stands alone: its robot, with its meshes, is restored without any other file."""

import shutil
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import zstandard
from mcap.reader import make_reader

from executive.recording import archive
from executive.recording.archive import extract_robot
from executive.replay.verification import verify
from executive.testing import SimulatedArm
from hardware import Robot, load_robot
from logs import LogError, Recording, RecordingError
from skills.motion.robot_model.robot_model import RobotModel
from tests.hardware.description.test_calibration import calibrate
from tests.support.arms.bus_arms import bus_arm
from tests.support.paths import DATA

TASK = """
task: 7
name: wave
description: Moves.
tree: {subtree: move_joints, with: {joints: {turn: 20 deg}}}
"""
SAY = "task: 8\nname: say\ndescription: Says.\ntree: {Say: {text: x}}\n"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """An arm with a mesh in two links, and one that is only drawn, in a folder of its own."""
    site = tmp_path / "site"
    (site / "data").mkdir(parents=True)
    urdf = (DATA / "six_axes.urdf").read_text()
    drawn = '<visual><geometry><mesh filename="shell.stl"/></geometry></visual></link>'
    (site / "data" / "six_axes.urdf").write_text(urdf.replace("</link>", drawn, 1))
    shutil.copy(DATA / "beam.stl", site / "data")
    (site / "data" / "shell.stl").write_bytes(b"only drawn")
    text = (DATA / "six_axes.toml").read_text()
    text = text.replace('urdf = "six_axes.urdf"', 'urdf = "data/six_axes.urdf"')
    (site / "six_axes.toml").write_text(text)
    (site / "7_wave.yaml").write_text(TASK)
    (site / "8_say.yaml").write_text(SAY)
    return site


def recorded(site: Path, task: int = 7) -> Path:
    """A recording of a task, made where the robot's files are no more."""
    kept = site.with_name("kept.mcap")
    with SimulatedArm(trees=site, robot=site / "six_axes.toml") as arm:
        outcome = arm.run(task)
        assert outcome.success, outcome.message
        shutil.copy(outcome.recording, kept)
    shutil.rmtree(site)
    return kept


@pytest.mark.slow
def test_it_is_verified_where_the_meshes_are_gone(site: Path) -> None:
    recording = recorded(site)
    verified = verify(recording)
    assert verified.holds, verified.text()
    names = Counter(name.partition("_")[2] for name in Recording(recording).files)
    assert (names["beam.stl"], names["shell.stl"]) == (1, 1)


@pytest.mark.slow
def test_meshes_are_compressed(site: Path) -> None:
    with open(recorded(site), "rb") as stream:
        files = {each.name: each for each in make_reader(stream).iter_attachments()}
    (name,) = (name for name in files if "beam.stl" in name)
    assert name.endswith("_beam.stl.zst")
    unpacked = zstandard.decompress(files[name].data)
    assert unpacked == (DATA / "beam.stl").read_bytes()


def test_a_run_without_a_motion_needs_no_meshes(site: Path) -> None:
    recording = recorded(site, 8)
    assert not any("beam" in name for name in Recording(recording).files)
    assert verify(recording).holds


@pytest.mark.slow
def test_its_robot_is_written_for_viewers_and_commands(site: Path, tmp_path: Path) -> None:
    files = extract_robot(Recording(recorded(site)), tmp_path / "out")
    names = [path.name.partition("_")[2] for path in files[2:]]
    assert sorted(names) == ["beam.stl", "shell.stl"]
    assert all(f'"{path.name}"' in files[1].read_text() for path in files[2:])
    assert RobotModel(load_robot(files[0])).exact


def test_a_file_with_another_content_is_not_overwritten(site: Path, tmp_path: Path) -> None:
    recording, out = Recording(recorded(site, 8)), tmp_path / "out"
    file, urdf = extract_robot(recording, out)
    assert extract_robot(recording, out) == [file, urdf]
    urdf.write_text("mine")
    file.unlink()
    with pytest.raises(
        LogError, match=r"six_axes\.urdf: exists .* is not overwritten; .*`-o FOLDER`"
    ):
        extract_robot(recording, out)
    assert urdf.read_text() == "mine"
    assert not file.exists()


@pytest.mark.slow
def test_meshes_that_are_only_drawn_are_left_out_first(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive, "MAX_MESHES", (site / "data" / "beam.stl").stat().st_size)
    recording = recorded(site)
    assert verify(recording).holds
    assert not any("shell" in name for name in Recording(recording).files)


@pytest.mark.slow
def test_meshes_that_are_too_large_are_not_attached_and_the_verification_says_so(
    site: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(archive, "MAX_MESHES", 10)
    recording = recorded(site)
    why = "the meshes of six_axes.urdf are not attached, because they have more than"
    assert why in caplog.text
    assert f"cannot be verified: {why}" in verify(recording).error
    with pytest.raises(RecordingError, match="not attached"):
        extract_robot(Recording(recording), site)


@pytest.mark.slow
def test_a_calibration_is_recorded_with_the_robot(tmp_path: Path) -> None:
    site = tmp_path / "site"
    site.mkdir()
    calibrate(bus_arm(site)).rename(site / "six_axes.calibration.toml")
    (site / "arm.toml").rename(site / "six_axes.toml")
    (site / "7_wave.yaml").write_text(TASK.replace("turn", "joint_1"))
    calibrated = load_robot(site / "six_axes.toml")
    recording = recorded(site)
    assert verify(recording).holds
    file, _, calibration = extract_robot(Recording(recording), tmp_path / "out")[:3]
    assert calibration.name == "six_axes.calibration.toml"
    assert load_robot(file).actuated == calibrated.actuated


@pytest.mark.slow
def test_threads_restore_it_at_the_same_time(site: Path) -> None:
    recording = Recording(recorded(site))

    def restore(_: int) -> Robot:
        archive._load.cache_clear()
        return archive.restore_robot(recording)

    with ThreadPoolExecutor(4) as threads:
        names = [robot.name for robot in threads.map(restore, range(60))]
    assert names == ["six_axes"] * 60
