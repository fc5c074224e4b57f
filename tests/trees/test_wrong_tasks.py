"""Mistakes of a first task file: each has one message, with the line as it should be."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest

from hardware import Robot, load_robot
from tests.support.generated import wrong_tasks
from tests.support.generated.wrong_tasks import TASK, corrected, mistakes_of
from trees.check import check
from trees.compile import port_types
from trees.errors import Mistake

DICE = "AddBox: {body: dice, size: [1 cm, 1 cm, 1 cm], position: [20 cm, 0, 20 cm]}"
REACH, MOVE = "with: {arm: upright, gripper: open}", "with: {joints: {joint_1: 20 deg}}"

# What is written instead of which part of a right file; the message; the line as it should be.
WRONG = [
    ("20 deg", "70", "9:23 joint_1 = 4010.7 deg is outside its limits, -90 deg to 90 deg; "
     "70 without a unit is 70 rad; did you mean 70 deg?", f"      {MOVE.replace('20', '70')}"),
    ("20 deg", "1.5708", "9:23 joint_1 = 90.0002 deg is outside its limits, -90 deg to 90 deg; "
     "1.5708 without a unit is 1.5708 rad, and the limit is 1.570796 rad: write 90 deg",
     f"      {MOVE.replace('20', '90')}"),
    ("20 deg", "-3.14", "9:23 joint_1 = -179.91 deg is outside its limits, -90 deg to 90 deg; "
     "-3.14 without a unit is -3.14 rad, and the limit is -1.570796 rad: write -90 deg",
     f"      {MOVE.replace('20', '-90')}"),
    ("20 deg", "120 deg", "9:23 joint_1 = 120 deg is outside its limits, -90 deg to 90 deg",
     f"      {MOVE.replace('20', '90')}"),
    ("joint_1: 20", "joint_7: 20", "9:23 joint_7 is not a joint of the robot; it has "
     "joint_1, "
     "joint_2, joint_3 (arm) and joint_4 (gripper)", f"      {MOVE}"),
    ("joint_1: 20", "1: 20", "9:23 1 is not a joint of the robot; it has joint_1, joint_2, "
     "joint_3 (arm) and joint_4 (gripper); did you mean joint_1?", f"      {MOVE}"),
    ("20 deg", "$swing", "9:32 there is no parameter for $swing; declare it above the tree, with "
     "parameters:, or write a value here", "parameters:\n  swing: {type: angle, default: 0}"),
    ("20 deg", "20 degrees", "9:32 joints: '20 degrees': no unit degrees; there are deg, rad; did "
     "you mean 20 deg?", f"      {MOVE}"),
    ("20 deg", "20\xb0", "9:32 joints: '20\xb0': no unit \xb0; there are deg, rad; did you mean 20 "
     "deg?", f"      {MOVE}"),
    ("20 deg", "upright", "9:22 joints: upright is a pose, not an angle: write upright alone",
     "      with: {joints: upright}"),
    ("joint_1: 20 deg", "upright", "9:22 joints: upright is a pose, not a joint: write upright "
     "alone", "      with: {joints: upright}"),
    ("{joint_1: 20 deg}", "5", "9:22 joints: 5 is not a mapping from joint names to angles, or a "
     "pose; write {joint_1: …}", ""),
    ("{joint_1: 20 deg}", "[20 deg, 0]", "9:22 joints: [20 deg, 0] is not a mapping from joint "
     "names to angles, or a pose; write {joint_1: 20 deg, joint_2: 0}",
     "      with: {joints: {joint_1: 20 deg, joint_2: 0}}"),
    (MOVE, "with: [joint_1: 20 deg]", "9:13 the ports of a node are a mapping, not a list: write "
     "braces; subtree move_joints needs the name of its port: write with: {joints: {joint_1: 20 "
     "deg}}", f"      {MOVE}"),
    (MOVE, "with: {joint_1: 20 deg}", "9:14 subtree move_joints needs the name of its port: write "
     "with: {joints: {joint_1: 20 deg}}", f"      {MOVE}"),
    ("gripper: open", "gripper: {joint_4: -0.3, joint_5: -0.3}", "7:53 joint_5 = "
     "-17.189 deg contradicts joint_4 = -17.189 deg: joint_5 is always -1 times joint_4; leave "
     "joint_5 out", "      with: {arm: upright, gripper: {joint_4: -0.3}}"),
    ("arm: upright", "arm: open", "7:19 the arm has joint_1, joint_2, joint_3, not "
     "joint_4; saved poses that fit are upright, right, folded", f"      {REACH}"),
    ("subtree: reach", "subtree: trees/reach.yaml", "6:16 no subtree trees/reach.yaml; write the "
     "name without the folder: reach", "    - subtree: reach"),
    ("subtree: reach", "subtree: [reach]", "6:16 subtree: write the name without brackets",
     "    - subtree: reach"),
    (f"sequence:\n    - subtree: reach\n      {REACH}\n    - subtree: move_joints\n      {MOVE}",
     f"sequence: {{subtree: reach, {REACH}}}", "5:13 sequence needs a list of nodes, not {subtree: "
     "reach, with: {arm: upright, gripper: open}}: begin each node with a `-`, below sequence:",
     f"  sequence: [{{subtree: reach, {REACH}}}]"),
    (f"    - subtree: reach\n      {REACH}\n    - subtree: move_joints\n      {MOVE}",
     f"    first: {{subtree: move_joints, {MOVE}}}", "6:5 sequence needs a list of nodes, not "
     "{first: {subtree: move_joints, with: {joints: {joint_1: 2...: begin each node with a `-`, "
     "below sequence:", f"    - {{subtree: move_joints, {MOVE}}}"),
    (f"  sequence:\n    - subtree: reach\n      {REACH}\n    - subtree: move_joints\n      {MOVE}",
     f"  [{{subtree: reach, {REACH}}}]", "5:3 a list of nodes needs a node above it, such as "
     "sequence:", f"  sequence: [{{subtree: reach, {REACH}}}]"),
    (REACH, "with: upright", "7:13 subtree reach needs the names of its ports: write with: {arm: "
     "upright, gripper: …}", ""),
    (f"- subtree: move_joints\n      {MOVE}", "- MoveJoints: {joints: {joint_1: 20 deg}}",
     "8:7 there is no skill MoveJoints; move_joints is a subtree: write subtree: move_joints",
     f"    - subtree: move_joints\n      {MOVE}"),
    ("  sequence:", "  Sequence:", "5:3 Sequence takes no list of nodes; these do: sequence, "
     "selector, parallel; did you mean sequence?", "  sequence:"),
    ("tree:\n  sequence:\n    - subtree: reach", "sequence:\n    - subtree: reach",
     "4:1 sequence must be below the key tree",
     "tree:\n  sequence:\n      - subtree: reach\n        with: {arm: upright, gripper: open}\n"
     "      - subtree: move_joints\n        with: {joints: {joint_1: 20 deg}}"),
    ("tree:\n  sequence:", "tree:", "5:5 a list of nodes needs a node above it, such as sequence:",
     "    sequence:"),
]  # fmt: skip
NODES = [
    ("Wait: 2 s", "10:13 Wait needs the name of its port: write Wait: {duration: 2 s}",
     "    - Wait: {duration: 2 s}"),
    ("Say: 5", "10:12 Say needs the name of its port: write Say: {text: \"5\"}",
     '    - Say: {text: "5"}'),
    ("Say: {text: true}", '10:19 Say.text: true is not a text; did you mean "true"?',
     '    - Say: {text: "true"}'),
    ("subtree: [open_gripper, close_gripper]", "10:16 a node runs one subtree; write one node for "
     "each, below sequence:",
     "    - sequence:\n        - {subtree: open_gripper}\n        - {subtree: close_gripper}"),
    ("subtree: open_gripper\n      guard: true", "11:7 write the child of guard below guard, "
     "and the condition after while:",
     "    - guard:\n        subtree: open_gripper\n      while: CheckHardware"),
    ("guard: {subtree: open_gripper}\n      while: true", "11:14 guard needs the key while "
     "with a condition, not true", "      while: CheckHardware"),
    ("guard: true\n      while: CheckHardware", "10:14 a node is a skill, a subtree, or a control "
     "node such as sequence, not true", "    - guard: Succeed"),
    ("reach", "10:7 there is no skill reach; reach is a subtree: "
     "write subtree: reach, with: {arm: …, "
     "gripper: …}", ""),
    ("CheckHardware:", "10:7 CheckHardware has no value: leave out the colon",
     "    - CheckHardware"),
    ("Compare: 2", "10:16 Compare needs the names of its ports: write Compare: {left: 2, is: …, "
     "right: …}", ""),
    ("Compare: {left: 1, is: =, right: 2}", "10:30 Compare.is: '=' is not one of !=, <, <=, ==, >, "
     ">=; did you mean ==?", '    - Compare: {left: 1, is: "==", right: 2}'),
    ("{subtree: Wait, with: {duration: 2 s}}", "10:7 Wait is a skill, not a "
     "subtree: write Wait without subtree:",
     ""),
    ("subtree: Wait\n      with: {duration: 2 s}",
     "10:7 Wait is a skill, not a "
     "subtree: write Wait without subtree:", "    - Wait: {duration: 2 s}"),
    ("Wait: {duration: 2 seconds}", "10:24 Wait.duration: '2 seconds': no unit seconds; there are "
     "h, min, ms, s; did you mean 2 s?", "    - Wait: {duration: 2 s}"),
    ("wait: {duration: 2 s}", "10:7 no skill wait; did you mean Wait?",
     "    - Wait: {duration: 2 s}"),
    ("Set: {value: 3, key: count}\n    - Say: {text: x, value: $count}", "10:28 Set writes key; "
     "name a key such as $count", "    - Set: {value: 3, key: $count}"),
    ("{sequence: [Succeed], retry: Succeed}", "10:7 sequence and retry are several nodes; begin "
     "each node of a list with a -", ""),
    ("timeout:\n        subtree: move_joints\n        with: {joints: {joint_1: 40 deg}}\n"
     "      after: 1 s",
     "13:7 timeout fails after 1 s; as planned from the boot pose, its child takes 1.7 s; write "
     "a time above 1.71 s", "      after: 3 s"),
    ("Attach: {body: cube, link: claw_support}", "10:22 no node before this one adds the body "
     "cube: add it above, such as with AddBox: {body: cube, "
     "position: [12 cm, 10 cm, 2 cm], size: [4 cm, 4 cm, 4 cm]}, with the numbers of your body; "
     "or with AddSphere, AddCylinder",
     "    - AddBox: {body: cube, position: [12 cm, 10 cm, 2 cm], size: [4 cm, 4 cm, 4 cm]}"),
    (f"{DICE}\n    - Detach: {{body: dice}}", "11:7 dice is attached to no link; attach it "
     "above, such as with Attach: {body: dice, link: claw_support}, or leave this node out",
     "    - Attach: {body: dice, link: claw_support}"),
    ("AddBox: {body: b, size: [10, 10, 10], position: [20 cm, 0, 0]}", "10:31 AddBox: size 10 m "
     "is far beyond the reach of this arm, 0.26 m; did you mean [10 mm, 10 mm, 10 mm]?",
     "    - AddBox: {body: b, size: [10 mm, 10 mm, 10 mm], position: [20 cm, 0, 0]}"),
    ("subtree: move_tool\n      with: {point: 20 cm}", "11:21 point: '20 cm' is not a list, each "
     "item a length in m, cm or mm; write [20 cm, 0, 0]", ""),
    ("subtree: move_tool\n      with: {point: [50 cm, 0, 0]}", "11:21 The tool cannot reach "
     "(500.0, 0.0, 0.0) mm. The nearest point is (221.1, 15.0, 43.7) mm, ",
     "      with: {point: [22.02 cm, 1.51 cm, 4.39 cm]}"),
    ("subtree: move_tool\n      with: {point: [4 in, 4 in, 3 in]}", "11:22 point: '4 in': no unit "
     "in; there are cm, m, mm; did you mean 101.6 mm?",
     "      with: {point: [101.6 mm, 101.6 mm, 76.2 mm]}"),
    ("subtree: move_tool\n      with: {point: [10 cm, 10 cm]}", "11:21 point: [10 cm, 10 cm] has 2 "
     "items, not 3 (x, y, z)", ""),
    ("repeat: {subtree: open_gripper}\n      times: twice", "11:14 repeat: times: 'twice' is not a "
     "whole number; for no limit, leave it out", ""),
    ("subtree: move_relative\n      with: {by: {joint_1: 20}}",
     "11:19 joint_1 by 1145.9 deg is more than its range, 180 deg; 20 without a "
     "unit is 20 rad; did you mean 20 deg?",
     "      with: {by: {joint_1: 20 deg}}"),
]  # fmt: skip


# Slips of beginners: what is written instead of which part of a right file; the message; the line.
SLIPS = [
    ("{joint_1: 20 deg}", "{joint_1: 0,35}", "9:33 a point begins the decimals, not a comma",
     "      with: {joints: {joint_1: 0.35}}"),
    ("{joint_1: 20 deg}", "{joint_1: 20,5 deg}", "9:34 a point begins the decimals, not a comma",
     "      with: {joints: {joint_1: 20.5 deg}}"),
    (MOVE, "with:\n        joints:\n          joint_1: 0,35", "11:20 joints: '0,35' is not an "
     "angle in rad or deg; did you mean 0.35?", "          joint_1: 0.35"),
    ("20 deg", "\u221220 deg", "9:32 joints: '\u221220 deg' is not an angle in rad or deg; did you "
     "mean -20 deg?", f"      {MOVE.replace('20', '-20')}"),
    ("20 deg", "20 Grad", "9:32 joints: '20 Grad': no unit Grad; there are deg, rad; did you mean "
     "20 deg?", f"      {MOVE}"),
    ("arm: upright", "arm: Upright", "7:19 arm: no pose Upright; there are folded, right, "
     "upright; did you mean upright?", f"      {REACH}"),
    ("task: 20", "Task: 20", "1:1 unknown key Task; there are description, grammar, name, "
     "parameters, replaces, retry, task, tree; did you mean task?", "task: 20"),
    ("joint_1: 20 deg", "joint_1: 20 deg, joint_1: 30 deg", "9:40 the key joint_1 is given twice, "
     "first in line 9, column 23; remove one key", ""),
    ("- subtree: move", "\u2013 subtree: move", "8:5 write the plain dash -",
     "    - subtree: move_joints"),
    ("  sequence:", "  // all moves\n  sequence:", "5:3 a comment begins with #, not with //",
     "  # all moves"),
    (f"  {MOVE}", f"- {MOVE}", "9:5 leave out the `-` before `with`: it begins no item of a list",
     f"      {MOVE}"),
    (MOVE, "with:\n        - joints: {joint_1: 20 deg}", "10:9 the ports of a node are a mapping, "
     "not a list: leave out each `-`", "          joints: {joint_1: 20 deg}"),
    (MOVE, "with: [{joints: {joint_1: 20 deg}}]", "9:13 the ports of a node are a mapping, not a "
     "list: write braces", f"      {MOVE}"),
    ("name: m", "name: *m", "2:7 *m is an alias of YAML, which is not allowed; write the value "
     "itself", "name: m"),
    (f"{REACH}\n    - subtree: move_joints\n      {MOVE}", "with: &a {arm: upright, gripper: "
     "open}\n    - subtree: reach\n      with: {<<: *a, arm: folded}", "9:14 << is a merge of "
     "YAML, which is not allowed; write the keys themselves",
     "      with: {gripper: open, arm: folded}"),
    (f"{REACH}\n    - subtree: move_joints\n      {MOVE}", "with: &a {arm: upright, gripper: "
     "open}\n    - subtree: reach\n      with: *a", "9:13 *a is an alias of YAML, which is not "
     "allowed; write the value itself", f"      {REACH}"),
    ("description: One mistake.", "description:", "3:1 description: write a text here",
     "description: What it does."),
    ("- subtree: move", "- - subtree: move", "8:7 one `-` too many", "    - subtree: move_joints"),
    ("subtree: move_joints", "subtree: go", "8:16 joints is not a port of subtree go, but of "
     "subtree move_joints: write subtree: move_joints", "    - subtree: move_joints"),
    (REACH, "with:\n      arm: upright\n      gripper: open", "8:7 `arm` is indented by 6 spaces, "
     "not 8: it belongs to `with` in line 7; move the lines below it, too",
     "        arm: upright\n        gripper: open"),
    (MOVE, "joints: {joint_1: 20 deg}", "9:7 write the ports of a subtree below the key `with`",
     f"      {MOVE}"),
    ("subtree: move_joints\n      with: {joints: {joint_1: 20 deg}}", "subtree: go\n      with: "
     "{angle: 20 deg}", "9:14 angle is not a port of subtree go; there are goal, speed, start; it "
     "needs start: current position of every joint, and goal: target of every joint", ""),
    ("joints:", "by:", "9:14 by is not a port of subtree move_joints; there are joints, speed",
     f"      {MOVE}"),
    (f"- subtree: move_joints\n      {MOVE}", "- move_joints: {joint_1: 20 deg}",
     "8:7 there is no skill move_joints; move_joints is a subtree: "
     "write subtree: move_joints, with: "
     "{joints: {joint_1: 20 deg}}",
     f"    - subtree: move_joints\n      {MOVE}"),
]  # fmt: skip
SLIPS_OF_NODES = [
    ("pick", "10:7 no skill pick, but a task: write {task: 1}", "    - {task: 1}"),
    ("subtree: 1", "10:7 a subtree has a name; a task has a number: write task: 1",
     "    - task: 1"),
    ("Say: [hello, world]", "10:7 Say takes no list of nodes; these do: sequence, selector, "
     "parallel", ""),
    ("while: CheckHardware\n      subtree: open_gripper", "10:7 write the child of guard below "
     "guard, and the key while in its own line",
     "    - guard:\n        subtree: open_gripper\n      while: CheckHardware"),
    ("Wait: {within: 2 s}", "10:14 within is not a port of Wait; there is only duration",
     "    - Wait: {duration: 2 s}"),
    ("Say: {text: item #1}", "10:19 a # after a space begins a comment; put the text in quotes",
     '    - Say: {text: "item #1"}'),
    ("Compare: {left: 1, is: =>, right: 2}", "10:30 Compare.is: '=>' is not one of !=, <, <=, ==, "
     ">, "
     ">=; did you mean >=?", '    - Compare: {left: 1, is: ">=", right: 2}'),
    ("subtree: move_tool\n      with: {point: [0, 0, 0], relative: yes}", "11:42 relative: 'yes' "
     "is not true or false; did you mean true?",
     "      with: {point: [0, 0, 0], relative: true}"),
    ("retry:\n        subtree: open_gripper", "10:7 retry needs attempts: largest number of "
     "attempts; write it below, in the column of retry", "      attempts: 3"),
    ("repeat:\n        times: 3\n        subtree: open_gripper",
     "11:9 times belongs to repeat: write it at the level of repeat",
     "    - repeat:\n        subtree: open_gripper\n      times: 3"),
    ("sequence:", "10:7 sequence needs a list of nodes: begin each node with a `-`, "
     "below sequence:",
     ""),
    ("if: CheckHardware\n      then: {subtree: open_gripper}", "10:7 there is no if: a selector "
     "runs its nodes until one succeeds; begin the selector with the inverted condition",
     "    - selector:\n        - inverter: CheckHardware\n        - {subtree: open_gripper}"),
    ("if: CheckHardware\n      then: {subtree: open_gripper}\n      else: [Succeed]",
     "10:7 there is no if: a selector runs its nodes until one succeeds; begin the selector "
     "with the sequence of one case, which begins with the condition",
     "    - selector:\n        - sequence:\n            - CheckHardware\n            - {subtree: "
     "open_gripper}\n        - sequence:\n            - inverter: CheckHardware\n            - "
     "Succeed"),
    ("if: {left: 1, is: ==, right: 1}\n      then: Succeed", "10:7 there is no if: a selector ",
     '    - selector:\n        - inverter: {Compare: {left: 1, is: "==", right: 1}}\n'
     "        - Succeed"),
    ("CheckBounds: {arm: upright, gripper: open, goal: $goal}\n    - PlanArm: {goal: $goal}",
     "11:7 PlanArm needs start: position of every actuated joint [rad]; SetStart can write it "
     "above: start: $start", ""),
    ("Target: {start: $s, joints: {joint_1: 0}, goal: $g}", "10:23 nothing has written $s when "
     "Target.start reads it; write the key in an earlier node, such as SetStart, or declare a "
     "parameter or port of this name", ""),
]  # fmt: skip


MISTAKES, IN_NODES = [*WRONG, *SLIPS], [*NODES, *SLIPS_OF_NODES]


Found = Mapping[str, Sequence[Mistake]]


@pytest.fixture(autouse=True, scope="module")
def only_shipped_skills() -> Iterator[None]:
    """Hide skills that other tests have loaded: messages list the skills that there are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(port_types, "is_broken", lambda module: not module.startswith("skills."))
        yield


