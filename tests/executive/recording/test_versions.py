"""The versions that a recording names."""

import shutil
from pathlib import Path

import pytest

from executive.recording.versions import FRAMES, digest, versions
from tests.support.paths import ROOT


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for room in ("hardware", "skills"):
        code = shutil.ignore_patterns("__pycache__", "firmware")
        shutil.copytree(ROOT / room, tmp_path / room, ignore=code)
    return tmp_path


@pytest.mark.parametrize(
    "file",
    [
        "hardware/arm/schedule.py",
        "hardware/drivers/arduino/frames.py",
        "hardware/drivers/feetech/wire_format.py",
        "hardware/drivers/a_new_one/wire_format.py",
        "skills/merged_motion.py",
    ],
)
def test_a_change_in_what_computes_frames_changes_their_version(copy: Path, file: str) -> None:
    before = digest(copy, FRAMES)
    assert before == versions()["frames"]
    (copy / file).parent.mkdir(exist_ok=True)
    with (copy / file).open("a") as code:
        code.write("# changed\n")
    assert digest(copy, FRAMES) != before


@pytest.mark.parametrize("file", ["hardware/drivers/feetech/virtual/servo.py", "hardware/clock.py"])
def test_a_change_elsewhere_does_not(copy: Path, file: str) -> None:
    (copy / file).write_text("")
    assert digest(copy, FRAMES) == versions()["frames"]
