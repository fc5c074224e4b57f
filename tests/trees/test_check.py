"""`armtree check`: what is wrong is found before anything moves, with its line."""

import shutil
from pathlib import Path

import pytest

from hardware import Robot
from skills.user_skills import load_skills
from tests.support.paths import EXAMPLES, TASKS
from trees import Library
from trees.check import check
from trees.nodes.kind import reserved_names

HEAD = "task: 3\nname: x\ndescription: y\n"
MOVE = "{subtree: move_joints, with: {joints: upright}}"
SAY = "Say: {text: a}"
GO = "{sequence: [{SetStart: {start: $s}}, {subtree: go, with: {start: $s, "


def found(robot: Robot, folder: Path, text: str) -> list[str]:
    """The mistakes in a task file, each `line:column message`."""
    (folder / "3_x.yaml").write_text(text)
    mistakes = check(robot, None, [folder / "3_x.yaml"]).mistakes
    assert {m.place.path for m in mistakes} <= {folder / "3_x.yaml"}
    return [f"{m.place.line}:{m.place.column} {m.message}" for m in mistakes]


def tree(text: str, above: str = "") -> str:
    return f"{HEAD}{above}tree: {text}\n"


RIGHT = [
    "{timeout: {Wait: {duration: 1}}, after: 2 s}",
    "{repeat: {Say: {text: a}}, times: 3}",
    "{timeout: {repeat: {Say: {text: a}}}, after: 2}",
    "{parallel: [{repeat: {Say: {text: a}}}, {Wait: {duration: 1 min}}], policy: any}",
    "{repeat: {Compare: {left: 1, is: '<', right: 2}}}",
    "{selector: [{Fail: {reason: a}}, {Say: {text: b}}]}",
    "{sequence: [CheckHardware, {Wait: {duration: 1}}], memory: false}",
    "{force_success: {Fail: {reason: a}}}",
    "{guard: Succeed, while: {selector: [CheckHardware, {inverter: CheckHardware}]}}",
    "{sequence: [{selector: [{sequence: [{Set: {value: 1, key: $a}}, {Say: {text: a, value: $a}},"
    " CheckHardware]}, {sequence: [{Set: {value: b, key: $a}}, {Say: {text: $a}}]}]}, Succeed]}",
    "{inverter: CheckHardware}",
    "{guard: Succeed, while: {inverter: CheckHardware}}",
    "{sequence: [{Set: {value: 1, key: $a}}, {Compare: {left: $a, is: '<', right: 2}}]}",
    "{Compare: {left: 1 s, is: '<', right: 200 ms}}",
    "{Compare: {left: 1, is: '<', right: 200 ms}}",
    "{sequence: [{Ask: {question: a, answer: $a}}, {Compare: {left: $a, is: ==, right: 5 min}}]}",
    "{sequence: [{Set: {value: 1 s, key: $a}}, {Wait: {duration: $a}}]}",
    "{subtree: move_joints, with: {joints: {joint_1: -80 deg, joint_3: -0.1 rad}}}",
    "{task: 1}",
    "{Say: {text: $$5}}",
]


@pytest.mark.parametrize("text", RIGHT)
def test_right(robot: Robot, tmp_path: Path, text: str) -> None:
    assert found(robot, tmp_path, tree(text)) == []