@pytest.fixture(scope="module")
def found(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Found:
    """The mistakes of all tasks in this file, by their texts. They are checked at once."""
    texts = [TASK.replace(right, wrong) for right, wrong, *_ in MISTAKES]
    texts += [f"{TASK}    - {node}\n" for node, *_ in IN_NODES]
    texts += [_with_parameter(line) for line, *_ in SWING]
    files = [{"20_m.yaml": text} for text in texts]
    return dict(zip(texts, mistakes_of(robot, tmp_path_factory.mktemp("t"), files), strict=True))


def one(mistakes: Sequence[Mistake]) -> tuple[str, str]:
    """Return the only mistake of a task, and the line as it should be."""
    (mistake,) = mistakes
    place = mistake.place
    return f"{place.line}:{place.column} {mistake.message}", _text(mistake)


def _text(mistake: Mistake) -> str:
    return mistake.instead.text if mistake.instead else ""


@pytest.mark.slow
@pytest.mark.parametrize(("right", "wrong", "said", "instead"), MISTAKES, ids=range(len(MISTAKES)))
def test_a_mistake_has_one_message(
    found: Found, right: str, wrong: str, said: str, instead: str
) -> None:
    assert TASK.count(right) == 1
    assert one(found[TASK.replace(right, wrong)]) == (said, instead)


@pytest.mark.parametrize(("node", "said", "instead"), IN_NODES, ids=range(len(IN_NODES)))
def test_a_mistake_of_a_node_has_one_message(
    found: Found, node: str, said: str, instead: str
) -> None:
    message, line = one(found[f"{TASK}    - {node}\n"])
    assert message.startswith(said)
    assert line == instead


FILES = [
    ("poses.yaml", "left: {joint_1: 20 deg}\n", "1:1 left must be below the key poses",
     "poses:\n  left: {joint_1: 20 deg}"),
    ("poses.yaml", "poses: {left: {joint_1: 80}}\n", "1:16 left: joint_1 = 4583.7 deg is outside "
     "its limits, -90 deg to 90 deg; 80 without a unit is 80 rad; did you mean 80 deg?",
     "poses: {left: {joint_1: 80 deg}}"),
    ("poses.yaml", "poses: {left: {joint_1: 1.571}}\n", "1:16 left: joint_1 = 90.012 deg is "
     "outside its limits, -90 deg to 90 deg; 1.571 without a unit is 1.571 rad, and the limit is "
     "1.570796 rad: write 90 deg", "poses: {left: {joint_1: 90 deg}}"),
    ("wave.yaml", TASK, "1:1 this is a task; its file needs a name like 20_m.yaml: rename it", ""),
    ("20_m.yaml", "subtree: m\ndescription: x\ntree: Succeed\n",
     "1:1 this is a subtree; its file needs a name like m.yaml: rename it", ""),
    ("20_m.yaml", "", "1:1 the file is empty; `armtree new` writes one that runs", ""),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "said", "instead"), FILES, ids=range(len(FILES)))
