"""A full disk under the file that a command writes: the file is named, and no empty one is left."""

import errno
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.faults.means.wrong_calls import WrongCalls
from tests.support.command_line.pseudo_terminal import ARMTREE
from tests.support.paths import ROOT

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not shutil.which("gcc"), reason="needs gcc"),
]

URDF = ROOT / "hardware/robots/arduinobot/arduinobot.urdf"


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (("new-arm", str(URDF), "-o", "arm.toml", "--tool", "claw_support"), "arm.toml"),
        (("plan", "folded", "-o", "way.png"), "way.png"),
        (("schema", "-o", "task.json"), "task.json"),
    ],
    ids=lambda words: words[0] if isinstance(words, tuple) else "",
)
def test_no_empty_file_is_left(tmp_path: Path, words: tuple[str, ...], file: str) -> None:
    disk = WrongCalls(tmp_path, file)
    disk.start(f"errno {errno.ENOSPC}")
    ended = subprocess.run(
        [*ARMTREE, *words],
        cwd=tmp_path,
        env={**os.environ, "XDG_RUNTIME_DIR": str(tmp_path), **disk.environment},
        capture_output=True,
        text=True,
        check=False,
    )
    full = f"Error: {file}: the disk is full; delete files, then try again [file]"
    assert (ended.returncode, ended.stderr.splitlines()[-1]) == (3, full)
    assert not list(tmp_path.glob(f"*{file}*"))
