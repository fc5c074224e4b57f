"""The tour of the documentation, typed into the shells that people use."""

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.support.arms.quick_arm import quick_arm
from tests.support.paths import ROOT

PAGE = (ROOT / "docs" / "pages" / "start.md").read_text()
TOUR = [
    line for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) for line in block.split("\n")
]
TOUR = [line for line in TOUR if line and line != "make demo"]
((TASK, TEXT),) = re.findall(r'```yaml title="([^"]+)"\n(.*?)```', PAGE, re.DOTALL)


def test_no_command_has_a_comment_which_zsh_would_take_for_words() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs" / "pages").rglob("*.md")]
    blocks = re.findall(r"```sh\n(.*?)```", "".join(page.read_text() for page in pages), re.DOTALL)
    assert [line for block in blocks for line in block.splitlines() if " #" in line] == []


def typed(
    shell: str, commands: Sequence[str], folder: Path, robot: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Type commands into a shell, the first in the repository and the others in a folder."""
    lines = [f"cd {shlex.quote(str(ROOT))}", commands[0], f"cd {shlex.quote(str(folder))}"]
    lines += [f"{command} || exit 99" for command in commands[1:]]
    quiet = {"bash": ["--norc", "--noprofile"], "zsh": ["-f"], "fish": ["--no-config"]}[shell]
    return subprocess.run(
        [shell, *quiet, "-c", "\n".join(lines)],
        check=False,
        capture_output=True,
        text=True,
        timeout=600,
        env={**os.environ, **({"ARMTREE_ROBOT": str(robot)} if robot else {})},
    )


@pytest.mark.slow
def test_the_tour(tmp_path: Path) -> None:
    (tmp_path / TASK).parent.mkdir()
    (tmp_path / TASK).write_text(TEXT)
    done = typed("bash", TOUR, tmp_path, quick_arm(tmp_path))
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    assert "1  pick" in done.stdout
    assert (tmp_path / "plan.png").exists()
    assert len(list(tmp_path.glob("recordings/*-1.png"))) == 2
    assert "3 of 3 recordings are verified" in done.stdout


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_start_what_bash_starts(tmp_path: Path, shell: str) -> None:
    """An `armtree` that prints its arguments stands in for the real one."""
    if not shutil.which(shell):
        pytest.skip(f"{shell} is not installed")
    echo = tmp_path / "bin" / "armtree"
    echo.parent.mkdir()
    echo.write_text("#!/bin/sh\nprintf '<%s>' \"$@\"\necho\n")
    echo.chmod(0o755)
    (tmp_path / "recordings").mkdir()
    for name in ("a-1", "b-1", "b-2"):
        (tmp_path / f"recordings/{name}.mcap").touch()
    commands = [TOUR[0], f'export PATH="{echo.parent}:$PATH"', *TOUR[1:]]
    bash, other = typed("bash", commands, tmp_path), typed(shell, commands, tmp_path)
    assert bash.returncode == other.returncode == 0, other.stderr
    assert len(bash.stdout.splitlines()) == len(TOUR) - 1
    assert other.stdout == bash.stdout