def test_a_mistake_of_a_file_has_one_message(
    robot: Robot, tmp_path: Path, name: str, text: str, said: str, instead: str
) -> None:
    (tmp_path / name).write_text(text)
    (mistake,) = check(robot, None, [tmp_path / name]).mistakes
    place = mistake.place
    assert f"{place.line}:{place.column} {mistake.message}" == said
    assert _text(mistake) == instead


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_a_text_of_another_encoding_is_to_be_saved_as_utf_8(
    robot: Robot, tmp_path: Path, encoding: str
) -> None:
    (tmp_path / "20_m.yaml").write_bytes(TASK.replace("One", "Ein grünes").encode(encoding))
    (mistake,) = check(robot, None, [tmp_path / "20_m.yaml"]).mistakes
    assert mistake.message == "is not UTF-8 text; save it as UTF-8 in your editor"


@pytest.mark.parametrize(
    ("nodes", "unread"),
    [
        ("    - Set: {value: 3, key: $count}\n", ["count"]),
        ("    - Set: {value: 3, key: $count}\n    - Say: {text: x, value: $count}\n", []),
        ("    - Ask: {question: Ready?, answer: $ready}\n", ["ready"]),
        ("    - repeat:\n        sequence:\n          - Set: {value: 3, key: $n}\n          - Say: "
         "{text: x, value: $n}\n      times: 2\n", []),
    ],
)  # fmt: skip
def test_a_key_that_nothing_reads_is_a_note(
    robot: Robot, tmp_path: Path, nodes: str, unread: list[str]
) -> None:
    (tmp_path / "20_m.yaml").write_text(TASK + nodes)
    found = check(robot, None, [tmp_path / "20_m.yaml"])
    assert not found.mistakes
    assert [note.message for note in found.notes] == [
        f"nothing reads ${key}; let a node read it, or leave it out" for key in unread
    ]


