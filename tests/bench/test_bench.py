"""The measurements are not part of the suite; a test checks that each can be started."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

BENCH = Path(__file__).parent
SUBJECTS = {path.stem for path in BENCH.glob("*.py")} - {"table", Path(__file__).stem}


@pytest.mark.parametrize("subject", sorted(SUBJECTS))
def test_a_measurement_starts_by_itself(subject: str) -> None:
    command = [sys.executable, str(BENCH / f"{subject}.py"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "--json" in done.stdout


def test_every_subject_is_found() -> None:
    assert {"hardware", "logs", "planning", "trees"} <= SUBJECTS
