"""The example tasks, run on the in-process board, and their recordings."""

from collections.abc import Callable
from pathlib import Path
from textwrap import indent

import pytest

import logs
from executive.replay.verification import verify
from hardware import SimulatedClock
from skills.user_skills import load_skills
from tests.conftest import Rig, RigMaker
from tests.support.paths import EXAMPLES
from trees.compile.port_types import known_skills
from trees.errors import BadArguments
from trees.export.resolved import RESOLVED
from trees.nodes.kind import reserved_names

Near = Callable[[float, float], None]


@pytest.fixture
def near(monkeypatch: pytest.MonkeyPatch) -> Near:
    """Says from when to when a person is near [s]."""
    assert load_skills(EXAMPLES / "skills", reserved_names()) == []
    names = known_skills()["nobody_near"].function.__globals__  # type: ignore[attr-defined]

    def between(begin: float, end: float) -> None:
        monkeypatch.setitem(names, "NEAR", (begin, end))

    return between


@pytest.fixture
def examples(rig: RigMaker, near: Near) -> Rig:
    """The examples, while no person is near: the clock is not at 0 when a test begins."""
    near(0.0, 0.0)
    return rig(EXAMPLES)


def said(rig: Rig, name: str) -> list[str]:
    """What a node said when it ended."""
    records = rig.recorded(logs.NodeStatus)
    return [r.message for r in records if r.name == name and r.status in ("SUCCESS", "FAILURE")]


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 4, 5, 6, 7, 8])
def test_an_example(examples: Rig, number: int) -> None:
    (outcome,) = examples.run(number)
    assert outcome.success, outcome.message
    assert outcome.frames > 0
    results = [message.fields() for message in logs.read(Path(outcome.recording), ["/result"])]
    assert [result["state"] for result in results] == ["SUCCEEDED"]
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 4, 5, 6, 7, 8])
def test_an_example_is_the_same_with_every_file_and_value_in_its_place(
    examples: Rig, rig: RigMaker, tmp_path: Path, number: int
) -> None:
    (outcome,) = examples.run(number)
    tree = indent(logs.Recording(Path(outcome.recording)).files[RESOLVED].decode(), "  ")
    assert "subtree" not in tree
    head = "task: 3\nname: again\ndescription: what another one was resolved to\ntree:\n"
    (tmp_path / "3_again.yaml").write_text(head + tree)
    again = rig(tmp_path)
    (outcome,) = again.run(3)
    assert outcome.success, outcome.message
    assert again.frames == examples.frames


def test_a_recording_of_every_example_ships() -> None:
    shipped = sorted(path.stem for path in (EXAMPLES / "recordings").iterdir())
    assert shipped == sorted(path.stem for path in EXAMPLES.glob("[0-9]*.yaml"))


@pytest.mark.parametrize("name", [path.name for path in (EXAMPLES / "recordings").iterdir()])
def test_old_recordings_hold(name: str) -> None:
    verification = verify(EXAMPLES / "recordings" / name)
    frames, plans = verification.checks
    assert frames.holds, verification.text()  # for ever
    assert plans.holds or plans.source.startswith("version: "), verification.text()


def test_the_stubborn_one_recovers(examples: Rig) -> None:
    examples.run(5)
    assert said(examples, "retry") == ["2 of 2 attempts failed"]
    assert said(examples, "Say")[0] == "gave up, going back"


def test_the_watchful_one_holds_and_goes_on(
    examples: Rig, shared_clock: SimulatedClock, near: Near
) -> None:
    near(begin := shared_clock.now() + 4.0, end := begin + 1.5)
    (outcome,) = examples.run(6)
    assert outcome.success
    executed = [r.status for r in examples.recorded(logs.NodeStatus) if r.name == "Execute"]
    assert [s for s in executed if s != "INVALID"] == ["RUNNING", "RUNNING", "SUCCESS"]  # anew
    sent = examples.recorded(logs.Sent)
    moved = [record.time for record in sent if record.joints and not record.hold]
    assert min(moved) < begin < end < max(moved)
    assert not [time for time in moved if begin + 0.1 < time < end]
    assert [record for record in sent if record.hold and begin <= record.time < end]
    assert examples.frames[-1].startswith("b009,s125,e085")


def test_a_key_goes_from_a_function_to_a_text(examples: Rig) -> None:
    examples.run(7)
    assert said(examples, "Say") == ["measured [m]: 0.21"]


def test_parameters_at_call_time(examples: Rig) -> None:
    (outcome,) = examples.run(3, settings=["swing=5 deg", "times=1"])
    assert outcome.success
    verification = verify(Path(outcome.recording))
    assert verification.holds, verification.text()
    turned = {frame[:4] for frame in examples.frames}
    assert "b095" in turned
    assert max(turned) == "b095"


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("swing=90 deg", "is more than 60 deg"),
        ("swnig=1", "did you mean swing?"),
        ("times=1.5", "is not a whole number"),
        ("times=[", "--set times=[: YAML does not allow this here"),
    ],
)
def test_wrong_parameters_are_refused(examples: Rig, setting: str, words: str) -> None:
    try:
        (outcome,) = examples.run(3, settings=[setting])
    except BadArguments as error:
        assert words in str(error)  # noqa: PT017  not every one can be read at all
        return
    assert outcome.code == "goal.bad_arguments"
    assert words in outcome.message
    assert examples.opened == 0
