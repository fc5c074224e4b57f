"""Files that an earlier version wrote, or read, still mean the same.

Each folder of `tests/data/upgrades` has files of one version, which nobody changes. A new version
adds a folder. `docs/pages/concepts/formats.md` says what may change.
"""

import json
import math
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import logs
from executive.testing import SimulatedArm
from hardware import load_robot
from tests.support.command_line.typed import typed
from tests.support.generated.interfaces import lines
from tests.support.paths import DATA

VERSIONS = sorted((DATA / "upgrades").iterdir())


@pytest.fixture(scope="module", params=VERSIONS, ids=lambda folder: folder.name)
def earlier(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Path]:
    """A copy of the files of a version, as the working directory; a process loads a skill once."""
    folder = tmp_path_factory.mktemp("upgrades") / "earlier"
    shutil.copytree(request.param, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder


def test_the_file_of_settings_is_read(earlier: Path) -> None:
    """New settings may be added."""
    status, out, err = typed(earlier / "recordings", "config", "--json")
    assert status == 0, err
    rows = [json.loads(line) for line in out.splitlines()]
    from_file = {row["setting"] for row in rows if "armtree.toml" in row["source"]}
    written = tomllib.loads((earlier / "armtree.toml").read_text())
    assert from_file >= written.keys() - {"recordings"}


def test_programs_find_every_code_field_and_parameter(earlier: Path) -> None:
    """New ones may be added. A version that is not released may still change its own."""
    relied_on = (earlier / "interfaces.txt").read_text().splitlines()
    assert len(relied_on) > 1000
    assert sorted({*relied_on} - {*lines()}) == [], "python -m tests.support.generated.interfaces"


def test_task_files_are_right(earlier: Path) -> None:
    status, out, err = typed(earlier / "recordings", "check")
    assert (status, err) == (0, ""), out
    assert "are right" in out


def test_a_calibration_is_read(earlier: Path) -> None:
    first = load_robot(earlier / "calibrated" / "arm.toml").actuated[0]
    assert math.degrees(first.lower) == pytest.approx(-50)
    assert math.degrees(first.upper) == pytest.approx(40)


@pytest.mark.slow
def test_a_task_with_everything_runs_on_the_robot_file(earlier: Path) -> None:
    robot = earlier / "arduinobot.toml"
    with SimulatedArm(earlier / "trees", earlier / "skills", robot) as arm:
        outcome = arm.run(3)
        assert outcome.success, outcome.message
        assert arm.said("Say") == ["$5 a piece, times 3", "half of it 0.25"]


@pytest.mark.slow
def test_obstacles_are_read(earlier: Path) -> None:
    status, out, err = typed(earlier / "recordings", "plan", "right", "--json", "-o", "plan.svg")
    assert status == 0, err
    assert "post" in out


@pytest.mark.slow
def test_recordings_are_read_and_their_frames_follow_from_their_plans(earlier: Path) -> None:
    files = sorted((earlier / "recordings").glob("*.mcap"))
    assert files
    for file in files:
        records = list(logs.Recording(file).records())
        assert [each.success for each in records if isinstance(each, logs.Result)] == [True]
        assert logs.table(file, "/joint_states")
        for command in (("log", "info"), ("log", "show"), ("log", "export"), ("show",)):
            status, out, err = typed(earlier / "recordings", *command, str(file))
            assert status == 0, out + err
        _, out, err = typed(earlier / "recordings", "replay", str(file), "--verify")
        assert "plan -> frames  holds" in out, out + err


def test_the_recording_of_a_server_is_read(earlier: Path) -> None:
    (file,) = (earlier / "served").glob("*-server.mcap")
    records = list(logs.Recording(file).records())
    assert [each.task for each in records if isinstance(each, logs.Goal)] == [1, 2]
    status, out, err = typed(earlier / "recordings", "log", "show", str(file))
    assert status == 0, out + err


def test_the_journal_of_a_run_that_was_killed_is_recovered(earlier: Path) -> None:
    (file,) = (earlier / "served").glob("*-1.mcap")
    recording = logs.Recording(file)
    frames = len(list(recording.frames()))
    assert frames > 5
    assert not recording.complete
    status, out, err = typed(earlier / "recordings", "log", "recover", str(file))
    assert status in (0, 10), out + err
    assert len(logs.table(file, "/joint_states")["joint_1"]) == frames