WRONG = [
    (f"{{sequence: [{{Fail: {{reason: a}}}}, {{{SAY}}}]}}", "never reached: Fail before it never"),
    (f"{{selector: [{{{SAY}}}, {{{SAY}}}]}}", "is never reached: Say before it never fails"),
    (f"{{repeat: {{{SAY}}}}}", "never ends: its child cannot fail"),
    (
        "{parallel: [{repeat: Succeed}, {repeat: Succeed}], policy: any}",
        "none of its nodes can succ",
    ),
    (f"{{retry: {{{SAY}}}, attempts: 2}}", "has nothing to retry"),
    ("{repeat: {Fail: {reason: a}}}", "has nothing to repeat"),
    ("{wait_for: {inverter: {force_success: CheckHardware}}}", "never ends: its condition never"),
    (
        "{sequence: [CheckHardware, {Wait: {duration: 1}}, Succeed], memory: false}",
        "4:34 Wait acts; without memory it would be restarted",
    ),
    (
        f"{{selector: [{MOVE}, Succeed], memory: false}}",
        "4:19 SetStart acts; without memory it would be restarted",
    ),
    (
        "{timeout: {Wait: {duration: 3}}, after: 2 s}",
        "always fails after 2 s; its child takes at least 3",
    ),
    ("{timeout: {repeat: {Wait: {duration: 1}}, times: 3}, after: 2}", "takes at least 3 s"),
    ("{Wait: {duration: -1}}", "4:25 Wait.duration: -1 s is less than 0 s"),
    ("{Wait: {duration: 2 days}}", "no unit days; there are h, min, ms, s"),
    ("{Wait: {duration: .nan}}", "is not finite"),
    ("{Wait: {duration: 1:30}}", "'1:30' is not a duration in s, ms, min or h"),
    ("{Wait: {duration: true}}", "true is not a duration"),
    ("{Say: hi}", "4:13 Say needs the name of its port: write Say: {text: hi}"),
    ("{retry: CheckHardware, attempts: 0}", "retry: attempts: 0 is less than 1"),
    ("{retry: CheckHardware, attempts: 1e3}", "1000.0 is not a whole number"),
    ("{retry: CheckHardware}", "retry needs attempts: largest number of attempts"),
    ("{retry: CheckHardware, attempt: 3}", "did you mean attempts?"),
    ("{parallel: [Succeed], policy: al}", "'al' is not one of all, any; did you mean all?"),
    ("{sequence: [Succeed], memory: off}", "'off' is not true or false"),
    ("{guard: Succeed}", "guard needs the key while with a condition"),
    ("{guard: Succeed, while: {Wait: {duration: 1}}}", "Wait acts, and cannot be a condition"),
    (
        "{guard: Succeed, while: {selector: [CheckHardware, {retry: CheckHardware, attempts: 2}]}}",
        "4:58 retry may take several ticks, but the condition of while must end in one",
    ),
    (
        "{guard: Succeed, while: {guard: CheckHardware, while: CheckHardware, otherwise: pause}}",
        "guard may take several ticks",
    ),
    (
        "{sequence: [{selector: [{sequence: [{Set: {value: 1, key: $a}}, CheckHardware]},"
        " {Set: {value: b, key: $a}}]}, {Compare: {left: $a, is: '<', right: 2}}]}",
        "Compare.left: $a is a number or a text, depending on the path taken before",
    ),
    ("{wait_for: SetStart}", "SetStart acts, and cannot be a condition"),
    ("{inverter: [Succeed]}", "a list of nodes needs a node above it"),
    ("{timeout: CheckHardware, after: $x}", "timeout: after must be known before the run"),
    ("{Compare: {left: 1, is: lt, right: 2}}", "Compare.is: 'lt' is not one of !=, <"),
    ("{Compare: {left: 1, is: '<', right: a}}", "Compare.right: 'a' is not a number"),
    ("{Compare: {left: 10 sec, is: '<', right: 9 s}}", "4:7 Compare: texts have no order"),
    (
        "{sequence: [{Ask: {question: a, answer: $a}}, {Ask: {question: b, answer: $b}},"
        " {Compare: {left: $a, is: '>=', right: $b}}]}",
        "4:87 Compare: texts have no order",
    ),
    ("{Compare: {left: 1 s, is: '<', right: 9 sec}}", "Compare.right: '9 sec': no unit sec"),
    ("{Compare: {left: 1 s, is: '<', right: 9 mm}}", "Compare.right: '9 mm': no unit mm"),
    (
        "{sequence: [{Set: {value: 1 s, key: $a}}, {Compare: {left: 1 mm, is: '<', right: $a}}]}",
        "Compare.right: $a is a duration in s, ms, min or h, not a length",
    ),
    (
        "{sequence: [{Set: {value: 1, key: $a}}, {Set: {value: 2, key: $a}}, {Say: {text: b}}]}",
        "$a is written again, but no node reads the value that line 4 writes",
    ),
    (
        "{parallel: [{Set: {value: 1, key: $a}}, {Set: {value: 2, key: $a}}]}",
        "at the same time; give the two keys different names",
    ),
    (
        "{sequence: [{selector: [CheckHardware, {Set: {value: 1, key: $a}}]},"
        " {Say: {text: b, value: $a}}]}",
        "nothing has written $a when Say.value reads it",
    ),
    (
        "{sequence: [{force_success: {Set: {value: 1, key: $a}}}, {Say: {text: b, value: $a}}]}",
        "nothing has written $a",
    ),
    (
        "{sequence: [{Set: {value: 1, key: $a}}, {Say: {text: $a}}]}",
        "Say.text: $a is a number, not a text",
    ),
    ("{subtree: move_joints, with: {joints: {joint_1: 200 deg}}}", "4:46 joint_1"),
    ("{subtree: move_joints, with: {joints: {joint_9: 1}}}", "joint_9 is not a joint of the robot"),
    ("{subtree: move_joints, with: {joints: {joint1: 1}}}", "did you mean joint_1?"),
    ("{subtree: move_relative, with: {by: {jiont_2: 1}}}", "did you mean joint_2?"),
    ("{subtree: move_relative, with: {by: {joint_1: .nan}}}", "4:44 joint_1 by nan deg"),
    ("{subtree: move_relative, with: {by: {joint_1: -100}}}", "more than its range"),
    (
        "{subtree: reach, with: {arm: upright, gripper: {joint4: 0}}}",
        "4:55 joint4 is not a joint of the gripper",
    ),
    (f"{GO}goal: upright}}}}]}}", "4:82 the goal lacks joint_4; it must name joint_1, j"),
    (
        f"{GO}goal: {{joint_1: 9, joint_2: 0, joint_3: 0, joint_4: 0}}}}}}]}}",
        "4:83 joint_1",
    ),
    (
        "{sequence: [{SetStart: {start: $s}}, {PlanArm: {start: $s, goal: {joint_1: 0, joint_2: 0,"
        " joint_3: 0, joint_4: 0}, via: [{joint_1: 0, joint_2: 0, joint_3: 7}], plan: $p}}]}",
        "PlanArm: joint_3 = 401.07 deg",
    ),
    ("{subtree: move_joints, with: {joints: {joint_1: 80 dge}}}", "did you mean 80 deg?"),
    ("{subtree: move_joints, with: {joints: upwright}}", "no pose upwright; there are"),
    ("{subtree: move_joints, with: {joints: upwright}}", "did you mean upright?"),
    (
        "{subtree: reach, with: {arm: upright, gripper: {joint_4: -0.5, joint_5: 0.1}}}",
        "joint_5 = 5.7296 deg contradicts joint_4",
    ),
    (f"{{parallel: [{MOVE}, {MOVE}]}}", "only one node of a parallel may move the arm"),
    (
        "{subtree: move_joints, with: {joints: {joint_5: 0.7}}}",
        "4:46 joint_5 follows joint_4; name joint_4 instead (joint_4 = -40.107 deg gives",
    ),
    (
        "{sequence: [{subtree: open_gripper},"
        " {subtree: move_joints, with: {joints: {joint_5: 0}}}]}",
        "joint_5 follows joint_4; name joint_4 instead (joint_4 = 0 deg gives",
    ),
    ("{task: 3}", "task 3 would contain itself"),
    ("{task: 99}", "no task 99; there are 0, 1, 2"),
    ("{task: 1, with: {speed: 1}}", "task 1 has no parameters; leave {speed: 1} out"),
    ("{Say: {text: a}, name: a/b}", "has a / or more than 60 characters"),
    (
        "{subtree: reach, with: {gripper: closed,"
        " arm: {joint_1: 0, joint_2: -1.5, joint_3: -0.5}}}",
        "this pose collides",
    ),
]


