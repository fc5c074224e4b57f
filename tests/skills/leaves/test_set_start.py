"""A motion starts at the last commanded position."""

from py_trees.common import Status

from skills.leaves.set_start import SetStart
from tests.conftest import Bench


def test_the_boot_pose(bench: Bench) -> None:
    skill = bench.skill(SetStart)
    skill.tick_once()
    assert skill.status is Status.SUCCESS
    names = [joint.name for joint in bench.robot.actuated]
    assert bench.output("start") == dict(zip(names, bench.robot.boot_pose, strict=True))
    assert "joint_1 0.0 deg" in skill.feedback_message


def test_an_arm_that_is_not_active(bench: Bench) -> None:
    skill = bench.skill(SetStart)
    bench.arm.deactivate()
    skill.tick_once()
    assert skill.status is Status.FAILURE
    assert skill.failure.code == "hw.not_active"
