"""`armtree check`: parameters whose values are not known yet, and files that are not tasks."""

import re
from pathlib import Path

import pytest

from hardware import Robot
from skills.motion import Body, Box, PlanTimeout, Pool, Request, Result, Sphere, Verify, World
from tests.trees.test_check import HEAD, found, tree
from trees import Library
from trees.check import check

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
    (
        "poses.yaml",
        "poses: {lying: {joint_1: 0, joint_2: -1.5, joint_3: -0.5}}\n",
        "1:9 this pose collides",
    ),
    ("poses.yaml", "poses: [a]\n", "1:8 poses: [a] is not a mapping of names"),
    ("poses.yaml", "poses:\n", "1:1 poses: nothing is not a mapping of names"),
    ("poses.yaml", "poses: {x: {}}\n", "1:12 {} names no joint"),
    (
        "poses.yaml",
        "poses: {opne: {joint_4: 0}}\nreplaces: [opne]\n",
        "2:1 replaces: pose opne is not shipped; there are closed, folded, open, right, upright; "
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
        "4:1 replaces: task 3 is not shipped; there are 0_home, 1_pick, 2_rest",
    ),
    (
        "look.yaml",
        "subtree: look\ndescription: x\nports: {}\nreplaces: look\ntree: Succeed\n",
        "4:1 replaces: subtree look is not shipped; there are follow, follow_leader, go, "
        "move_joints, move_mixed and 5 more",
    ),
    (
        "poses.yaml",
        "poses: {opne: {joint_4: 0}}\nreplaces: [open]\n",
        "2:1 replaces: this file has no pose open; there is only opne",
    ),
    ("3_x.YAML", HEAD, "the name of a task file must end in .yaml"),
    ("look.yml", HEAD, "the name of a task file must end in .yaml"),
    (
        "look.yaml",
        "subtree: look\ndescription: x\nports: {a: {type: text, output: true}}\n"
        "tree: {Set: {value: 1, key: $a}}\n",
        "4:7 subtree look: a is a text, but a number is written",
    ),
    (
        "look.yaml",
        "subtree: look\ndescription: x\nports: {a: {type: text, output: true}}\n"
        "tree: {selector: [CheckHardware, {Set: {value: b, key: $a}}]}\n",
        "4:7 subtree look does not write a on every path through it",
    ),
    (
        "look.yaml",
        "subtree: look\ndescription: x\nports: {a: {type: text, output: true, default: b}}\n"
        "tree: {Set: {value: b, key: $a}}\n",
        "3:39 ports: a is an output, and outputs have no default",
    ),
]


@pytest.mark.slow
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


