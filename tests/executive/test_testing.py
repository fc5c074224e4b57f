"""The test kit, used as a person would who tests a task of their own."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from executive.testing import SimulatedArm
from tests.support.paths import EXAMPLES, ROOT


@pytest.mark.slow
def test_a_task_and_its_functions() -> None:
    with SimulatedArm(trees=EXAMPLES, skills=EXAMPLES / "skills") as rehearsal:
        rehearsal.replace("measure", lambda samples, cancel: 0.75)
        outcome = rehearsal.run(7)
        assert (outcome.code, outcome.success) == ("task.condition", False)
        assert "0.75 < 0.5 is false" in outcome.message
        assert rehearsal.run(3, swing="5 deg", times="1").success
        assert "b095" in {frame[:4] for frame in rehearsal.frames}
    with SimulatedArm(trees=EXAMPLES) as rehearsal:
        assert rehearsal.run(7).success
        assert rehearsal.said("Say") == ["measured [m]: 0.21"]
        assert rehearsal.clock.now() > 3.0  # the boot alone takes two
        with pytest.raises(KeyError, match="Wait is not a registered function"):
            rehearsal.replace("Wait", lambda: None)


def test_each_time_a_leaf_ends_is_reported(tmp_path: Path) -> None:
    (tmp_path / "9_thrice.yaml").write_text(
        "task: 9\nname: thrice\ndescription: Say it again.\ntree:\n  sequence:\n"
        "    - {repeat: {Say: {text: hi}}, times: 3}\n"
        "    - {repeat: {sequence: [{Say: {text: ho}}]}, times: 2}\n"
    )
    with SimulatedArm(trees=tmp_path) as rehearsal:
        assert rehearsal.run(9).success
        assert rehearsal.said("Say") == ["hi", "hi", "hi", "ho", "ho"]


def test_the_operator_answers_by_heart(tmp_path: Path) -> None:
    (tmp_path / "9_careful.yaml").write_text(
        "task: 9\nname: careful\ndescription: Ask first.\ntree:\n  sequence:\n"
        "    - Ask: {question: Free?, wanted: yes}\n"
        "    - Ask: {question: Whose?, choices: [], answer: $name}\n"
        "    - Say: {text: it is for, value: $name}\n"
    )
    with SimulatedArm(trees=tmp_path) as rehearsal:
        rehearsal.answers += ["y", "Ada"]
        assert rehearsal.run(9).success
        assert rehearsal.said("Say") == ["it is for Ada"]
        outcome = rehearsal.run(9)
    assert outcome.code == "task.unanswered"
    assert "Free?: no answer within 60 s" in outcome.message


@pytest.mark.slow
def test_the_class_of_the_page_and_its_test(tmp_path: Path) -> None:
    page = (ROOT / "docs/pages/how_to/own_skill.md").read_text()
    files = re.findall(r"```python\n# ([\w/.]+)\n(.*?)```", page, re.DOTALL)
    files += re.findall(r'```yaml title="([\w/.]+)"\n(.*?)```', page, re.DOTALL)
    for name, text in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    pytest_ = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_pump.py"]
    done = subprocess.run(pytest_, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "1 passed" in done.stdout, done.stdout


OWN = """\
from skills import condition, skill


@skill
def {name}_weigh() -> float:
    return {returned}


@condition
def {name}_heavy() -> bool:
    return {returned}
"""


@pytest.mark.parametrize(
    ("name", "returned", "said"),
    [
        ("text", "'x'", "text_weigh returned 'x', but is annotated to return float"),
        ("none", "None", "none_weigh returned None, but is annotated to return float"),
        ("whole", "3", ""),
    ],
)
def test_what_a_function_returns_is_its_own_business(
    tmp_path: Path, name: str, returned: str, said: str
) -> None:
    (tmp_path / "own.py").write_text(OWN.format(name=name, returned=returned))
    for number, tree in ((3, f"{name}_weigh: {{result: $kg}}"), (4, f"{name}_heavy")):
        text = f"task: {number}\nname: weigh\ndescription: Weigh.\ntree:\n  {tree}\n"
        (tmp_path / f"{number}_weigh.yaml").write_text(text)
    with SimulatedArm(trees=tmp_path, skills=tmp_path) as rehearsal:
        outcome = rehearsal.run(3)
        assert outcome.success == (not said)
        assert said in outcome.message
        assert "a bug" not in outcome.message.lower()
        asked = rehearsal.run(4)
    assert f"{name}_heavy returned {returned}, but is annotated to return bool" in asked.message
