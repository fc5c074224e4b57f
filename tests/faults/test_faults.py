"""The faults of the quick selection, and the comparison of a board's log with a recording."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.row import compare

ONE, TWO, THREE = b"b090,s090,e090,g000,", b"b091,s090,e090,g000,", b"b092,s090,e090,g000,"


@pytest.mark.parametrize(
    ("board", "recording", "found"),
    [
        (ONE + TWO, ONE + TWO, (0, 0)),
        (ONE, ONE + TWO, (0, 1)),
        (ONE + TWO[:7], ONE + TWO, (0, 1)),
        (ONE + TWO, ONE, (1, 0)),
        (ONE + THREE, ONE + TWO + THREE, (0, 1)),
        (ONE + THREE + TWO, ONE + TWO + TWO, (1, 1)),
        (b"?" + ONE, ONE, (1, 0)),
    ],
)
def test_a_difference_between_board_and_recording_is_found(
    board: bytes, recording: bytes, found: tuple[int, int]
) -> None:
    assert compare(board, recording) == found


@pytest.mark.slow
def test_the_quick_selection_holds(tmp_path: Path) -> None:
    """What holds is asserted, not how quickly: other tests run at the same time."""
    found, program = tmp_path / "found.json", Path(__file__).with_name("run.py")
    command = [sys.executable, str(program), "--quick", "--jobs", "1", "--json", str(found)]
    run = subprocess.run(command, check=False, capture_output=True, text=True)
    assert found.exists(), run.stdout + run.stderr
    rows = json.loads(found.read_text())
    assert len(rows) > 2
    assert {row["row"]: row["problems"] for row in rows if row["problems"]} == {}, run.stdout
