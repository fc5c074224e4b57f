"""Independent mistakes are reported in the same check, and nothing else is.

What is wrong alone is put beside, into and around what else is wrong. ARMTREE_PAIRS tries more.
"""

import os
import random
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Robot
from skills import Skill, SkillError, refuse
from tests.trees.test_build import WRONG as LINES
from tests.trees.test_check import WRONG
from tests.trees.test_check_files import ONCE
from trees.check import check

pytestmark = pytest.mark.slow

PAIRS = int(os.environ.get("ARMTREE_PAIRS", "60"))  # of each sort
HEAD = "task: {}\nname: x\ndescription: y\n"
SUB = "subtree: {}\ndescription: y\nports: {}\ntree: {}\n"


def nodes() -> Iterator[str]:
    """Nodes that are wrong, each by itself."""
    yield from (text for text, _ in WRONG)
    yield from (text for above, text, _ in ONCE if not above)
    for lines, *_ in LINES:
        if all(line.startswith("- ") and not line.endswith(":") for line in lines):
            items = (line[2:] for line in lines)
            yield f"{{sequence: [{', '.join(f'{{{i}}}' if ':' in i else i for i in items)}]}}"


# But what a file says of itself, and of lines.
NODES = [text for text in nodes() if text not in ("{task: 3}", "{task: 99}")]
NODES = [text for text in NODES if not re.search(r"\{Set: .*\{Set: .*key: \$a\}\}[],]", text)]


def reported(robot: Robot, folder: Path, files: Mapping[str, str]) -> dict[str, set[str]]:
    """What is wrong with files, in words that do not depend on where it stands, by file."""
    for name, text in files.items():
        (folder / name).write_text(text)
    found: dict[str, set[str]] = {name: set() for name in files}
    for mistake in check(robot, folder).mistakes:
        assert mistake.place.excerpt, mistake
        words = re.sub(r"\$(\w+?)_[23]\b", r"$\1", mistake.message)
        words = re.sub(r"there are [^;]*", "", words)
        flow = r"^\S+ (never ends|has nothing|always fails|is never)"
        found[mistake.place.path.name].add(re.sub(flow, r"\1", words))
    return found


def own(text: str, number: int) -> str:
    """The same with keys of its own."""
    return re.sub(r"\$(\w+)", rf"$\1_{number}", text)


def in_subtree(message: str) -> str:
    """What is reported in a subtree: it has ports, a task has parameters."""
    declares = message.startswith("there is no parameter for")
    return message.replace("parameter", "port") if declares else message


