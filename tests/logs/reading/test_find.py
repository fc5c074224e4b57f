"""Recordings by name."""

import re
from pathlib import Path

import pytest

from logs import MOVE, Goal, NoSuchRecording, find_recording
from tests.logs.test_run import GOAL_ID, record

TASKS = {
    "20261121T103155.123Z-1": "pick",
    "20261121T103156.123Z-0": "home",
    "20261122T103155.123Z-1": "other",
    "20261122T113155.123Z-move": "",
}
NEWEST, OLDEST = "20261122T103155.123Z-1.mcap", "20261121T103155.123Z-1.mcap"
SECOND, SERVER = "20261121T103156.123Z-0.mcap", "20261123T103155.123Z-server.mcap"
MOVED = "20261122T113155.123Z-move.mcap"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for stem, task in TASKS.items():
        number = MOVE if stem.endswith("move") else int(stem[-1])
        record(tmp_path / f"{stem}.mcap", [Goal(0.0, GOAL_ID, number, task, 1)])
    for name in ("20261123T103155.123Z-server.mcap", "renamed.mcap", "20261124T0Z-1.txt"):
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("latest", MOVED),
        ("latest:move", MOVED),
        ("latest:1", NEWEST),
        ("latest:0", "20261121T103156.123Z-0.mcap"),
        ("latest:pick", OLDEST),
        ("latest:other", NEWEST),
        ("20261122T10", NEWEST),
        ("20261121T103155", OLDEST),
        (OLDEST, OLDEST),
        ("ren", "renamed.mcap"),
    ],
)
def test_a_recording_by_its_name(
    folder: Path, given: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert find_recording(given, folder) == folder / name
    monkeypatch.chdir(folder.parent)
    relative = Path(folder.name)
    assert find_recording(f"{relative}/{given}", Path("elsewhere")) == relative / name


def test_a_path_is_itself(folder: Path) -> None:
    for given in (folder, folder / OLDEST, Path("gone.mcap"), folder / "gone.mcap"):
        assert find_recording(str(given), folder) == given


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (
            "20261121",
            f"2 recordings here begin with 20261121; the newest: {SECOND}, {OLDEST}",
        ),
        (
            "x",
            f"no recording here begins with x; the newest: {SERVER}, {MOVED}, {NEWEST}, ",
        ),
        ("lates", "no recording here begins with lates; did you mean latest?"),
        ("latest:7", "no run of 7 is recorded here; there are runs of move, home, other"),
        ("latest:rest", "no run of rest is recorded here; there are runs of move, home, other"),
    ],
)
def test_a_wrong_name_is_reported_with_the_right_ones(folder: Path, given: str, why: str) -> None:
    with pytest.raises(NoSuchRecording, match=re.escape(f"{folder}: {why}")):
        find_recording(given, folder)


def test_of_many_recordings_the_newest_are_named(tmp_path: Path) -> None:
    names = [f"20261121T1031{second:02}.123Z-1.mcap" for second in range(10, 20)]
    for name in names:
        (tmp_path / name).touch()
    newest = f"{', '.join(names[:4:-1])} and 5 more"
    with pytest.raises(NoSuchRecording, match=f"begins with nope; the newest: {newest}"):
        find_recording("nope", tmp_path)


@pytest.mark.parametrize("given", ["latest", "latest:pick", "20261121"])
def test_a_folder_without_recordings(tmp_path: Path, given: str) -> None:
    for folder in (tmp_path, tmp_path / "gone"):
        with pytest.raises(NoSuchRecording, match="armtree log ls"):
            find_recording(given, folder)
