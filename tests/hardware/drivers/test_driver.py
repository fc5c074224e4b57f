"""A driver of another package: the example of the documentation, by its text alone."""

import csv
import dataclasses
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hardware import DescriptionError, Robot, load_robot
from hardware.drivers.arduino.serial_servo import SerialServo
from tests.support.paths import ROOT

_FILE = re.compile(r"^`([\w./]+)`[^\n]*:\n\n```\w+\n(.*?)^```$", re.M | re.S)


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the page shows, and its package installed in `site`."""
    folder = tmp_path_factory.mktemp("tick_bus")
    page = (ROOT / "docs/pages/how_to/own_driver.md").read_text()
    for name, text in _FILE.findall(page):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    options = "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target", "site"
    subprocess.run([sys.executable, "-m", "pip", "install", *options, "."], cwd=folder, check=True)
    return folder


@pytest.fixture
def robot(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Robot:
    """The robot of the example, in a folder of its own."""
    monkeypatch.syspath_prepend(str(package / "site"))
    for name in ("arm.toml", "arm.urdf"):
        (tmp_path / name).write_bytes((package / name).read_bytes())
    return load_robot(tmp_path / "arm.toml")


def ran(package: Path, *words: str) -> str:
    """Runs a Python program as a third party would, and returns its output."""
    paths = os.pathsep.join([str(package / "site"), str(ROOT)])
    environment = {**os.environ, "PYTHONPATH": paths}
    command = [sys.executable, "-m", *words]
    pipe = subprocess.PIPE
    done = subprocess.run(
        command, cwd=package, env=environment, stdout=pipe, stderr=subprocess.STDOUT, check=False
    )
    text = done.stdout.decode()
    assert done.returncode == 0, text
    return text


@pytest.mark.slow
def test_the_example_keeps_the_contract(package: Path) -> None:
    assert re.search(r"\b14 passed", ran(package, "pytest", "-p", "no:cacheprovider"))


@pytest.mark.slow
def test_the_example_runs_a_task_whose_recording_verifies(package: Path) -> None:
    options = "--robot", "arm.toml", "--trees", "."
    assert "the board reports the pose" in ran(package, "armtree", "doctor", "--open", *options)
    said = ran(package, "armtree", "run", "look", *options)
    assert "the virtual board, firmware ticks" in said
    assert "SUCCEEDED" in said
    (recording,) = (package / "recordings").glob("*.mcap")
    assert "holds" in ran(package, "armtree", "replay", "--verify", str(recording))
    ran(package, "armtree", "log", "export", str(recording))
    with (package / f"{recording.stem}.frames.csv").open() as file:
        frames = [row["frame"] for row in csv.DictReader(file)]
    assert len(frames) > 50
    assert all(re.fullmatch("0xa5 02( [0-9a-f]{2}){5}", frame) for frame in frames)


@pytest.mark.slow
def test_a_driver_reads_its_own_keys(robot: Robot) -> None:
    text = robot.path.read_text().replace("sign = -1", "sign = 3")
    robot.path.write_text(text)
    with pytest.raises(DescriptionError, match=r"tilt.wire.sign: 3 is not one of -1, 1"):
        load_robot(robot.path)


@pytest.mark.slow
def test_a_board_that_does_not_reset_cannot_be_told_to(robot: Robot) -> None:
    text = robot.path.read_text().replace("[groups]", "reset_on_open = true\n[groups]", 1)
    robot.path.write_text(text)
    why = "reset_on_open: true is not allowed: opening the port does not reset a board with ticks"
    with pytest.raises(DescriptionError, match=why):
        load_robot(robot.path)


def test_an_unknown_driver_gets_a_list_of_the_installed_ones(robot: Robot) -> None:
    robot.path.write_text(robot.path.read_text().replace('"tick_bus"', '"tik_bus"'))
    why = r"arm.toml:2: driver: 'tik_bus' is not one of .*serial_servo.*tick_bus|tick_bus, serial"
    with pytest.raises(DescriptionError, match=why):
        load_robot(robot.path)


def test_a_driver_that_cannot_be_loaded_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_driver.py").write_text("import no_such_module_of_anybody")
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[armtree.hardware]\nbroken = broken_driver:Broken\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    shipped = load_robot()
    path = tmp_path / "robot.toml"
    path.write_text(shipped.path.read_text().replace('"serial_servo"', '"broken"'))
    (tmp_path / shipped.urdf.name).write_bytes(shipped.urdf.read_bytes())
    why = "driver: broken cannot be loaded from broken_driver:Broken: ModuleNotFoundError"
    with pytest.raises(DescriptionError, match=why):
        load_robot(path)


def test_robots_of_one_file_are_equal() -> None:
    assert load_robot() == load_robot()
    assert dataclasses.replace(load_robot()).driver == SerialServo()