ONCE = [
    (
        "",
        "{sequence: [{subtree: open_gripper}, {Wait: {duration: 1 s}}], memory: false}",
        "4:19 SetStart acts; without memory it would be restarted",
    ),
    (
        "",
        "{wait_for: {subtree: open_gripper}}",
        "4:18 open_gripper (with SetStart) acts, and cannot be a condition",
    ),
    (
        "",
        "{sequence: [{selector: [{sequence: [{Set: {key: $a, value: 1}}, CheckHardware]},"
        " {Set: {key: $a, value: x}}]}, {Compare: {left: $a, is: '<', right: 2}}]}",
        "4:135 Compare.left: $a is a number or a text, depending on the path taken before",
    ),
    ("parameters: [a]\n", "Succeed", "4:13 parameters: [a] is not a mapping of names"),
    (
        "parameters: {a: {type: length, default: 0.005}}\n",
        "{subtree: move_joints, with: {joints: {joint_1: $a}}}",
        "5:55 joints: $a is a length in m, cm or mm, not an angle in rad or deg",
    ),
    (
        "parameters: {a: {type: number, default: 2}}\n",
        "{repeat: Succeed, times: $a}",
        "5:32 repeat: times: $a is a number, not a whole number",
    ),
    (
        "parameters: {a: {type: integer, default: 3}}\n",
        "{Compare: {left: $a, is: '==', right: abc}}",
        "5:45 Compare.right: 'abc' is not a whole number",
    ),
    (
        "parameters: {a: {type: length, default: 0.1}}\n",
        "{timeout: {Wait: {duration: 3}}, after: $a}",
        "5:47 timeout: after: $a is a length in m, cm or mm, not a duration",
    ),
    (
        "",
        "{Wait: 5}",
        "4:14 Wait needs the name of its port: write Wait: {duration: 5}",
    ),
    (
        "",
        "{subtree: reach, with: upright}",
        "4:30 subtree reach needs the names of its ports: write with: {arm: upright, ",
    ),
    ("", "{Ask: {question: '  '}}", "4:24 Ask: there is no question"),
    (
        "",
        "{Ask: {question: a, choices: [left, right, left]}}",
        "4:50 Ask: the choice left is given twice",
    ),
    ("", "{Ask: {question: a, choices: ['']}}", "4:37 Ask: a choice is empty"),
    ("", "{Ask: {question: a, within: 0}}", "4:35 Ask.within: 0 s is less than 0.001 s"),
    (
        "",
        "{AddMesh: {body: b, file: nosuch.stl, position: [0, 0, 1]}}",
        "4:33 AddMesh: there is no file nosuch.stl; paths are relative to the working directory",
    ),
    (
        "",
        "{AddMesh: {body: b, file: /etc/passwd, position: [0, 0, 1]}}",
        "4:33 AddMesh: /etc/passwd is not an STL, DAE or OBJ file",
    ),
    (
        "",
        "{Attach: {body: b, link: claw_suport}}",
        "4:32 Attach: the robot has no link claw_suport;",
    ),
    (
        "",
        "{sequence: [{SetStart: {start: $s}}, {ReachPoint: {start: $s, point: [0, 0, 1],"
        " tool: nolink, target: $t}}]}",
        "4:93 ReachPoint: the robot has no link nolink; it has ",
    ),
    (
        "",
        "{sequence: [{SetStart: {start: $s}}, {ReachPoint: {start: $s, point: [0, 0, 1],"
        " direction: [0, 0.0, -0], target: $t}}]}",
        "4:98 ReachPoint: direction is 0, 0, 0",
    ),
    (
        "parameters: {a: {type: duration, min: 5 s, max: 1 s}}\n",
        "{Wait: {duration: $a}}",
        "4:49 parameters: a: max is less than min",
    ),
    (
        "parameters: {a: {type: text, default: $b}}\n",
        "{Say: {text: $a}}",
        "4:39 parameters: a: a default is a value, not the reference '$b'; for a text that "
        "begins with a $, write $$",
    ),
    ("parameters: {1a: text}\n", "Succeed", "4:14 parameters: '1a' is not a name"),
    ("", "{subtree: move_joints, with: {joints: {}}}", "4:45 joints: {} names no joint"),
    (
        "",
        "{subtree: reach, with: {arm: uprigth, gripper: open}}",
        "4:36 arm: no pose uprigth; there are folded, right, upright; did you mean upright?",
    ),
    (
        "parameters: {a: {type: number, default: 1}}\n",
        "{sequence: [{Say: {text: a, value: $a}}, {Set: {value: 2, key: $a}}]}",
        "5:70 Set.key: $a is a parameter, which must not be written",
    ),
    (
        "parameters: {a: number}\n",
        "{sequence: [{Say: {text: a, value: $a}}, {Set: {value: 2, key: $a}}]}",
        "5:70 Set.key: $a is a parameter, which must not be written",
    ),
    (
        "parameters: {a: number}\n",
        "{sequence: [{Say: {text: a, value: $a}}, {subtree: writes, with: {to: $a}}]}",
        "5:77 subtree writes: to: $a is a parameter, which must not be written",
    ),
    (
        "",
        "{timeout: {wait_for: {Compare: {left: 3, is: '<', right: 2}}}, after: 1}",
        "4:28 wait_for has nothing to wait for: its condition is known before the run",
    ),
    (
        "parameters: {a: {type: number, default: 1}}\n",
        "{wait_for: {selector: [{Compare: {left: $a, is: '<', right: 2}}]}}",
        "5:18 wait_for has nothing to wait for: its condition is known before the run",
    ),
    (
        "parameters: {a: {type: druation, default: 3 s, min: 1 s, choices: [a]}}\n",
        "{Wait: {duration: $a}}",
        "4:24 parameters: a: no type druation; there are number, ",
    ),
    (
        "parameters: {a: {type: int, default: 5}}\n",
        "{repeat: Succeed, times: $a}",
        "4:24 parameters: a: no type int;",
    ),
    (
        "parameters: {a: {type: position, default: upright}}\n",
        "{subtree: move_joints, with: {joints: $a}}",
        "4:24 parameters: a: no type position;",
    ),
]