@pytest.fixture(scope="module")
def alone(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """What is reported of every node alone."""
    files = {f"{n}_x.yaml": f"{HEAD.format(n)}tree: {text}\n" for n, text in enumerate(NODES, 1000)}
    found = reported(robot, tmp_path_factory.mktemp("alone"), files)
    assert all(found.values())
    return dict(zip(NODES, found.values(), strict=True))


BESIDE = {
    "siblings": "tree: {{sequence: [{{force_success: {}}}, {}]}}\n",
    "in a subtree": "tree: {{sequence: [{{force_success: {}}}, {{subtree: s{}}}]}}\n",
    "in a subtree that is called wrongly": (
        "tree: {{sequence: [{{force_success: {}}}, {{subtree: s{}, with: {{port: 5}}}}]}}\n"
    ),
}


@pytest.mark.parametrize("where", BESIDE)
def test_pairs(robot: Robot, tmp_path: Path, alone: dict[str, set[str]], where: str) -> None:
    rng, files, wanted = random.Random(where), dict[str, str](), dict[str, set[str]]()
    for number in range(1000, 1000 + PAIRS):
        first, second = rng.choice(NODES), rng.choice(NODES)
        task, sub = f"{number}_x.yaml", f"s{number}.yaml"
        wanted[task] = set(alone[first])
        if where == "siblings":
            third = rng.choice(NODES)
            inner = f"{{force_success: {own(second, 2)}}}, {{inverter: {own(third, 3)}}}"
            wanted[task] |= alone[second] | alone[third]
        else:
            inner = str(number)
            wanted[sub] = {in_subtree(message) for message in alone[second]}
            files[sub] = SUB.format(f"s{number}", "{}", f"{{force_success: {second}}}")
        if "wrongly" in where:
            wanted[task].add('port: 5 is not a text; did you mean "5"?')
            tree = f"{{sequence: [{{Say: {{text: $port}}}}, {{force_success: {second}}}]}}"
            files[sub] = SUB.format(f"s{number}", "{port: text}", tree)
        files[task] = HEAD.format(number) + BESIDE[where].format(first, inner)
    assert reported(robot, tmp_path, files) == wanted


AROUND = [
    ("{sequence: [X, {Say: {txt: a}}]}", "txt is not a port of Say"),
    ("{sequence: [X, {Wait: {duration: -1, n: 1}}]}", "n is not a port of Wait"),
    (
        "{sequence: [X, {subtree: reach, with: {arm: {joint_1: 9}, griper: open}}]}",
        "joint_1 = 515.66 deg",
    ),
    (
        "{sequence: [X, {subtree: reach, with: {arm: {joint_1: 9}, griper: open}}]}",
        "griper is not a p",
    ),
    ("{sequence: [X, {subtree: reach, with: {arm: upright}}]}", "needs gripper"),
    ("{sequence: [X, {subtre: reach, with: {arm: upright, gripper: open}}]}", "mean subtree?"),
    ("{sequence: [X, {subtree: reach, with: 5}]}", "needs the names of its ports"),
    ("{sequence: [X, {Say: {text: $b}}]}", "nothing has written $b"),
    ("{sequence: [X, {timeout: {Wait: {duration: 9}}, after: 2}]}", "always fails after 2 s"),
    (
        "{sequence: [X, {subtree: reach, with: {gripper: closed,"
        " arm: {joint_1: 0, joint_2: -1.5, joint_3: -0.5}}}]}",
        "this pose collides",
    ),
    ("{sequence: [X, {Attach: {body: b, link: claw}}]}", "no link claw"),
    ("{sequence: [X, {AddMesh: {body: b, file: a.stl, position: [0, 0, 1]}}]}", "no file a.stl"),
    ("{sequence: [X], name: a/b}", "has a / or more"),
    ("{sequence: [X], memory: off}", "'off' is not true or false"),
    ("{sequnce: [X]}", "did you mean sequence?"),
    ("{squence: [X, {Say: {txt: a}}]}", "txt is not a port of Say"),
    ("{foo: [X]}", "foo takes no list of nodes"),
    ("{sequence: X}", "sequence needs a list of nodes"),
    ("{sequence: [X], parallel: [Succeed]}", "sequence and parallel are several nodes"),
    ("{inverter: [X]}", "a list of nodes needs a node above"),
    ("{retry: X}", "retry needs attempts"),
    ("{retry: X, attempts: 0}", "attempts: 0 is less than 1"),
    ("{retyr: X, attempts: 2}", "did you mean retry?"),
    ("{repeat: X, times: 2, nmae: x}", "unknown key nmae"),
    ("{timeout: X, after: 5 x}", "no unit x"),
    ("{timeout: X, aftr: 20 h}", "did you mean after?"),
    ("{parallel: [X], policy: al}", "did you mean all?"),
    ("{guard: X}", "guard needs the key while"),
    ("{guard: X, while: {Wait: {duration: 1}}}", "Wait acts, and cannot be a condition"),
    ("{guard: X, whle: CheckHardware}", "did you mean while?"),
    ("{guard: X, while: CheckHardware, otherwise: stop}", "'stop' is not one of"),
]


def test_around(robot: Robot, tmp_path: Path, alone: dict[str, set[str]]) -> None:
    rng, files, made = random.Random(1), dict[str, str](), list[tuple[str, str, str]]()
    for around, words in AROUND:
        for text in rng.sample(NODES, min(len(NODES) // 2, PAIRS // 10)):
            number = 1000 + len(made)
            made.append((around, words, text))
            files[f"{number}_x.yaml"] = f"{HEAD.format(number)}tree: {around.replace('X', text)}\n"
    found = reported(robot, tmp_path, files)
    for (around, words, text), messages in zip(made, found.values(), strict=True):
        assert any(words in message for message in messages), (around, text)
        lost = alone[text] - messages
        # What a node around it may end is not a mistake, and a value may be shown shorter.
        assert all(each.startswith(("never ends", "a node is")) for each in lost), (around, text)


HEADS = [
    ("speed: 1\n", "unknown key speed"),
    ("grammar: 2\n", "grammar: 2 is not supported"),
    ("replaces: pik\n", "replaces: task"),
    ("parameters: {a: {type: angle, default: 5 s}}\n", "the default of a: '5 s': no unit s"),
    ("parameters: {a: {type: angle, min: 2, max: 1}}\n", "max is less than min"),
    ("parameters: {a: {typ: angle}}\n", "did you mean type?"),
    ("parameters: {a: angel}\n", "no type angel"),
    ("parameters: {a: angle, unused: text}\n", "nothing in the tree uses $unused"),
    ("paramters: {a: angle}\n", "did you mean parameters?"),
]


def test_above(robot: Robot, tmp_path: Path, alone: dict[str, set[str]]) -> None:
    use = "{subtree: move_joints, with: {joints: {joint_1: $a}}}"
    some = [text for text in NODES if "$a" not in text]
    rng, files, made = random.Random(2), dict[str, str](), list[tuple[str, str]]()
    for head, words in HEADS:
        for text in rng.sample(some, min(len(NODES) // 2, PAIRS // 10)):
            number = 1000 + len(made)
            made.append((words, text))
            nodes = f"{{force_success: {text}}}, {use if 'param' in head else 'Succeed'}"
            tree = f"tree: {{sequence: [{nodes}]}}\n"
            files[f"{number}_x.yaml"] = HEAD.format(number) + head + tree
    found = reported(robot, tmp_path, files)
    for (words, text), messages in zip(made, found.values(), strict=True):
        (own,) = messages - alone[text]
        assert words in own, text


TOGETHER = [
    (
        "{subtree: reach, with: {arm: {joint_1: 9, joint_7: 0.2, joint_3: x},"
        " griper: {joint_4: 5}}}",
        ["4:37 joint_1 = 515.66 deg is outside",
         "4:49 joint_7 is not a joint of the arm; the arm has joint_1, joint_2, "
         "joint_3; "
         "did you mean joint_2?",
         "4:72 arm: 'x' is not an angle",
         "4:76 griper is not a port of subtree reach; there are arm, gripper; did you mean "
         "gripper?",
         "4:85 joint_4 = 286.48 deg is outside"],
    ),
    (
        "{subtree: reach, with: {arm: {joint_1: 9, joint_2: 9}, gripper: {joint_4: -0.3,"
        " joint_5: 0.1}}}",
        ["4:36 joint_3 is missing",
         "4:37 joint_1 = 515.66 deg is outside",
         "4:49 joint_2 = 515.66 deg is outside",
         "4:87 joint_5 = 5.7296 deg contradicts joint_4"],
    ),
    (
        "{subtree: move_relative, with: {by: {joint_1: 100, joint_2: 99, jiont_3: 1, joint_4: x}}}",
        ["4:44 joint_1 by 5729.6 deg is more than",
         "4:58 joint_2 by 5672.3 deg is more than",
         "4:71 jiont_3 is not an actuated joint; choose from joint_1, joint_2, joint_3, "
         "joint_4"
         "; did you mean joint_3?",
         "4:92 by: 'x' is not an angle"],
    ),
    (
        "{sequence: [{SetStart: {start: $s}}, {PlanArm: {start: {joint_1: 0}, goal: {joint_1: 9,"
        " joint_2: 9, jiont_3: 0, joint_4: x}, via: [{joint_1: 9, joint_2: 0, joint_3: 0}, nowhere,"
        " {joint_1: x, joint_2: 8, joint_3: 0}], plan: 5}}]}",
        ["4:62 PlanArm: the start lacks joint_2, joint_3, joint_4",
         "4:83 PlanArm: joint_1 = 515.66 deg",
         "4:95 PlanArm: joint_2 = 515.66 deg",
         "4:107 PlanArm: jiont_3 is not a joint of the robot; it has joint_1, joint_2, joint_3 "
         "(arm) and joint_4 (gripper); did you mean joint_3?",
         "4:128 PlanArm.goal: 'x' is not an angle",
         "4:139 PlanArm: joint_1 = 515.66 deg",
         "4:176 PlanArm.via: no pose nowhere",
         "4:195 PlanArm.via: 'x' is not an angle",
         "4:198 PlanArm: joint_2 = 458.37 deg",
         "4:230 PlanArm writes plan"],
    ),
    (
        "{Ask: {question: '', choices: [a, a, ''], wanted: b, within: 0, qestion: x}}",
        ["4:24 Ask: there is no question",
         "4:41 Ask: the choice a is given twice",
         "4:44 Ask: a choice is empty",
         "4:57 Ask: b is wanted, but the choices are a, a",
         "4:68 Ask.within: 0 s is less than",
         "4:71 qestion is not a port of Ask"],
    ),
    (
        "{AddMesh: {body: 5, file: no.stl, position: [0, x, 1 s], rotation: [1, 2], touch: [a]}}",
        ['4:24 AddMesh.body: 5 is not a text; did you mean "5"?',
         "4:33 AddMesh: there is no file no.stl",
         "4:55 AddMesh.position: 'x' is not a length",
         "4:58 AddMesh.position: '1 s': no unit s",
         "4:74 AddMesh.rotation: [1, 2] has 2 items, not 3",
         "4:82 touch is not a port of AddMesh"],
    ),
    (
        "{sequence: [{SetStart: {start: $s}}, {ReachPoint: {start: $s, point: [0, 0], target: t,"
        " direction: [0, 0, 0], axis: [0, 0, 0], tool: no, group: amr}}]}",
        ["4:76 ReachPoint.point: [0, 0] has 2 items",
         "4:92 ReachPoint writes target",
         "4:106 ReachPoint: direction is 0, 0, 0",
         "4:123 ReachPoint: axis is 0, 0, 0",
         "4:140 ReachPoint: the robot has no link no",
         "4:151 ReachPoint: the robot has no group amr; it has arm, gripper; did you mean arm?"],
    ),
    (
        "{retry: {Wait: {duration: -1, x: 1}}, attempts: 0, backoff: 3 kg, foo: 1, name: a/b}",
        ["4:33 Wait.duration: -1 s is less than",
         "4:37 x is not a port of Wait",
         "4:55 retry: attempts: 0 is less than 1",
         "4:67 retry: backoff: '3 kg': no unit kg",
         "4:73 unknown key foo",
         "4:87 name: 'a/b' has a /"],
    ),
    (
        "{guard: {Wait: {duration: 1 kg}}, while: {Wait: {duration: 2 kg}}, otherwise: stop,"
        " every: 0}",
        ["4:33 Wait.duration: '1 kg'",
         "4:48 Wait acts, and cannot be a condition",
         "4:66 Wait.duration: '2 kg'",
         "4:85 guard: otherwise: 'stop' is not one of",
         "4:98 guard: every: 0 s is less than"],
    ),
    (
        "{sequence: {Wait: {duration: -1}, Say: {text: 5}}}",
        ["4:18 sequence needs a list of nodes",
         "4:36 Wait.duration: -1 s is less than",
         '4:53 Say.text: 5 is not a text; did you mean "5"?'],
    ),
    (
        "{sequence: [{Fail: {reason: a}}, {Fail: {reason: b}}, {Say: {text: c}}]}",
        ["4:40 Fail is never reached", "4:61 Say is never reached"],
    ),
]  # fmt: skip

ONE_SLIP = [
    "{sequence: [{SetStart: $s}, {subtree: go, with: {start: $s, goal: $s}}]}",
    "{sequence: [{SetStart: {start: s}}, {subtree: go, with: {start: $s, goal: $s}}]}",
    "{sequence: [{SetStrat: {start: $s}}, {subtree: go, with: {start: $s, goal: $s}}]}",
    "{sequence: [{subtree: begn, with: {where: $here}}, {Say: {text: a, value: $here}}]}",
    "{sequence: [{Set: {value: 1, key: $a}}, {Frobnicate: {x: $a}}, {Set: {value: 1, key: $a}}]}",
    "{timeout: {Wait: {duration: 3}}, after: 2 x}",
    "{timeout: {Wait: {duration: 3}}, aftr: 5}",
    "{repeat: Succeed, times: x}",
    "{repeat: Succeed, tmes: 2}",
    "{subtree: reach, with: {arm: {joint_1: 0, jiont_2: 0, joint_3: 0}, gripper: open}}",
    "{subtree: reach, with: {amr: upright, gripper: open}}",
    "{sequence: [{AddSphere: {body: b, radius: 1 cm, position: [0, 0, 1]}},"
    " {Attach: {body: b, lnk: claw_support}}]}",
]


def test_together(robot: Robot, tmp_path: Path) -> None:
    for number, (text, _) in enumerate(TOGETHER, 1000):
        (tmp_path / f"{number}_x.yaml").write_text(f"{HEAD.format(number)}tree: {text}\n")
    found: dict[str, list[str]] = {f"{n}_x.yaml": [] for n, _ in enumerate(TOGETHER, 1000)}
    for m in check(robot, tmp_path).mistakes:
        found[m.place.path.name].append(f"{m.place.line}:{m.place.column} {m.message}")
    for (_, wanted), messages in zip(TOGETHER, found.values(), strict=True):
        assert len(messages) == len(wanted), messages
        assert all(map(str.startswith, messages, wanted)), messages


def test_one_slip_is_reported_once(robot: Robot, tmp_path: Path) -> None:
    files = {
        f"{number}_x.yaml": f"{HEAD.format(number)}tree: {text}\n"
        for number, text in enumerate(ONE_SLIP, 1000)
    }
    for text, messages in zip(ONE_SLIP, reported(robot, tmp_path, files).values(), strict=True):
        assert len(messages) == 1, (text, messages)


class Picky(Skill):
    """Refuses several things at once."""

    INPUT_PORTS: dict[str, PortInformation] = {
        name: PortInformation(float, description=name) for name in ("litres", "bars")
    }

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        """Refuse whatever is given."""
        refuse([SkillError(f"{port} is odd").at(port) for port in inputs])

    def on_start(self) -> Status:
        """Do nothing."""
        return Status.SUCCESS


def test_a_skill_of_ones_own_may_refuse_several_values(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "3_x.yaml").write_text(f"{HEAD.format(3)}tree: {{Picky: {{litres: 1, bars: 2}}}}\n")
    reported = [(m.place.column, m.message) for m in check(robot, tmp_path).mistakes]
    assert reported == [(24, "Picky: litres is odd"), (33, "Picky: bars is odd")]


def test_the_files_that_a_task_needs(robot: Robot, tmp_path: Path) -> None:
    look = "{sequence: [{Wait: {duration: $a}}, {Set: {value: 5, key: $b}}, {Say: {text: 5}}]}"
    calls = "{subtree: look, with: {a: 1, b: $c, d: 1}}, {Say: {text: c, value: $c}}"
    moves = "{subtree: move_joints, with: {joints: %s}}"
    far = "515.66 deg is outside its limits, -90 deg to 90 deg; 9 without a unit is 9 rad; "
    far += "did you mean 9 deg?"
    files = {
        "poses.yaml": "poses: {left: {joint_1: x}, far: {joint_1: 9, joint_2: 9}, open: closed}\n",
        "look.yaml": "subtree: lok\nports: {a: {type: angel}, b: {type: text, output: yes}}\n"
        f"tree: {look}\n",
        "3_y.yaml": "task: 4\nname: x\ndescription: y\n"
        f"tree: {{sequence: [{calls}, {moves % 'lfet'}, {moves % 'left'}]}}\n",
    }
    assert reported(robot, tmp_path, files) == {
        "poses.yaml": {
            "'x' is not an angle in rad or deg, such as 20 deg",
            f"far: joint_1 = {far}",
            f"far: joint_2 = {far}",
            "no pose closed; ",
            "pose open is shipped; to replace it, add it to replaces",
        },
        "look.yaml": {
            "the key description is missing",
            "the file is named look.yaml but says subtree lok; rename the file, or change the line",
            "ports: a: no type angel; ; did you mean angle?",
            "'yes' is not true or false",
            'Say.text: 5 is not a text; did you mean "5"?',
        },
        "3_y.yaml": {
            "the file is named for task 3 but says task 4; rename the file, or change the line",
            "the file is named 3_y.yaml but says name x; rename the file, or change the line",
            "d is not a port of subtree look; ; leave it out",
            "joints: no pose lfet; ; did you mean left?",
        },
    }
