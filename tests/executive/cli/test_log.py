"""`armtree log`, in this process."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from armtree import EXAMPLES
from executive.cli.main import cli
from logs import Goal, recover
from logs.records.records import Sent
from tests.logs.test_run import RUNS, record
from tests.logs.writing.test_compaction import run_journal


def test_ls_lists_the_folder_in_which_it_is_typed_or_says_where_it_looked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ARMTREE_RECORDINGS", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    nothing = CliRunner().invoke(cli, ["log", "ls"]).output
    assert nothing == f"{tmp_path}/recordings: there are no recordings in this folder\n"
    recordings = tmp_path / "recordings"
    recordings.mkdir()
    run_journal(recordings / "20261123T151517.770Z-1.mcap")
    above = CliRunner().invoke(cli, ["log", "ls"]).output
    monkeypatch.chdir(recordings)
    assert CliRunner().invoke(cli, ["log", "ls"]).output == above
    assert "20261123T151517.770Z-1.mcap " in above
    assert CliRunner().invoke(cli, ["log", "show", "latest"]).exit_code == 0


def test_ls_shortens_a_long_title_so_that_the_columns_stay_aligned(tmp_path: Path) -> None:
    title = "move joint_1=10deg joint_2=-80deg joint_3=80deg"
    for name, goal in (
        ("a", Goal(0.0, "0" * 32, -1, title, 1)),
        ("b", Goal(0.0, "1" * 32, 7, "pick", 1)),
    ):
        record(tmp_path / f"{name}.mcap", [goal])
    long, short = CliRunner().invoke(cli, ["log", "ls", str(tmp_path)]).output.splitlines()
    assert long.index("0 frames") == short.index("0 frames")
    assert "  move joint_1=10deg join… NO END" in long
    assert title in CliRunner().invoke(cli, ["log", "ls", str(tmp_path), "--json"]).output


def test_ls_marks_a_recovered_recording_whose_file_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path, finish=False)
    (before,) = rows("log", "ls", str(tmp_path))
    recover(path)
    (row,) = rows("log", "ls", str(tmp_path))
    assert (before["complete"], before["recovered"]) == (False, False)
    assert (row["complete"], row["recovered"]) == (True, True)
    assert row.items() - {"pinned": False}.items() <= rows("log", "info", str(path))[0].items()
    assert CliRunner().invoke(cli, ["log", "ls", str(tmp_path)]).output.endswith(" kB  recovered\n")


def rows(*words: str) -> list[dict[str, Any]]:
    """What a command prints with --json."""
    printed = CliRunner().invoke(cli, [*words, "--json"]).stdout
    return [json.loads(line) for line in printed.splitlines()]


def test_diff_prints_degrees_if_the_recording_has_the_robot(tmp_path: Path) -> None:
    wave, round_ = (EXAMPLES / "recordings" / name for name in ("3_wave.mcap", "8_round.mcap"))
    said = CliRunner().invoke(cli, ["log", "diff", str(wave), str(round_)]).output
    assert "joint_3     differs by at most 51.566 deg, at 8.370 s\n" in said
    run_journal(tmp_path / "foreign.mcap")
    foreign = str(tmp_path / "foreign.mcap")
    assert (
        "at most 0.0000 rad, at"
        in CliRunner().invoke(cli, ["log", "diff", foreign, foreign]).output
    )


def test_diff_says_that_two_runs_are_of_two_arms(tmp_path: Path) -> None:
    of_other_arm = [
        replace(each, joints=tuple(f"other_{name}" for name in each.joints))
        if isinstance(each, Sent)
        else each
        for each in RUNS["ok"]
    ]
    record(tmp_path / "other.mcap", of_other_arm)
    run_journal(tmp_path / "one.mcap")
    pair = [str(tmp_path / name) for name in ("one.mcap", "other.mcap")]
    said = CliRunner().invoke(cli, ["log", "diff", *pair]).output
    assert "two arms without a common joint: joint_1" in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "last", "status"),
    [
        ("recover", "the end of the run is missing", 10),
        ("plot", "good.png", 10),
        ("pin", "good.mcap: pinned", 3),
    ],
)
def test_what_is_wrong_with_one_of_many_keeps_none_of_the_others(
    tmp_path: Path, command: str, last: str, status: int
) -> None:
    wrong, gone, good = (tmp_path / f"{name}.mcap" for name in ("wrong", "gone", "good"))
    wrong.write_text("no recording")
    run_journal(good, finish=False)
    typed = CliRunner().invoke(cli, ["log", command, str(wrong), str(gone), str(good)])
    reported = [line for line in typed.output.splitlines() if line.startswith("Error: ")]
    assert [line.split(".mcap")[0] for line in reported] == [
        *(f"Error: {tmp_path}/wrong", f"Error: {tmp_path}/gone")
    ]
    assert typed.output.splitlines()[-1].endswith(last)
    assert typed.exit_code == status
