"""The state of the joints, for the bridges to ROS."""

import dataclasses
from pathlib import Path

import pytest

import logs
from executive.api.events import Where
from executive.api.joint_state import JointState
from hardware import Measurement, Robot, State, load_robot
from hardware.joints import Mimic

JOINTS = ("joint_1", "joint_2", "joint_3", "joint_4")
SENT = logs.Sent(0.0, b"", 0.0, False, JOINTS, (0.1, 0.2, 0.3, -0.4))
MEASURED = logs.Measured(
    0.0, JOINTS, (0.1, 0.2, 0.3, -0.4), (1.0, 2.0, 3.0, 4.0), (0.5, 0.6, 0.7, 0.8), *[()] * 4
)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def test_a_board_that_measures_shows_nothing_commanded(robot: Robot) -> None:
    commanded = dict(zip(JOINTS, SENT.positions, strict=True))
    where = Where.of(robot, State.ACTIVE, commanded)
    for report in (SENT, where):
        assert JointState.of(report, measures=False) == JointState(False, commanded)
        assert JointState.of(report, measures=True) is None
    setting = dataclasses.replace(SENT, joints=(), positions=())
    assert JointState.of(setting, measures=False) is None


def test_what_is_measured_is_the_same_in_an_event_and_in_the_position_of_the_arm(
    robot: Robot,
) -> None:
    values = MEASURED.position, MEASURED.velocity, MEASURED.effort
    found = JointState.of(MEASURED, measures=True)
    assert found == JointState(True, *(dict(zip(JOINTS, row, strict=True)) for row in values))
    commanded = dict.fromkeys(JOINTS, 0.0)
    where = Where.of(robot, State.ACTIVE, commanded, Measurement(*values, (), ()))
    assert JointState.of(where, measures=True) == found
    assert found.frame_id == "measured"
    only = JointState.of(dataclasses.replace(MEASURED, velocity=(), effort=()), measures=True)
    assert only
    assert (only.velocity, only.effort) == ({}, {})


def test_a_mimic_joint_moves_with_its_leader_and_its_effort_is_unknown(robot: Robot) -> None:
    state = JointState.of(MEASURED, measures=True)
    assert state
    (mimic,) = [joint for joint in robot.joints if joint.mimic]
    assert isinstance(mimic.mimic, Mimic)
    whole = state.of_all_joints(robot)
    names = [joint.name for joint in robot.joints]
    assert [*whole.position] == [*whole.velocity] == names
    assert whole.position[mimic.name] == mimic.mimic.value(state.position[mimic.mimic.leader])
    assert whole.velocity[mimic.name] == mimic.mimic.multiplier * 4.0
    assert whole.effort == {}

    bus = load_robot(Path("so101"))  # no joint mimics another one
    names = [joint.name for joint in bus.actuated]
    rows = (dict.fromkeys(reversed(names), value) for value in (0.1, 0.2, 0.3))
    whole = JointState(True, *rows).of_all_joints(bus)
    assert [*whole.position] == [*whole.velocity] == [*whole.effort] == names
