"""Set and Compare: numbers with a unit are measures, not texts."""

from pathlib import Path

import pytest

from skills import SkillBroken
from skills.leaves.blackboard import Compare
from tests.conftest import Bench, RigMaker

HEAD = "task: 10\nname: x\ndescription: y\n"


def state(rig: RigMaker, folder: Path, text: str, *settings: str) -> str:
    (folder / "10_x.yaml").write_text(HEAD + text)
    (outcome,) = rig(folder).run(10, settings=settings)
    return outcome.code


COMPARED = [
    ("1 s", "<", "200 ms", False),
    ("1 s", "==", "1000 ms", True),
    ("1 min", "!=", "60 s", False),
    ("10 deg", ">", "9 deg", True),
    ("2", ">", "1999 ms", True),
    ("2 m", ">=", "201 cm", False),
    ("a", "==", "a", True),
]


@pytest.mark.parametrize(("left", "relation", "right", "so"), COMPARED)
@pytest.mark.parametrize("from_key", [False, True])
def test_measures_compare_by_what_they_measure(
    rig: RigMaker, tmp_path: Path, left: str, relation: str, right: str, so: bool, from_key: bool
) -> None:
    named = "$a" if from_key else left
    write = f"{{Set: {{value: {left}, key: $a}}}}, " if from_key else ""
    compare = f"{{Compare: {{left: {named}, is: '{relation}', right: {right}}}}}"
    reported = state(rig, tmp_path, f"tree: {{sequence: [{write}{compare}]}}\n")
    assert reported == ("ok" if so else "task.condition")


@pytest.mark.parametrize(("given", "so"), [("1", False), ("1 s", False), ("100 ms", True)])
def test_a_parameter_compares_by_what_it_measures(
    rig: RigMaker, tmp_path: Path, given: str, so: bool
) -> None:
    tree = "parameters: {t: duration}\ntree: {Compare: {left: $t, is: '<', right: 200 ms}}\n"
    reported = state(rig, tmp_path, tree, f"t={given}")
    assert reported == ("ok" if so else "task.condition")


def test_an_order_of_texts_that_is_asked_for_late_is_refused(rig: RigMaker, tmp_path: Path) -> None:
    tree = "parameters: {how: text}\ntree: {Compare: {left: b, is: $how, right: a}}\n"
    assert state(rig, tmp_path, tree, "how='<'") == "file.task"


@pytest.mark.parametrize(
    ("left", "relation", "right", "why"),
    [
        ("1 s", "==", 1.0, "a text is equal only to a text"),
        (1.0, "!=", "1 s", "a text is equal only to a text"),
        ("b", "<", "c", "texts have no order"),
        (1.0, ">=", "c", "texts have no order"),
    ],
)
def test_a_text_of_unknown_origin_is_no_measure(
    bench: Bench, left: object, relation: str, right: object, why: str
) -> None:
    skill = bench.skill(Compare, left=left, right=right, **{"is": relation})
    skill.tick_once()
    assert isinstance(skill.broken, SkillBroken)
    assert f"{left!r} {relation} {right!r}: {why}" in str(skill.broken)