def test_a_long_time_without_a_unit_is_a_note_with_the_line(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "20_m.yaml").write_text(f"{TASK}    - Wait: {{duration: 2000}}\n")
    found = check(robot, None, [tmp_path / "20_m.yaml"])
    (note,) = found.notes
    assert not found.mistakes
    assert note.message == (
        "Wait.duration: 2000 without a unit is 2000 s, or 33.3 min; did you mean 2000 ms?"
    )
    assert _text(note) == "    - Wait: {duration: 2000 ms}"


def test_no_file_that_ships_has_a_note(robot: Robot) -> None:
    found = check(robot, None)
    assert (found.mistakes, found.notes) == ([], [])


SWING = [
    ("ports: {swing: angle}", "4:1 a task has parameters, a subtree has ports: write parameters",
     "parameters: {swing: angle}"),
    ("parameters: {swing: {type: degrees, default: 40 deg}}", "4:28 parameters: swing: no type "
     "degrees; there are number, integer, boolean, text, angle, duration, length, positions, and "
     "a list of one of these; did you mean angle?",
     "parameters: {swing: {type: angle, default: 40 deg}}"),
    ("parameters: {$swing: {type: angle, default: 40 deg}}", "4:14 parameters: '$swing' is not a "
     "name (a letter, then letters, digits, _ or -); did you mean swing?",
     "parameters: {swing: {type: angle, default: 40 deg}}"),
    ("parameters: {swing: {type: angle, default: 80 deg, max: 60 deg}}",
     "4:44 the default of swing: '80 deg' is more than 60 deg",
     "parameters: {swing: {type: angle, default: 60 deg, max: 60 deg}}"),
    ("parameters: {swing: {type: angle, default: 40, max: 60 deg}}",
     "4:44 the default of swing: 40 rad is more than 60 deg; did you mean 40 deg?",
     "parameters: {swing: {type: angle, default: 40 deg, max: 60 deg}}"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "said", "instead"), SWING)
