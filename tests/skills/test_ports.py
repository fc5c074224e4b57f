"""Values of ports for people, and those that a run gave to its nodes."""

from pathlib import Path
from typing import Any

import pytest

import logs
from executive.testing import SimulatedArm
from hardware import load_robot
from skills import Positions
from skills.ports import MAX_WORDS, value_words

TASK = """
task: 12
name: turn
description: Say something, and turn.
parameters:
  what: {type: text, default: well, description: what}
  far: {type: angle, default: 10 deg, description: how far}
tree:
  sequence:
    - Say: {text: $what}
    - Set: {value: $far, key: $there}
    - retry:
        Compare: {left: $there, is: "==", right: 20 deg}
      attempts: 2
    - subtree: move_joints
      with: {joints: {joint_1: $far}}
"""


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (0.5236, "rad", "30.0001 deg"),
        (-1e-9, "m", "-1e-06 mm"),
        (2, "", "2"),
        (True, "", "true"),
        ([0.1, 0.0, 0.25], "m", "100 mm, 0 mm, 250 mm"),
        (Positions(joint_1=1.0), "", "joint_1 57.3 deg"),
        ("as it is", "", "as it is"),
        (object(), "", "object"),
        ("x" * 1000, "", "x" * (MAX_WORDS - 1) + "…"),
    ],
)
def test_a_value_in_words(value: Any, unit: str, words: str) -> None:
    assert value_words(value, unit, load_robot()) == words


def test_the_values_that_a_node_was_given_are_events_and_are_recorded(tmp_path: Path) -> None:
    (tmp_path / "12_turn.yaml").write_text(TASK)
    with SimulatedArm(trees=tmp_path) as arm:
        outcome = arm.run(12, what="hello", far="20 deg")
        assert outcome.success, outcome.message
        nodes = [each for each in arm.records if isinstance(each, logs.NodeStatus)]
        recorded = logs.Recording(Path(outcome.recording)).records()
        assert [each for each in recorded if isinstance(each, logs.NodeStatus)] == nodes
    given = {each.name: each.inputs for each in nodes}
    assert given["Say"] == {"text": "hello"}
    assert given["Compare"] == {"left": "0.349066"}
    assert given["Target"]["start"].startswith("joint_1 0.0 deg, ")
    assert given["Execute"] == {"arm_plan": "Plan", "gripper_plan": "Plan"}
    assert given["retry"] == {}
