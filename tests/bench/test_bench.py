"""The measurements are no part of the suite; that they can be started is."""

import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parent / "bench"


@pytest.mark.parametrize("subject", [f.stem for f in BENCH.glob("*.py") if f.stem != "table"])
def test_a_measurement_starts_by_itself(subject: str) -> None:
    command = [sys.executable, str(BENCH / f"{subject}.py"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "--json" in done.stdout
