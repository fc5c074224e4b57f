"""`armtree check`: parameters whose values are not known yet, and files that are no tasks."""

from pathlib import Path

import pytest

from executive.building.check import check
from hardware import Robot
from tests.test_executive_check import HEAD, found, tree
from trees import Library

UNKNOWN = [
    ("integer", "{repeat: Succeed, times: $a}"),
    ("integer", "{retry: CheckHardware, attempts: $a}"),
    ("duration", "{timeout: {Wait: {duration: 5}}, after: $a}"),
    ("{type: duration, min: 1}", "{Wait: {duration: $a}}"),
    ("length", "{AddBox: {body: b, position: [0, 0, $a], size: [$a, $a, 1]}}"),
    ("{type: text, choices: [all, any]}", "{parallel: [Succeed], policy: $a}"),
    ("text", "{Ask: {question: a, wanted: $a}}"),
    ("angle", "{subtree: move_joints, with: {joints: {joint_1: $a}}}"),
    ("positions", "{sequence: [{SetStart: {start: $s}}, {PlanArm: {start: $s, goal: {joint_1: 0,"
     " joint_2: 0, joint_3: 0, joint_4: 0}, via: [$a], plan: $p}}]}"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "text"), UNKNOWN)
def test_a_parameter_without_a_default_stands_anywhere(
    robot: Robot, tmp_path: Path, kind: str, text: str
) -> None:
    assert found(robot, tmp_path, tree(text, f"parameters: {{a: {kind}}}\n")) == []
    (tmp_path / "within.yaml").write_text(
        f"subtree: within\ndescription: x\nports: {{a: {kind}}}\ntree: {text}\n"
    )
    assert not check(robot, None, [tmp_path / "within.yaml"]).mistakes
    text = tree("{subtree: within, with: {a: $b}}", f"parameters: {{b: {kind}}}\n")
    assert found(robot, tmp_path, text) == []


@pytest.mark.parametrize(("_", "text"), UNKNOWN)
def test_a_parameter_of_another_type_stands_nowhere(
    robot: Robot, tmp_path: Path, _: str, text: str
) -> None:
    (mistake, *_more) = found(robot, tmp_path, tree(text, "parameters: {a: boolean}\n"))
    assert "$a is true or false, not" in mistake


OWN_FILES = [
    ("poses.yaml", "poses: [a]\n", "1:8 poses: ['a'] is not a mapping of names"),
    ("poses.yaml", "poses:\n", "1:1 poses: null is not a mapping of names"),
    ("poses.yaml", "poses: {x: {}}\n", "1:12 pose x names no joint"),
    (
        "poses.yaml",
        "poses: {opne: {joint_4: 0}}\nreplaces: [opne]\n",
        "2:1 replaces: no pose opne ships; there are closed, folded, open, right, upright; "
        "did you mean open?",
    ),
    (
        "3_wave.yaml",
        HEAD.replace("x", "wive") + "tree: Succeed\n",
        "2:1 the file is named 3_wave.yaml but says name wive",
    ),
    (
        "4_x.yaml",
        HEAD + "tree: Succeed\n",
        "1:1 the file is named for task 4 but says task 3",
    ),
    (
        "3_x.yaml",
        HEAD + "replaces: pik\ntree: Succeed\n",
        "4:1 replaces: no task 3 ships; there are 0_home, 1_pick, 2_rest",
    ),
    (
        "look.yaml",
        "subtree: look\ndescription: x\nports: {}\nreplaces: look\ntree: Succeed\n",
        "4:1 replaces: no subtree look ships; there are close_gripper, go,",
    ),
    (
        "poses.yaml",
        "poses: {opne: {joint_4: 0}}\nreplaces: [open]\n",
        "2:1 replaces: here is no pose open; there are opne; did you mean opne?",
    ),
    ("3_x.YAML", HEAD, "the name of a file of tasks ends in .yaml"),
    ("look.yml", HEAD, "the name of a file of tasks ends in .yaml"),
    (
        "look.yaml",
        "subtree: look\ndescription: x\nports: {a: {type: text, output: true}}\n"
        "tree: {Set: {value: 1, key: $a}}\n",
        "4:7 subtree look: a is a text, but written is a number",
    ),
    (
        "look.yaml",
        "subtree: look\ndescription: x\nports: {a: {type: text, output: true}}\n"
        "tree: {selector: [CheckHardware, {Set: {value: b, key: $a}}]}\n",
        "4:7 subtree look does not write a on every way through it",
    ),
    (
        "look.yaml",
        "subtree: look\ndescription: x\nports: {a: {type: text, output: true, default: b}}\n"
        "tree: {Set: {value: b, key: $a}}\n",
        "3:39 ports: a is written, and takes no default",
    ),
]


@pytest.mark.parametrize(("name", "text", "words"), OWN_FILES)
def test_wrong_files_of_other_kinds(
    robot: Robot, tmp_path: Path, name: str, text: str, words: str
) -> None:
    (tmp_path / name).write_text(text)
    (mistake,) = check(robot, tmp_path).mistakes
    assert words in f"{mistake.place.line}:{mistake.place.column} {mistake.message}"


def test_a_task_within_braces_is_listed_too(robot: Robot, tmp_path: Path) -> None:
    text = "{task: 3, name: x, description: y,\ntree: Succeed}\n"
    assert found(robot, tmp_path, text) == []
    assert Library(tmp_path).head(3).name == "x"
