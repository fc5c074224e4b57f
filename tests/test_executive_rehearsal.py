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
