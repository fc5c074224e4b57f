"""The commands for task files, as a user types them."""

import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import cli
from executive.testing import SimulatedArm
from logs import Goal, Note
from tests.logs.test_run import RUNS, record
from tests.support.paths import DATA, EXAMPLES, ROOT, TASKS
from trees import FileError, UnknownTask
from trees.compile.port_types import known_skills
from trees.nodes import KINDS

OWN = ["--trees", str(EXAMPLES), "--skills", str(EXAMPLES / "skills")]


def armtree(*arguments: str) -> Result:
    return CliRunner().invoke(cli, arguments)


@pytest.mark.parametrize(
    ("folder", "options"), [(TASKS, []), (EXAMPLES, OWN)], ids=["shipped", "examples"]
)
def test_the_shipped_schema_is_current(folder: Path, options: list[str]) -> None:
    made = _forms(json.loads(armtree("schema", *options).output))
    shipped = _forms(json.loads((folder / "task.schema.json").read_text()))
    kinds = [*KINDS.items(), *known_skills().items()]  # tests may have registered more
    ours = {name for name, kind in kinds if kind.__module__.startswith(("trees.", "skills."))}
    assert ours <= {key for form in shipped for key in json.loads(form)}
    assert shipped.items() <= made.items(), "make it anew: armtree schema -o " + folder.name


def _forms(schema: dict[str, dict[str, dict[str, list[dict[str, object]]]]]) -> dict[str, str]:
    """Every form of a node in the schema, by its first key."""
    forms = schema["definitions"]["node"]["anyOf"][1:]
    return {
        json.dumps(form.get("required")): json.dumps(form) for form in forms if "required" in form
    }


def test_every_shipped_file_names_its_schema() -> None:
    for path in (*TASKS.glob("**/*.yaml"), *EXAMPLES.glob("*.yaml")):
        first = path.read_text().partition("\n")[0]
        named = first.removeprefix("# yaml-language-server: $schema=")
        assert named.endswith("task.schema.json")
        assert (path.parent / named).exists()


def test_skills_lists_those_of_ones_own() -> None:
    listed = armtree("skills", "--skills", str(EXAMPLES / "skills")).output
    for name in ("nobody_near", "measure", "Nod", "Execute"):
        assert re.search(rf"^{name}$", listed, re.MULTILINE)
    rows = armtree("skills", "--json").output.splitlines()
    assert {"skill", "description", "ports"} == set(json.loads(rows[0]))
    for words in (
        "is           a text, one of ==, !=, <, <=, >, >=:",
        "speed        a number, at least 0.01, at most 1, default 1.0:",
        "by           a mapping from joint names to angles: distances",
    ):
        assert f"      reads  {words}" in listed


BROKEN = {
    "syntax.py": "def (:\n",
    "raises.py": "from skills import skill\n\n@skill\ndef halfway() -> None: ...\n\n1 / 0\n",
    "exits.py": "raise SystemExit(5)\n",
    "taken.py": "from skills import skill\n\n@skill\ndef Wait() -> None: ...\n",
    "untyped.py": "from skills import skill\n\n@skill\ndef f(x): ...\n",
}


def test_a_broken_plugin_costs_only_itself(tmp_path: Path) -> None:
    before = known_skills()
    for name, text in BROKEN.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "whole.py").write_text(
        "from skills import skill\n\n@skill\ndef whole() -> None: ...\n"
    )
    result = armtree("skills", "--skills", str(tmp_path))
    assert result.exit_code == 0
    reported = [line for line in result.stderr.splitlines() if "left out" in line]
    assert len(reported) == len(BROKEN)
    assert any("raises.py:6: ZeroDivisionError" in line for line in reported)
    assert any("taken.py: Wait: another skill already has this name" in line for line in reported)
    assert set(known_skills()) - set(before) == {"whole"}
    assert known_skills()["Wait"] is before["Wait"]


def test_defaults_are_listed_as_they_are_written(tmp_path: Path) -> None:
    (tmp_path / "3_x.yaml").write_text(
        "task: 3\nname: x\ndescription: y\nparameters:\n"
        "  to: {type: positions, default: {joint_1: -10 deg}}\n"
        "  pose: {type: text, default: right}\n"
        "tree: {sequence: [{subtree: move_joints, with: {joints: $to}}, {Say: {text: $pose}}]}\n"
    )
    listed = armtree("tasks", "--trees", str(tmp_path)).output
    assert "--set to=POSITIONS (default {joint_1: -10 deg})" in listed
    assert "--set pose=TEXT (default right)" in listed


