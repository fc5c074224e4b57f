"""A kind of node is added in one place: its class. Here it is done as a user of the code would."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from executive.testing import SimulatedArm
from hardware import Robot
from skills import Context
from tests.support.paths import ROOT
from trees import FileError, Library
from trees.check import check, compile_task
from trees.declarations import Declaration
from trees.export.drawings import as_text
from trees.export.groot import as_groot
from trees.export.outline import outline
from trees.export.schema import schema_text
from trees.nodes.kind import KINDS, ControlNodeKind, Element, Node, Options, PossibleOutcomes


class KeepGoing(Decorator):
    """Hides a number of failures."""

    def __init__(self, name: str, child: Behaviour, failures: int) -> None:
        super().__init__(name, child)
        self.left = failures

    def update(self) -> Status:
        if self.decorated.status is Status.FAILURE and self.left:
            self.left -= 1
            return Status.SUCCESS
        return self.decorated.status


class KeepGoingKind(ControlNodeKind, register=False):
    """Succeeds although the node fails, a few times."""

    name = "keep_going"
    options = {"failures": Declaration("integer", least=1, description="how often")}
    placeholders = {"failures": 1}

    def make(
        self, name: str, children: list[Behaviour], options: Options, context: Context
    ) -> Behaviour:
        return KeepGoing(name, children[0], options["failures"])

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        child = node.child(0, node.halted)
        if not child.fails:
            node.wrong(f"{node.name} hides nothing: its child never fails")
        return PossibleOutcomes(True, child.fails, 0.0)

    def groot(self, options: Options) -> list[Element]:
        return [("ForceSuccess", {"_description": f"{options['failures']} times"})]


TASK = """\
task: 7
name: kept
description: Fails, and goes on.
tree:
  sequence:
    - keep_going: {Fail: {reason: so it is}}
      failures: 2
    - Say: {text: after it}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    class Registered(KeepGoingKind):
        """Its definition registers it, as that of any other kind."""

    (tmp_path / "7_kept.yaml").write_text(TASK)
    yield tmp_path
    del KINDS[Registered.name]


def mistakes(robot: Robot, folder: Path, *changes: str) -> list[str]:
    text = TASK
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    (folder / "7_kept.yaml").write_text(text)
    return [m.message for m in check(robot, folder).mistakes]


def test_it_runs(folder: Path) -> None:
    with SimulatedArm(trees=folder) as arm:
        assert arm.run(7).success
        assert arm.said("Say") == ["after it"]


def test_it_is_read(robot: Robot, folder: Path) -> None:
    assert mistakes(robot, folder) == []
    assert mistakes(robot, folder, "      failures: 2\n", "") == [
        "keep_going needs failures: how often; write it below, in the column of keep_going"
    ]
    (reported,) = mistakes(robot, folder, "failures", "failuers")
    assert reported.endswith("beside keep_going there are failures, name; did you mean failures?")
    (reported,) = mistakes(robot, folder, "keep_going", "keep_gonig")
    assert "did you mean keep_going?" in reported
    (reported,) = mistakes(robot, folder, "failures: 2", "failures: 0")
    assert reported == "keep_going: failures: 0 is less than 1"


def test_it_is_analysed(robot: Robot, folder: Path) -> None:
    reported = mistakes(robot, folder, "{Fail: {reason: so it is}}", "Succeed")
    assert reported == ["keep_going hides nothing: its child never fails"]
    never = "    - Fail: {reason: now}\n    - Say: {text: after it}\n"
    reported = mistakes(robot, folder, "    - Say: {text: after it}\n", never)
    assert reported == ["Say is never reached: Fail before it never succeeds"]
    writes = "{sequence: [{Set: {value: 1, key: $k}}, {Fail: {reason: so}}]}"
    says = ("Say: {text: after it}", "Say: {text: it, value: $k}")
    assert mistakes(robot, folder, "{Fail: {reason: so it is}}", writes, *says) == []


def test_it_is_drawn_and_exported(robot: Robot, folder: Path) -> None:
    root = outline(compile_task(robot, Library(folder), 7))
    assert "keep_going (keep going)" in as_text(root, ports=False)
    assert '<ForceSuccess name="keep_going" _description="2 times">' in as_groot(root, 7)


def test_it_is_in_the_schema(folder: Path) -> None:
    forms = json.loads(schema_text(Library(folder)))["definitions"]["node"]["anyOf"]
    (form,) = (form for form in forms if "keep_going" in form.get("properties", {}))
    assert form["required"] == ["keep_going", "failures"]


def test_without_its_class_there_is_none(robot: Robot, tmp_path: Path) -> None:
    (tmp_path / "7_kept.yaml").write_text(TASK)
    with pytest.raises(FileError, match="keep_going"):
        compile_task(robot, Library(tmp_path), 7)


def test_no_other_file_of_the_product_names_a_kind() -> None:
    names = "|".join(KINDS.keys() - {"retry", "timeout"})  # also names of other things
    named = re.compile(
        rf"""["']({names})["']|from trees\.nodes\."""
        r"(?!kind|unknown|loops import loops_in, share_of_rounds$)"
    )
    rooms = ("executive", "hardware", "logs", "skills", "trees")
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for room in rooms
        for path in (ROOT / room).rglob("*.py")
        if path.parent.name != "nodes"
        for line in path.read_text().splitlines()
        if named.search(line)
    ]
    assert found == []
