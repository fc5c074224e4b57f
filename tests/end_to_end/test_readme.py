"""The tour of the README, typed into the shells that people use."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.paths import ROOT

pytestmark = pytest.mark.slow

README = (ROOT / "README.md").read_text()
BLOCKS = [block.splitlines() for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL)]
TOUR = next(block for block in BLOCKS if block[0].startswith("export PATH"))


def test_no_command_has_a_comment_which_zsh_would_take_for_words() -> None:
    assert [line for block in BLOCKS for line in block if " #" in line] == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_tour(tmp_path: Path, shell: str) -> None:
    """The first line is typed in the repository, the others elsewhere."""
    if not shutil.which(shell):
        pytest.skip(f"{shell} is not installed")
    first, *commands = TOUR
    typed = [f"cd {shlex.quote(str(ROOT))}", first, f"cd {shlex.quote(str(tmp_path))}"]
    typed += [f"{command} || exit 99" for command in commands]
    quiet = {"bash": ["--norc", "--noprofile"], "zsh": ["-f"], "fish": ["--no-config"]}[shell]
    done = subprocess.run(
        [shell, *quiet, "-c", "\n".join(typed)],
        check=False,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    assert "1  pick" in done.stdout
    assert (tmp_path / "plan.png").exists()
    assert len(list(tmp_path.glob("recordings/*-1.png"))) == 2
    assert "3 of 3 recordings hold" in done.stdout
