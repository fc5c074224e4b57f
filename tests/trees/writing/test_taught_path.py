"""Paths that were taught by hand are kept as few points, near to all samples."""

import math
import random
from itertools import pairwise
from pathlib import Path

import pytest

from executive.testing import SimulatedArm
from hardware import Robot, load_robot
from hardware.errors import PoseOutsideLimits
from trees.check import check
from trees.writing.taught_path import JOINT_TOLERANCE, TOOL_TOLERANCE, Sample, simplify, split
from trees.writing.taught_task import TaughtTask

ARM = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
TICK = math.tau / 4096


@pytest.fixture(scope="module")
def so101() -> Robot:
    return load_robot(Path("so101"))


def pose(gripper: float = 0.0, **joints: float) -> dict[str, float]:
    return dict.fromkeys(ARM, 0.0) | joints | {"gripper": gripper}


def swing(count: int, gripper_from: int = 10**6) -> list[Sample]:
    """A swing to the left and up, as servos measure it; the gripper opens at a sample."""
    dice, samples = random.Random(1), list[Sample]()
    for k in range(count):
        share = 0.5 - 0.5 * math.cos(math.pi * k / (count - 1))
        opened = min(max(k - gripper_from, 0) / 20, 1.0)
        path = pose(opened, shoulder_pan=share, shoulder_lift=-0.4 * math.sin(3 * share))
        samples.append(
            {n: TICK * round(q / TICK + dice.uniform(-0.6, 0.6)) for n, q in path.items()}
        )
    return samples


def nearest(robot: Robot, sample: Sample, waypoints: list[Sample]) -> tuple[float, float]:
    """The least distances of a sample from the lines between waypoints [rad], [m]."""
    tool, found = robot.tool_position(sample), []
    assert tool
    for a, b in pairwise(waypoints):
        for part in range(101):
            there = {name: a[name] + part / 100 * (b[name] - a[name]) for name in a}
            apart = max(abs(there[name] - sample[name]) for name in ARM)
            reached = robot.tool_position(there)
            assert reached
            found.append((apart, math.dist(tool, reached)))
    return min(each[0] for each in found), min(each[1] for each in found)


@pytest.mark.slow
def test_a_path_becomes_few_points_within_the_tolerances(so101: Robot) -> None:
    samples = swing(150)
    waypoints = simplify(so101, samples, ARM)
    assert 4 <= len(waypoints) <= 20
    assert (waypoints[0], waypoints[-1]) == (samples[0], samples[-1])
    for sample in samples[::5]:
        joints, tool = nearest(so101, sample, waypoints)
        assert joints <= JOINT_TOLERANCE["rad"]
        assert tool <= TOOL_TOLERANCE + 1e-4


def test_an_arm_that_rests_has_two_points(so101: Robot) -> None:
    assert len(simplify(so101, [pose()] * 100, ARM)) == 2
    assert len(simplify(so101, [pose()], ARM)) == 1


def test_a_path_is_divided_where_the_gripper_moves(so101: Robot) -> None:
    samples = swing(150, gripper_from=60)
    first, second = split(so101, samples, ["gripper"])
    assert 60 < len(first[0]) < 70
    assert first[1]["gripper"] == pytest.approx(1.0, abs=0.02)
    assert [*first[0], *second[0][1:]] == samples
    assert second[1] == first[1]


@pytest.mark.slow
def test_a_path_is_a_step_of_a_task_that_runs(so101: Robot, tmp_path: Path) -> None:
    task = TaughtTask(so101, tmp_path, 5, "swing")
    samples = swing(150, gripper_from=60)
    step = task.follow(samples)
    assert step
    assert step.words.startswith("path of ")
    assert task.follow([samples[-1]] * 50) is None
    assert task.follow([]) is None
    assert check(so101, tmp_path).mistakes == []
    with SimulatedArm(tmp_path, robot=Path("so101")) as arm:
        outcome = arm.run("swing")
        assert outcome.success, outcome.text()


@pytest.mark.parametrize("way", ["a pose", "a path"])
def test_what_is_outside_the_limits_is_not_taken(so101: Robot, tmp_path: Path, way: str) -> None:
    """The limits of shoulder_lift are 100 deg; up to 3 deg more is its stop."""
    task = TaughtTask(so101, tmp_path, 5, "fetch")
    near, far = pose(shoulder_lift=math.radians(102)), pose(shoulder_lift=math.radians(163))
    assert task.move(near)
    assert "shoulder_lift: 100 deg" in task.path.read_text()
    why = r"shoulder_lift is at 163\.0 deg.* end at 100\.0 deg.* turn the joint inwards by"
    with pytest.raises(PoseOutsideLimits, match=why):
        task.move(far) if way == "a pose" else task.follow([near, far, pose()])
    assert len(task.steps) == 1
