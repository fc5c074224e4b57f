"""Files for Groot2, loaded whole by BehaviorTree.CPP: models, ports, keys and all nodes."""

import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from hardware import Robot
from skills.user_skills import load_skills
from tests.support.paths import EXAMPLES
from trees import Library
from trees.check import compile_task
from trees.export.groot import as_groot
from trees.export.outline import outline
from trees.nodes.kind import reserved_names

LOADER = Path(sys.prefix) / ".behaviortree"
FOR_US = {"name", "_description"}  # attributes that are not ports

pytestmark = pytest.mark.skipif(
    not LOADER.exists(), reason="BehaviorTree.CPP is not built: make test does, where there is g++"
)

EVERY_KIND = """\
task: 3
name: all
description: Every kind of node, and every kind of value.
tree:
  sequence:
    - SetStart: {start: $here}
    - retry: CheckHardware
      attempts: 3
      backoff: 1 s
    - repeat:
        Say: {text: "a < b & \\"c\\"", value: 1.5}
      times: 2
    - timeout:
        selector: [{inverter: CheckHardware}, {wait_for: CheckHardware}]
        memory: false
      after: 5 s
    - guard: {force_success: {Fail: {reason: so}}}
      while: {sequence: [CheckHardware, CheckHardware], memory: false}
    - guard: {Wait: {duration: 10 ms}}
      while: CheckHardware
      otherwise: pause
    - parallel: [{selector: [CheckHardware, Succeed]}, {Say: {text: $$key}}]
    - parallel: [CheckHardware, {Wait: {duration: 1}}]
      policy: any
    - PlanArm:
        start: $here
        goal: {joint_1: 0, joint_2: 0, joint_3: 0, joint_4: 0}
        via: [{joint_1: 0.1, joint_2: 0, joint_3: 0}, right]
        plan: $plan
"""


def load(text: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """What BehaviorTree.CPP says of a file."""
    path = folder / "tree.xml"
    path.write_text(text)
    return subprocess.run([LOADER, path], capture_output=True, text=True, timeout=30, check=False)


def exported(robot: Robot, folder: Path, number: int) -> str:
    return as_groot(outline(compile_task(robot, Library(folder), number)), number)


def same(text: str, reported: list[str]) -> None:
    """Compare every node, with its ports, with the expected lines."""
    tree = ET.fromstring(text).find("BehaviorTree")
    assert tree is not None
    for node, line in zip(list(tree.iter())[1:], reported, strict=True):
        kind, name, *ports = line.split("\t")
        assert (kind, name) == (node.tag, node.get("name"))
        heard = dict(port.split(" is ", 1) for port in ports)
        assert heard == {
            port: f"key {value}" if value.startswith("{") else value
            for port, value in node.attrib.items()
            if port not in FOR_US
        }


@pytest.mark.parametrize("number", range(9))
def test_every_task_that_ships_is_loaded_whole(robot: Robot, tmp_path: Path, number: int) -> None:
    assert load_skills(EXAMPLES / "skills", reserved_names()) == []
    text = exported(robot, EXAMPLES, number)
    said = load(text, tmp_path)
    assert (said.returncode, said.stderr) == (0, "")
    *reported, end = said.stdout.splitlines()
    same(text, reported)
    assert end == "SUCCESS"


def test_every_kind_of_node_and_value(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "3_all.yaml").write_text(EVERY_KIND)
    text = exported(robot, tmp_path, 3)
    said = load(text, tmp_path)
    assert (said.returncode, said.stderr) == (0, "")
    *reported, end = said.stdout.splitlines()
    same(text, reported)
    assert end == "SUCCESS"
    assert 'Say\tSay\ttext is a < b & "c"\tvalue is 1.5' in reported
    assert "Say\tSay\ttext is $key" in reported


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        ('start="{', 'strat="{', "[strat] is found in the XML"),
        ('<output_port name="start">', '<output_port name="other">', "[start] is found in the XML"),
        ('<Action ID="SetStart">', '<Action ID="Set">', "SetStart"),
        ("num_cycles", "num_cylces", "num_cylces"),
    ],
)
def test_it_would_notice(robot: Robot, tmp_path: Path, right: str, wrong: str, words: str) -> None:
    (tmp_path / "3_all.yaml").write_text(EVERY_KIND)
    text = exported(robot, tmp_path, 3)
    assert right in text
    said = load(text.replace(right, wrong), tmp_path)
    assert said.returncode == 1
    assert words in said.stderr