def test_new_writes_a_task_that_is_right(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    assert armtree("new", "3", "wave", "--trees", str(folder)).exit_code == 0
    assert armtree("check", "--trees", str(folder)).output.startswith("1")
    listed = armtree("tasks", "--trees", str(folder), "--recordings", str(tmp_path)).output
    assert "3  wave" in listed
    assert "--set swing=ANGLE, 1..60 deg (default 20 deg)" in listed
    again = armtree("new", "3", "again", "--trees", str(folder))
    assert isinstance(again.exception, FileError)
    assert "task 3 is in" in str(again.exception)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["seven_axes", "endless"])
def test_new_writes_a_task_that_runs_on_any_arm(tmp_path: Path, name: str) -> None:
    robot = ("--robot", str(DATA / f"{name}.toml"), "--trees", str(tmp_path))
    assert armtree("new", "3", "wave", *robot).exit_code == 0
    assert (tmp_path / name / "3_wave.yaml").exists()
    listed = armtree("tasks", *robot)
    assert [line.split()[0] for line in listed.output.splitlines() if line[:4].strip()] == ["3"]
    checked = armtree("check", *robot)
    assert checked.exit_code == 0, checked.output
    assert checked.output.startswith("1 file and ")
    assert checked.output.endswith(" shipped files are right\n")
    with SimulatedArm(trees=tmp_path, robot=DATA / f"{name}.toml") as arm:
        outcome = arm.run("wave")
    assert outcome.success, outcome.message


def test_check_as_json(tmp_path: Path) -> None:
    path = tmp_path / "3_x.yaml"
    path.write_text("task: 3\nname: x\ndescription: y\ntree: Sukseed\n")
    result = armtree("check", str(path), "--json")
    assert result.exit_code == 3
    (mistake,) = json.loads(result.stdout)["mistakes"]
    assert (mistake["line"], mistake["column"], mistake["path"]) == (4, 7, "tree")
    plain = armtree("check", str(path))
    assert plain.stderr.splitlines()[1:3] == ["    tree: Sukseed", "          ^ tree"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "--skills", "nosuch"], "nosuch: there is no such folder for skills"),
        (["show", "0", "--skills", "nosuch"], "nosuch: there is no such folder for skills"),
        (["check", "3_x.yaml", "--trees", "."], "give --trees or FILE, not both"),
    ],
)
def test_what_is_typed_wrongly(arguments: list[str], words: str) -> None:
    result = armtree(*arguments)
    assert result.exit_code == 2
    assert words in result.stderr


@pytest.mark.parametrize("form", ["text", "mermaid", "dot", "svg", "groot"])
def test_show(form: str) -> None:
    shown = armtree("show", "7", *OWN, "--format", form, "--ports").output
    for name in ("measure", "Nod", "Compare", "go", "Execute"):
        assert name in shown
    if form in ("svg", "groot"):
        ET.fromstring(shown)


@pytest.mark.parametrize("command", ["show", "run"])
def test_a_misspelt_task_is_named_with_those_there_are(command: str, tmp_path: Path) -> None:
    refused = CliRunner().invoke(cli, [command, "pik", "--trees", str(tmp_path)]).exception
    words = "Invalid task name pik; there are home, pick, rest; did you mean pick?"
    assert isinstance(refused, UnknownTask)
    assert str(refused) == words


def test_show_a_task_by_its_name() -> None:
    assert armtree("show", "pick").output == armtree("show", "1").output


def test_show_a_run(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["canceled"])
    reported = armtree("show", str(path)).output.splitlines()
    assert reported[0].startswith("■ Reach  +0.640 s, 1.6")
    assert "│  ├─ ✓ PlanArm  +0.640 s, 0.080 s  straight" in reported
    assert reported[-1] == "└─ · Succeed"
    assert any(line.startswith("├─ ■ Execute  +0.750 s, 1.5") for line in reported)
    assert "style=filled" in armtree("show", str(path), "--format", "dot").output
    refused = armtree("show", str(path), "--ports")
    assert "--ports and --format groot need a task" in refused.output