@pytest.mark.parametrize(("above", "text", "words"), ONCE)
def test_what_is_reported_once(
    robot: Robot, tmp_path: Path, above: str, text: str, words: str
) -> None:
    (tmp_path / "writes.yaml").write_text(
        "subtree: writes\ndescription: x\nports: {to: {type: number, output: true}}\n"
        "tree: {Set: {value: 1, key: $to}}\n"
    )
    (mistake,) = found(robot, tmp_path, tree(text, above))
    assert mistake.startswith(words)


def test_a_subtree_may_not_write_to_what_it_reads(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "look.yaml"
    text = "subtree: look\ndescription: x\nports: {to: number}\ntree: {Set: {value: 1, key: $to}}\n"
    path.write_text(text)
    words = "Set.key: $to is an input port; declare it with output: true to write it"
    assert [m.message for m in check(robot, None, [path]).mistakes] == [words]
    task = tree("{sequence: [{Set: {value: 3, key: $a}}, {subtree: look, with: {to: $a}}]}")
    (tmp_path / "3_x.yaml").write_text(task)
    assert {m.message for m in check(robot, tmp_path).mistakes} == {words}


@pytest.mark.parametrize(
    ("name", "data", "where"),
    [
        ("3_x.yaml", HEAD.encode() + b"# caf\xe9\ntree: Succeed\n", "# caf\ufffd\n         ^"),
        ("3-x.yaml", HEAD.encode(), "task: 3\n    ^"),
        ("3_x.yml", HEAD.encode(), "task: 3\n    ^"),
        ("look.yml", b"# mine\nsubtree: look\n", "subtree: look\n    ^"),
    ],
)
def test_a_file_that_is_not_read_is_shown(
    robot: Robot, tmp_path: Path, name: str, data: bytes, where: str
) -> None:
    (tmp_path / name).write_bytes(data)
    (mistake,) = check(robot, tmp_path).mistakes
    assert mistake.place.line
    assert where in str(mistake)


def test_a_file_that_is_misnamed_hides_no_other(robot: Robot, tmp_path: Path) -> None:
    for name in ("3-x.yaml", "4_x.yaml"):
        (tmp_path / name).write_text(tree("Sukseed").replace("task: 3", "task: 4"))
    findings = check(robot, None, [tmp_path / "3-x.yaml", tmp_path / "4_x.yaml"])
    reported = [(mistake.place.path.name, mistake.place.line) for mistake in findings.mistakes]
    assert reported == [("3-x.yaml", 1), ("4_x.yaml", 4)]
    assert [path.name for path in findings.files] == ["3-x.yaml", "4_x.yaml"]


@pytest.mark.parametrize("name", ["compose.yml", ".hidden.yaml", ".#3_x.yaml", "Notes.YAML"])
def test_files_that_are_others_business(robot: Robot, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("services: {}\n")
    findings = check(robot, tmp_path)
    assert findings.mistakes == []
    assert [note.place.path.name for note in findings.notes] == [name] * (name[0] != ".")


MESH = "solid x\nfacet normal 0 0 1\nouter loop\n{}vertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
BODIES = [
    ("{AddMesh: {body: b, file: PATH/none.stl, position: [1, 0, 0]}}", "no file .*none.stl"),
    ("{AddMesh: {body: b, file: PATH/nan.stl, position: [1, 0, 0]}}", "b: The mesh .*nan.stl"),
    ("{AddBox: {body: base_link, size: [1, 1, 1], position: [1, 0, 0]}}", "has a base_link"),
    ("{AddMesh: {body: b, file: PATH/flat.stl, position: [1, 0, 0]}}", ""),
    ("{AddBox: {body: b, size: [1, 1, 1], position: [1, 0, 0], touches: [later]}}", ""),
]  # fmt: skip


@pytest.mark.parametrize(("text", "why"), BODIES)
def test_a_body_that_no_planner_can_load_is_refused(
    robot: Robot, tmp_path: Path, text: str, why: str
) -> None:
    (tmp_path / "nan.stl").write_text(MESH.format("vertex nan 0 0\n"))
    (tmp_path / "flat.stl").write_text(MESH.format("vertex 0 0 0\n"))
    mistakes = found(robot, tmp_path, tree(text.replace("PATH", str(tmp_path))))
    assert len(mistakes) == bool(why)
    assert not why or re.search(why, str(mistakes[0]))


@pytest.mark.parametrize("key", ["body", '"body"', "body "])
def test_a_body_that_another_task_adds_may_be_used(robot: Robot, tmp_path: Path, key: str) -> None:
    """It stays for the next task of the same run."""
    (used,) = found(robot, tmp_path, tree("{RemoveBody: {body: cup}}"))
    assert "no node before this one adds the body cup" in str(used)
    added = f"{{AddSphere: {{{key}: cup, radius: 1 cm, position: [0, 0, 1]}}}}"
    (tmp_path / "40_other.yaml").write_text(
        f"task: 40\nname: other\ndescription: z\ntree: {added}\n"
    )
    assert not check(robot, tmp_path).mistakes


def test_a_body_of_the_world_may_be_used_and_hit(robot: Robot, tmp_path: Path) -> None:
    text = "{sequence: [{Attach: {body: cup, link: claw_support}}, {subtree: move_joints, with: "
    text += "{joints: {joint_1: 20 deg}}}]}"
    (tmp_path / "40_x.yaml").write_text(f"task: 40\nname: x\ndescription: z\ntree: {text}\n")
    cup = Body("cup", Sphere(0.01), (0.0, 0.0, 1.0))
    assert "adds the body cup" in str(check(robot, tmp_path).mistakes[0])
    assert not check(robot, tmp_path, world=World((cup,))).mistakes
    wall = Body("wall", Box((0.5, 0.5, 0.5)), (0.0, 0.0, 0.3))
    hit = check(robot, tmp_path, world=World((cup, wall))).mistakes
    assert "deep in wall" in str(hit[0])


def test_what_is_not_checked_in_time_is_noted(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask = Pool.ask

    def late(pool: Pool, request: Request) -> Result:
        checks = isinstance(request, Verify) and request.timeout > 0
        return PlanTimeout(5.0) if checks else ask(pool, request)

    monkeypatch.setattr(Pool, "ask", late)
    (tmp_path / "poses.yaml").write_text("poses:\n  up: {joint_1: 20 deg}\n")
    findings = check(robot, tmp_path)
    assert not findings.mistakes
    assert "not checked for collisions within 5 s" in str(findings.notes[0])


def test_a_task_for_another_robot_is_noted_and_leaves_the_others_alone(
    robot: Robot, tmp_path: Path
) -> None:
    """A joint that is only misspelt is no sign of another robot."""
    for number, joint in ((7, "shoulder_pan"), (8, "joint_7"), (9, "joint_1")):
        move = f"{{subtree: move_joints, with: {{joints: {{{joint}: 20 deg}}}}}}"
        text = f"task: {number}\nname: x\ndescription: y\ntree: {move}\n"
        (tmp_path / f"{number}_x.yaml").write_text(text)
    (tmp_path / "so101").mkdir()
    (tmp_path / "7_x.yaml").replace(tmp_path / "so101" / "7_x.yaml")
    assert check(robot, tmp_path).notes == []
    (tmp_path / "so101" / "7_x.yaml").replace(tmp_path / "7_x.yaml")
    found = check(robot, tmp_path)
    assert [each.place.path.name for each in found.mistakes] == ["7_x.yaml", "8_x.yaml"]
    (note,) = found.notes
    assert note.message == (
        "names joints that the arduinobot lacks: shoulder_pan. If this file is for another robot, "
        f"move it to the subfolder of {tmp_path} with the name of that robot"
    )


def test_a_loop_of_links_is_a_mistake(robot: Robot, tmp_path: Path) -> None:
    link = tmp_path / "5_x.yaml"
    link.symlink_to(link)
    for mistakes in check(robot, tmp_path).mistakes, check(robot, None, [link]).mistakes:
        assert [each.message for each in mistakes] == [
            "cannot be read: Too many levels of symbolic links"
        ]


@pytest.mark.parametrize("kind", ["ange", "text", "number", "[angle]"])
def test_a_bound_without_a_unit_beside_a_wrong_type(
    robot: Robot, tmp_path: Path, kind: str
) -> None:
    file = tmp_path / "20_swing.yaml"
    swing = f"{{type: {kind}, default: 20 deg, max: 60}}"
    file.write_text(
        f"task: 20\nparameters:\n  swing: {swing}\ntree:\n  Wait: {{duration: $swing}}\n"
    )
    said = [mistake.message for mistake in check(robot, None, [file]).mistakes]
    assert "max: 60 without a unit is 60 rad; did you mean 60 deg?" in said
