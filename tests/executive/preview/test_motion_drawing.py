"""`armtree log plot` draws the bodies around the arm, and the arm among them."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import logs
from executive.cli.main import cli
from executive.preview.motion_drawing import POSES, motion_drawing, scenes_of
from hardware import Robot
from logs.views.motion_figure import MotionDrawing
from logs.views.run_figure import MotionScene
from skills.motion import Body, Box, World
from tests.conftest import RigMaker
from tests.logs.test_run import RUNS, record
from tests.support.arms.cube_mesh import cube
from tests.support.paths import DATA

BEAM = DATA / "beam.stl"
TASK = """
task: 7
name: carry
description: A ball is carried round a post.
tree:
  sequence:
    - AddBox: {body: post, size: [3 cm, 3 cm, 30 cm], position: [0.115, 0.115, 0.15]}
    - AddMesh: {body: beam, file: BEAM, position: [0.5, 0, 0], touches: [floor]}
    - AddSphere: {body: ball, radius: 1 cm, position: [-0.1, 0.15, 0.3]}
    - subtree: reach
      with: {arm: {joint_1: 0.3, joint_2: -0.6, joint_3: 0}, gripper: closed}
    - subtree: reach
      with: {arm: {joint_1: 0.3, joint_2: -0.5, joint_3: 0}, gripper: closed}
    - Attach: {body: ball, link: claw_support}
    - subtree: reach
      with: {arm: right, gripper: closed}
"""
HIT = """
task: 7
name: hit
description: A wall is put where the arm stands.
tree:
  sequence:
    - AddBox: {body: wall, size: [0.3, 0.02, 0.3], position: [0, 0.15, 0.15]}
    - subtree: reach
      with: {arm: right, gripper: closed}
"""


def test_a_room_is_an_outline_around_the_arm(robot: Robot, tmp_path: Path) -> None:
    walls = Body("room", cube(tmp_path, (1.0, -0.99)))
    post = Body("post", Box((0.03, 0.03, 0.2)), (0.115, 0.115, 0.1))
    drawing = motion_drawing(robot, World((walls, post)), [robot.boot_pose])
    assert (len(drawing.bodies), len(drawing.hollow)) == (1, 1)
    assert np.abs(drawing.hollow[0]).max() == pytest.approx(1.0)


def recorded(rig: RigMaker, folder: Path, text: str) -> Path:
    """Return the recording of a task."""
    name = text.split("name: ")[1].split("\n")[0]
    (folder / f"7_{name}.yaml").write_text(text.replace("BEAM", str(BEAM)))
    (outcome,) = rig(tasks=folder).run(7)
    assert outcome.recording
    return Path(outcome.recording)


def middles(shapes: Any) -> list[list[float]]:
    """Return the centres of the bounding boxes of shapes [m]."""
    ends = [(np.min(shape, axis=0), np.max(shape, axis=0)) for shape in shapes]
    return [np.round((low + high) / 2, 3).tolist() for low, high in ends]


def height(picture: Path) -> int:
    with Image.open(picture) as opened:
        return int(opened.height)


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use drawings with a low resolution, which take less time."""
    monkeypatch.setattr("logs.views.run_figure._DPI", 50)


def plotted(recording: Path) -> Any:
    return CliRunner().invoke(cli, ["log", "plot", str(recording)])


@pytest.mark.slow
def test_motions_are_drawn_world_by_world(rig: RigMaker, tmp_path: Path) -> None:
    recording = recorded(rig, tmp_path, TASK)
    stood, held = scenes_of(recording)
    assert stood.title == "Motions 1, 2; bodies in the world: post, beam, ball"
    assert held.title == "Motion 3; bodies in the world: post, beam, ball on claw_support"
    assert POSES < len(stood.motion.poses) < 2 * POSES  # the second motion has a few frames only
    assert len(held.motion.poses) == POSES
    post, beam, ball = middles(stood.motion.bodies)
    assert (post, ball) == ([0.115, 0.115, 0.15], [-0.1, 0.15, 0.3])
    assert middles(held.motion.bodies) == [post, beam]
    assert not any(stood.motion.held)
    first, last = (middles(held.motion.held[at])[0] for at in (0, -1))
    assert first == pytest.approx(ball, abs=0.005)  # frames are in whole degrees
    assert last[0] > 0.1
    assert plotted(recording).exit_code == 0
    with_scenes = height(recording.with_suffix(".png"))
    logs.plot(recording, tmp_path / "bare.png")
    assert with_scenes == height(tmp_path / "bare.png") + 2 * 150  # 3 in at 50 dpi


def test_an_arm_that_could_not_move_is_drawn_where_it_stood(rig: RigMaker, tmp_path: Path) -> None:
    recording = recorded(rig, tmp_path, HIT)
    (scene,) = scenes_of(recording)
    assert len(scene.motion.poses) == 1
    assert plotted(recording).exit_code == 0


def test_a_run_without_bodies_has_no_scenes(rig: RigMaker, tmp_path: Path) -> None:
    (outcome,) = rig().run(1)
    assert scenes_of(Path(outcome.recording)) == []


def test_bodies_that_cannot_be_drawn_are_reported(tmp_path: Path) -> None:
    ball = {"name": "ball", "sphere": {"radius": 0.1}, "position": [1, 1, 1], "link": ""}
    among = [
        dataclasses.replace(item, world=(ball,)) if isinstance(item, logs.Plan) else item
        for item in RUNS["ok"]
    ]
    record(tmp_path / "run.mcap", among)
    result = plotted(tmp_path / "run.mcap")
    assert result.exit_code == 0, result.exception
    assert "the bodies around the arm are not drawn" in result.stderr
    assert "its robot is unknown" in result.stderr
    assert height(tmp_path / "run.png") > 100


@pytest.mark.slow
def test_a_picture_of_many_worlds_ends_somewhere(tmp_path: Path) -> None:
    record(tmp_path / "run.mcap", RUNS["ok"])
    shape = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.1], [0.1, 0.1, 0.0]]
    scenes = [MotionScene(f"Motion {n}", MotionDrawing([[shape]], [shape])) for n in range(1, 31)]
    logs.plot(tmp_path / "run.mcap", tmp_path / "bare.png")
    logs.plot(tmp_path / "run.mcap", tmp_path / "run.png", scenes)
    assert height(tmp_path / "run.png") == height(tmp_path / "bare.png") + 12 * 150


def test_the_story_tells_what_is_around(rig: RigMaker, tmp_path: Path) -> None:
    reported = CliRunner().invoke(cli, ["log", "show", str(recorded(rig, tmp_path, TASK))]).output
    assert "; bodies: post, beam, ball\n" in reported
    assert "; bodies: post, beam, ball on claw_support\n" in reported