@pytest.mark.parametrize(("text", "words"), WRONG, ids=range(len(WRONG)))
def test_wrong(robot: Robot, tmp_path: Path, text: str, words: str) -> None:
    mistakes = found(robot, tmp_path, tree(text))
    assert any(words in mistake for mistake in mistakes), mistakes
    assert all(not mistake.startswith("0:") for mistake in mistakes)


def test_a_wrong_first_key_of_a_node_hides_nothing_of_the_node(
    robot: Robot, tmp_path: Path
) -> None:
    mistakes = found(robot, tmp_path, f"{HEAD}tree:\n  ~: 7\n  Wait: {{}}\n")
    assert mistakes == ["5:3 Wait needs duration: duration [s]", "5:3 the key null is not a text"]


PARAMETERS = [
    ("{a: {type: angel, default: 1}}", "no type angel; there are"),
    ("{a: {type: angle, default: 5 s}}", "no unit s; there are deg, rad"),
    ("{a: {type: angle, default: 90 deg, max: 1}}", "is more than 57.2958 deg"),
    ("{a: {type: text, default: x, choices: [y]}}", "'x' is not one of y"),
    ("{a: {type: text, min: 1}}", "a text has no min and no max"),
    ("{a: {default: 1}}", "a needs a type"),
    ("{a: {type: number, defalt: 1}}", "did you mean default?"),
    ("{b: number}", "nothing in the tree uses $b"),
    ("[a]", "[a] is not a mapping of names to types"),
    ("{a: {type: text, choices: [x, x]}}", "choices: 'x' is given twice"),
]


