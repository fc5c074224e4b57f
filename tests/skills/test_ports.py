"""Values of ports for people, and those that a run gave to its nodes."""

from collections.abc import Iterator
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

WRONG: dict[str, Any] = {"joint_1": "70deg", "joint_2": None}  # positions, as a skill may write


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
        ([Positions(joint_1=1.0), [1.0]], "", "joint_1 57.3 deg, list"),
        (object(), "", "object"),
        ("x" * 1000, "", "x" * (MAX_WORDS - 1) + "…"),
        (1234567, "", "1234567"),
        pytest.param(10**400, "", "int", id="too large"),
        pytest.param(10**400, "rad", "int", id="too large with a unit"),
        (Positions(WRONG), "", "joint_1 70deg, joint_2 NoneType"),
        pytest.param(Positions(joint_1=10**400), "", "joint_1 int", id="too large a position"),
        (Positions(), "", ""),
    ],
)
def test_a_value_in_words(value: Any, unit: str, words: str) -> None:
    assert value_words(value, unit, load_robot()) == words


def test_of_a_long_list_only_the_first_items_are_read() -> None:
    class Items(list[int]):
        read = 0

        def __iter__(self) -> Iterator[int]:
            for item in super().__iter__():
                self.read += 1
                yield item

    items = Items(range(100_000))
    words = value_words(items, "", load_robot())
    assert words.startswith("0, 1, 2")
    assert (len(words), words[-1]) == (MAX_WORDS, "…")
    assert items.read <= MAX_WORDS


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