def test_a_mistake_of_a_parameter_has_one_message(
    found: Found, line: str, said: str, instead: str
) -> None:
    assert one(found[_with_parameter(line)]) == (said, instead)


def _with_parameter(line: str) -> str:
    return TASK.replace("tree:\n  seq", f"{line}\ntree:\n  seq").replace("20 deg", "$swing")


CASES = wrong_tasks.cases()


@pytest.fixture(scope="module")
def of_cases(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Found:
    files = [case.files for case in CASES.values()]
    return dict(zip(CASES, mistakes_of(robot, tmp_path_factory.mktemp("c"), files), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_what_is_said_of_a_wrong_file(of_cases: Found, name: str) -> None:
    assert wrong_tasks.said(of_cases[name]) == CASES[name].said


@pytest.mark.slow
def test_what_is_to_be_written_instead_removes_the_mistake(
    robot: Robot, tmp_path: Path, found: Found, of_cases: Found
) -> None:
    given = {text: {"20_m.yaml": text} for text in found} | {n: c.files for n, c in CASES.items()}
    names, right = list[tuple[str, Mistake]](), list[Mapping[str, str]]()
    for name, mistakes in {**found, **of_cases}.items():
        for mistake in mistakes:
            if mistake.instead:
                file = mistake.place.path.name
                names.append((name, mistake))
                text = corrected(given[name][file], mistake.instead)
                right.append({**given[name], file: text})
    assert len(right) > 150
    left = mistakes_of(robot, tmp_path, right)
    for (name, mistake), now in zip(names, left, strict=True):
        before = {_words(each) for each in {**found, **of_cases}[name]}
        after = {_words(each) for each in now}
        assert _words(mistake) not in after, f"{name}: {mistake}"
        assert after <= before, f"{name}: {mistake}"


def _words(mistake: Mistake) -> tuple[str, str]:
    """Return the message of a mistake, without folders and the numbers of further lines."""
    return mistake.place.path.name, re.sub(
        r"\S+/|; the same mistake is in .*|, first in .*", "", mistake.message
    )


@pytest.mark.parametrize("kind", ["[number]", "{a: number}"])
def test_a_type_that_is_no_word_is_reported(robot: Robot, tmp_path: Path, kind: str) -> None:
    (tmp_path / "20_m.yaml").write_text(
        f"task: 20\nname: m\ndescription: x\nparameters:\n  a: {{type: {kind}, default: 1}}\n"
        "tree: Succeed\n"
    )
    assert any("no type" in str(each) for each in check(robot, tmp_path).mistakes)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ("[\n]", "parameters: \\[\\] is not a mapping of names to types"),
        ("\n  - {a: number}\n  - {b: number}", "is not a mapping of names to types"),
    ],
)
def test_a_list_of_parameters_that_merges_to_none_is_only_reported(
    robot: Robot, tmp_path: Path, parameters: str, words: str
) -> None:
    head = "task: 20\nname: m\ndescription: x\n"
    (tmp_path / "20_m.yaml").write_text(f"{head}parameters: {parameters}\ntree: Succeed\n")
    (mistake,) = check(robot, tmp_path).mistakes
    assert re.search(words, str(mistake))
    assert "write" not in str(mistake)


def test_a_loop_over_nodes_keeps_them(robot: Robot, tmp_path: Path) -> None:
    text = "task: 20\nname: m\ndescription: x\ntree:\n  loop:\n    - Succeed\n    - Fail\n"
    (tmp_path / "20_m.yaml").write_text(text)
    said = "\n".join(map(str, check(robot, tmp_path).mistakes))
    assert "did you mean repeat?" in said
    assert said.count("- Succeed") == 1


def test_subtrees_that_use_each_other_are_reported_once(robot: Robot, tmp_path: Path) -> None:
    for name, other in (("aa", "bb"), ("bb", "aa")):
        text = f"subtree: {name}\ndescription: x\ntree:\n  sequence:\n    - subtree: {other}\n"
        (tmp_path / f"{name}.yaml").write_text(text)
    (tmp_path / "20_m.yaml").write_text(f"{TASK}    - subtree: aa\n")
    (mistake,) = check(robot, tmp_path).mistakes
    assert (mistake.place.path.name, mistake.place.line) == ("bb.yaml", 5)
    assert mistake.message == (
        "aa would contain itself: aa -> bb (aa.yaml:5) -> aa (bb.yaml:5); leave one of these "
        "uses out"
    )


FINE = [
    "timeout: {subtree: move_joints, with: {joints: {joint_1: 40 deg}}}\n      after: 2 s",
    "selector: [{subtree: move_joints, with: {joints: {joint_1: 40 deg}}}, {timeout: {subtree: "
    "move_joints, with: {joints: {joint_1: 40 deg}}}, after: 0.1 s}]",
    f"{DICE}\n    - Attach: {{body: dice, link: claw_support}}",
    f"{DICE}\n    - Attach: {{body: dice, link: claw_support}}\n    - Detach: {{body: dice}}",
    "AddBox: {body: table, size: [2, 2, 10 mm], position: [0, 0, -20 cm]}",
    "Attach: {body: left_by_another_task, link: claw_support}",
]


@pytest.mark.parametrize("node", FINE, ids=range(len(FINE)))
def test_what_a_run_may_do_is_no_mistake(robot: Robot, tmp_path: Path, node: str) -> None:
    (tmp_path / "20_m.yaml").write_text(f"{TASK}    - {node}\n")
    size = "size: [1 cm, 1 cm, 1 cm], position: [20 cm, 0, 20 cm]"
    other = f"tree: {{AddBox: {{body: left_by_another_task, {size}}}}}\n"
    (tmp_path / "21_n.yaml").write_text(f"task: 21\nname: n\ndescription: x\n{other}")
    assert not check(robot, None, [tmp_path / "20_m.yaml"]).mistakes


def test_a_subtree_without_ports_needs_no_key_ports(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "look.yaml").write_text("subtree: look\ndescription: x\ntree: Succeed\n")
    assert not check(robot, tmp_path).mistakes


def test_a_gripper_without_widths_takes_an_angle(tmp_path: Path) -> None:
    node = "    - subtree: reach\n      with: {arm: ready, gripper: 20 mm}\n"
    (tmp_path / "20_m.yaml").write_text(f"{TASK[: TASK.index('    - ')]}{node}")
    (mistake,) = check(load_robot(Path("so101")), None, [tmp_path / "20_m.yaml"]).mistakes
    assert mistake.message == (
        "gripper: a task gives the position of the joint of the gripper, not its width, such as "
        "gripper: 0 rad"
    )
    assert _text(mistake) == "      with: {arm: ready, gripper: {gripper: 0 rad}}"


def test_a_loop_that_lets_no_task_succeed_is_a_note(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "20_m.yaml").write_text(f"{TASK}    - repeat: {{subtree: open_gripper}}\n")
    found = check(robot, None, [tmp_path / "20_m.yaml"])
    (note,) = found.notes
    assert not found.mistakes
    assert note.message == (
        "without times, repeat runs until its child fails: the task never succeeds"
    )
    assert _text(note) == "      times: 3"