@pytest.mark.parametrize(("text", "words"), PARAMETERS)
def test_wrong_parameters(robot: Robot, tmp_path: Path, text: str, words: str) -> None:
    mistakes = found(robot, tmp_path, tree("{Wait: {duration: $a}}", f"parameters: {text}\n"))
    assert any(words in mistake for mistake in mistakes), mistakes


def test_one_joint_misspelt_in_several_files_is_reported_in_each(
    robot: Robot, tmp_path: Path
) -> None:
    for number in (3, 4, 5):
        text = tree("{subtree: move_joints, with: {joints: {joint1: 0}}}")
        (tmp_path / f"{number}_x.yaml").write_text(text.replace("task: 3", f"task: {number}"))
    mistakes = check(robot, tmp_path).mistakes
    assert [m.place.path.name for m in mistakes] == ["3_x.yaml", "4_x.yaml", "5_x.yaml"]


def test_a_mistake_that_two_skills_see_is_reported_once(robot: Robot, tmp_path: Path) -> None:
    assert len(found(robot, tmp_path, tree(f"{GO}goal: upright}}}}]}}"))) == 1


def test_all_kinds_of_mistakes_of_a_file_at_once(robot: Robot, tmp_path: Path) -> None:
    text = f"{HEAD}speed: 1\ntree:\n  sequence:\n    - Sukseed\n    - Wait: {{duration: 5 x}}\n"
    text += "    - Say: {text: a, text: b}\n    - Say: {text: *b}\n"
    lines = [mistake.partition(":")[0] for mistake in found(robot, tmp_path, text)]
    assert lines == ["4", "7", "8", "9", "10"]


def test_one_mistake_is_reported_once(robot: Robot, tmp_path: Path) -> None:
    text = tree("{sequence: [{Meter: {height: $h}}, {Say: {text: a, value: $h}}]}")
    assert len(found(robot, tmp_path, text)) == 1


def test_everything_that_ships_is_right(robot: Robot) -> None:
    assert load_skills(EXAMPLES / "skills", reserved_names()) == []
    findings = check(robot, EXAMPLES)
    assert findings.mistakes == []
    assert len(findings.files) >= 16


@pytest.mark.parametrize("name", ["notes.yaml", "3-wave.yaml", "gone/3_x.yaml"])
def test_files_that_are_no_tasks(robot: Robot, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if path.parent.exists():
        path.write_text("a: 1\n")
    assert check(robot, None, [path]).mistakes


def test_of_a_folder_all_files_are_checked(robot: Robot, tmp_path: Path) -> None:
    (mistake,) = check(robot, None, [tmp_path]).mistakes
    assert mistake.message == "is a folder without task files"
    (tmp_path / robot.name).mkdir()
    for path in (tmp_path / "3_x.yaml", tmp_path / robot.name / "4_y.yaml"):
        path.write_text("a: 1\n")
    findings = check(robot, None, [tmp_path])
    assert {path.name for path in findings.files} == {"3_x.yaml", "4_y.yaml"}
    assert {each.place.path.name for each in findings.mistakes} == {"3_x.yaml", "4_y.yaml"}


def test_a_users_task_takes_the_place_of_a_shipped_one_only_when_it_says_so(
    robot: Robot, tmp_path: Path
) -> None:
    text = (TASKS / "arduinobot" / "1_pick.yaml").read_text()
    path = tmp_path / "1_pick.yaml"
    path.write_text(text)
    (mistake,) = check(robot, tmp_path).mistakes
    assert "task 1 is in two files" in mistake.message
    path.write_text(text + "replaces: pick\n")
    assert check(robot, tmp_path).mistakes == []
    assert Library(tmp_path).task(1).path == path


def test_a_pose_of_ones_own(robot: Robot, tmp_path: Path) -> None:
    poses = tmp_path / "poses.yaml"
    poses.write_text("poses: {left: {joint_1: 40 deg}, open: {joint_4: -0.2}}\n")
    (mistake,) = check(robot, None, [poses]).mistakes
    assert "pose open is shipped" in mistake.message
    poses.write_text(poses.read_text() + "replaces: [open]\n")
    task = tree("{subtree: move_joints, with: {joints: left}}")
    assert found(robot, tmp_path, task) == []


# A letter, a number or an indent of a shipped file changed: refused, or provably the same task.
@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["tasks/arduinobot/1_pick.yaml", "tasks/reach.yaml", "examples/3_wave.yaml"]
)
def test_every_changed_letter_of_a_key_is_refused(robot: Robot, tmp_path: Path, name: str) -> None:
    source = EXAMPLES.parent / name
    path = tmp_path / source.name
    text = source.read_text()
    if source.parent != EXAMPLES:
        text += "replaces: " + path.stem.rpartition("_")[2] + "\n"
    path.write_text(text)
    assert check(robot, None, [path]).mistakes == []
    body = text.index("tree:")
    places = [i for i in range(body, len(text)) if text[i].isalpha() and text[i - 1] in " {$"]
    free = ("description", "name:")
    changed: dict[Path, str] = {}
    for place in places:
        line = text[text.rfind("\n", 0, place) + 1 : text.find("\n", place)]
        if "#" in line or any(word in line for word in free) or "replaces" in line:
            continue
        (tmp_path / str(place)).mkdir()
        changed[tmp_path / str(place) / source.name] = line
        [*changed][-1].write_text(text[:place] + "q" + text[place + 1 :])
    refused = {mistake.place.path for mistake in check(robot, None, [*changed]).mistakes}
    assert [line for path, line in changed.items() if path not in refused] == []


