"""The shipped arm, moving faster, for tests that run in real time."""

import shutil
from pathlib import Path

from tests.support.paths import ROBOT_FILE


def quick_arm(folder: Path) -> Path:
    """Writes its robot file and its URDF, and returns the robot file. The board boots in 1.05 s."""
    text = ROBOT_FILE.read_text()
    for before, now in (
        ("boot_wait_s = 2.0", "boot_wait_s = 1.05"),
        ("acceleration = 0.5", "acceleration = 4.0"),
        ("velocity = 1.0", "velocity = 1.5"),
    ):
        assert before in text
        text = text.replace(before, now)
    shutil.copy(ROBOT_FILE.with_suffix(".urdf"), folder)
    path = folder / "quick.toml"
    path.write_text(text)
    return path
