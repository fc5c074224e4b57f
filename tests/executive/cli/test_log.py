"""`armtree log`, in this process."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.main import cli
from tests.logs.writing.test_compaction import run_journal


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