def test_a_copy_of_all_that_ships_next_to_it_is_refused(robot: Robot, tmp_path: Path) -> None:
    for path in TASKS.glob("**/*.yaml"):
        shutil.copy(path, tmp_path)
    assert check(robot, tmp_path).mistakes


def test_a_subtree_by_itself_may_put_its_ports_into_a_mapping(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "look.yaml"
    text = (
        "subtree: look\ndescription: x\nports: {turn: angle, to: positions}\ntree:\n"
        "  sequence:\n"
        "    - {subtree: move_joints, with: {joints: {joint_1: $turn}}}\n"
        "    - {subtree: move_joints, with: {joints: $to}}\n"
    )
    path.write_text(text)
    assert not check(robot, None, [path]).mistakes
    path.write_text(text.replace("$turn", "$torn"))
    (mistake, unused) = check(robot, None, [path]).mistakes
    assert "nothing in the tree uses $turn" in mistake.message
    assert "there is no port for $torn; did you mean turn?" in unused.message


def test_a_subtree_written_like_a_skill_is_reported_with_the_right_form(
    robot: Robot, tmp_path: Path
) -> None:
    (mistake,) = found(robot, tmp_path, tree("open_gripper"))
    assert (
        mistake == "4:7 there is no skill open_gripper; open_gripper is a subtree: "
        "write subtree: open_gripper"
    )


def test_two_files_of_one_number_are_reported_with_a_place(robot: Robot, tmp_path: Path) -> None:
    for name in ("3_x.yaml", "3_y.yaml"):
        text = tree("{Fail: {reason: x}}").replace("name: x", f"name: {name[2]}")
        (tmp_path / name).write_text(text.replace("reason", "why") if name == "3_x.yaml" else text)
    other, mistake = check(robot, tmp_path, []).mistakes
    assert other.place.path == tmp_path / "3_x.yaml"  # is checked, too
    assert "why is not a port of Fail" in other.message
    assert (mistake.place.path, mistake.place.line) == (tmp_path / "3_y.yaml", 1)
    assert str(tmp_path / "3_x.yaml") in mistake.message


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (
            "{joint_1: 5}",
            "joint_1 = 286.48 deg is outside its limits, -90 deg to 90 deg; 5 without a unit",
        ),
        ("{jint_1: 1}", "jint_1 is not a joint"),
    ],
)
def test_a_pose_that_the_robot_cannot_take(
    robot: Robot, tmp_path: Path, pose: str, words: str
) -> None:
    (tmp_path / "poses.yaml").write_text(f"poses:\n  right_one: {{joint_1: 1}}\n  far: {pose}\n")
    (mistake,) = check(robot, tmp_path, [tmp_path / "poses.yaml"]).mistakes
    assert mistake.place.line == 3
    assert words in mistake.message