def test_the_last_outcome_of_a_task_is_listed(tmp_path: Path) -> None:
    record(tmp_path / "20261121T170228.553Z-1.mcap", RUNS["ok"])
    record(tmp_path / "20261121T180228.553Z-1.mcap", RUNS["canceled"])
    (tmp_path / "20261121T180228.553Z-2.mcap").write_bytes(b"\x89MCAP0\r\n")
    listed = _tasks(tmp_path)
    assert "last: CANCELED 2026-11-21 18:02 UTC" in listed
    assert "last: unknown, 20261121T180228.553Z-2.mcap is not complete" in listed
    rows = [json.loads(line) for line in _tasks(tmp_path, "--json").splitlines()]
    assert {row["task"]: row["last_outcome"][:8] for row in rows} == {
        0: "",
        1: "CANCELED",
        2: "unknown,",
    }


def test_outcomes_of_another_robot_or_of_another_task_are_not_listed(tmp_path: Path) -> None:
    record(tmp_path / "20261121T170228.553Z-1.mcap", RUNS["ok"])
    goal, *rest = RUNS["canceled"]
    assert isinstance(goal, Goal)
    other: list[Any] = [Note("robot", {"file": "arm5.toml"}), goal, *rest]
    record(tmp_path / "20261121T180228.553Z-1.mcap", other)
    record(tmp_path / "20261121T190228.553Z-1.mcap", [replace(goal, name="grab"), *rest])
    assert "last: SUCCEEDED 2026-11-21 17:02 UTC" in _tasks(tmp_path)


def _tasks(recordings: Path, *options: str) -> str:
    return armtree("tasks", "--recordings", str(recordings), *options).output


def test_groot_tells_keys_from_values(tmp_path: Path) -> None:
    (tmp_path / "3_x.yaml").write_text(
        "task: 3\nname: x\ndescription: d\ntree:\n  sequence:\n"
        "    - SetStart: {start: $s}\n"
        "    - Target: {start: $s, joints: {joint_1: -1.4, joint_2: 0.5}, goal: $g}\n"
        "    - Say: {text: $$5}\n"
        "    - retry: CheckHardware\n      attempts: 3\n      backoff: 2 s\n"
        "    - wait_for: CheckHardware\n      every: 0.5\n"
    )
    shown = armtree("show", "3", "--trees", str(tmp_path), "--format", "groot").output
    root = ET.fromstring(shown)
    target, said = root.find(".//Target"), root.find(".//Say")
    assert target is not None
    assert said is not None
    assert target.attrib["start"] == "{s}"
    assert target.attrib["joints"] == "joint_1:-1.4;joint_2:0.5"
    assert said.attrib["text"] == "$5"
    reported = [node.attrib["_description"] for node in root.iter("RetryUntilSuccessful")]
    assert reported == ["after 2 s; this time doubles at each attempt", "checked every 0.5 s"]


@pytest.mark.parametrize("number", [0, 3, 4, 5, 6, 7, 8])
def test_what_groot_is_given(number: int) -> None:
    root = ET.fromstring(armtree("show", str(number), *OWN, "--format", "groot").output)
    assert root.get("BTCPP_format") == "4"
    tree, models = root.find("BehaviorTree"), root.find("TreeNodesModel")
    assert tree is not None
    assert models is not None
    assert root.get("main_tree_to_execute") == tree.get("ID")
    ports = {model.get("ID"): {port.get("name") for port in model} for model in models}
    for node in tree.iter():
        if node.tag in known_skills():
            assert set(node.keys()) - {"name"} <= ports[node.tag]
    assert tree.get("ID") not in ports


def test_the_page_explains_every_kind_of_node() -> None:
    page = (ROOT / "docs/pages/reference/tasks.md").read_text()
    rows = re.findall(r"^\| `(\w+): .*?` \|.*\|(.*)\|$", page, re.MULTILINE)
    options = {name: {*re.findall(r"`(\w+): ", cell)} for name, cell in rows}
    expected = {name: {*kind.options, kind.condition} - {""} for name, kind in KINDS.items()}
    assert options == expected | {"subtree": {"with"}, "task": {"with"}}


@pytest.mark.parametrize("name", ["latest", "latest:pick", "x.mcap"])
def test_a_recording_is_replayed_not_run(name: str) -> None:
    refused = armtree("run", name, "--port", "virtual")
    assert f"{name} is a recording: type armtree replay {name} --watch" in refused.output


def test_of_many_wrong_files_the_last_line_has_the_number(tmp_path: Path) -> None:
    for number in range(3, 7):
        (tmp_path / f"{number}_x{number}.yaml").write_text("a: 1\n")
        *_, last = armtree("check", str(tmp_path)).stderr.splitlines()
        assert ("_x3.yaml" in last) == (number < 6)
    assert re.fullmatch(r"\d+ mistakes in 4 files; 4 files checked", last)
