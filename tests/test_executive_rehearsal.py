"""The test kit, used as a person would who tests a task of their own."""

from pathlib import Path

import pytest

import trees
from executive.rehearsal import Rehearsal

EXAMPLES = Path(trees.__file__).parent / "examples"


def test_a_task_and_its_functions() -> None:
    with Rehearsal(trees=EXAMPLES, skills=EXAMPLES / "skills") as rehearsal:
        rehearsal.replace("measure", lambda samples, cancel: 0.75)
        outcome = rehearsal.run(7)
        assert (outcome.code, outcome.success) == ("task.condition", False)
        assert "0.75 < 0.5 is not so" in outcome.message
        assert rehearsal.run(3, swing="5 deg", times="1").success
        assert "b095" in {frame[:4] for frame in rehearsal.frames}
    with Rehearsal(trees=EXAMPLES) as rehearsal:
        assert rehearsal.run(7).success
        assert rehearsal.said("Say") == ["measured [m]: 0.21"]
        assert rehearsal.clock.now() > 3.0  # the boot alone takes two
        with pytest.raises(KeyError, match="Wait is no registered function"):
            rehearsal.replace("Wait", lambda: None)


def test_the_operator_answers_by_heart(tmp_path: Path) -> None:
    (tmp_path / "9_careful.yaml").write_text(
        "task: 9\nname: careful\ndescription: Ask first.\ntree:\n  sequence:\n"
        "    - Ask: {question: Free?, wanted: yes}\n"
        "    - Ask: {question: Whose?, choices: [], answer: $name}\n"
        "    - Say: {text: it is for, value: $name}\n"
    )
    with Rehearsal(trees=tmp_path) as rehearsal:
        rehearsal.answers += ["y", "Ada"]
        assert rehearsal.run(9).success
        assert rehearsal.said("Say") == ["it is for Ada"]
        outcome = rehearsal.run(9)
    assert outcome.code == "task.unanswered"
    assert "Free?: nobody answered within 60 s" in outcome.message
