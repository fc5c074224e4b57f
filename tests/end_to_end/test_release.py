"""`.ci/release` makes files that a user can check, and builds them from the commit alone."""

import os
import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest

from tests.support.paths import ROOT

pytestmark = pytest.mark.slow
VERSION = "0.1.0"


def call(folder: Path, *command: str | Path, status: int = 0) -> str:
    """Run a command, and return what it printed. No other configuration of git counts."""
    person = {
        f"GIT_{who}_{what}": "x" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")
    }
    own = {"ARMTREE_UNTESTED": "1", "GIT_CONFIG_GLOBAL": os.devnull, **person}
    done = subprocess.run(
        command, check=False, cwd=folder, env=os.environ | own, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120,
    )  # fmt: skip
    assert done.returncode == status, done.stdout
    return done.stdout


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A clone with a release in its changelog, and with the scripts as they are now."""
    folder = tmp_path / "clone"
    call(tmp_path, "git", "clone", "--quiet", ROOT, folder)
    shutil.copytree(ROOT / ".ci", folder / ".ci", dirs_exist_ok=True)
    changes = folder / "CHANGELOG.md"
    changes.write_text(changes.read_text().replace("## Unreleased", f"## {VERSION}"))
    call(folder, "git", "commit", "--quiet", "--all", "--message", "A release")
    (folder / ".venv").symlink_to(ROOT / ".venv")
    (folder / ".git" / "info" / "exclude").write_text(".venv\n")
    return folder


def test_a_signed_release_can_be_checked(clone: Path, tmp_path: Path) -> None:
    key = tmp_path / "key"
    call(tmp_path, "ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key)
    call(clone, clone / ".ci" / "release", VERSION, key)
    dist = clone / "dist"
    wheel, archive = f"armtree-{VERSION}-py3-none-any.whl", f"armtree-{VERSION}.tar.gz"
    signed = {"SHA256SUMS", "SHA256SUMS.sig", "allowed_signers", "NOTES.md"}
    assert {each.name for each in dist.iterdir()} == {wheel, archive, *signed}
    notes = (dist / "NOTES.md").read_text()
    assert notes.startswith("### Tasks\n")
    _, _, block = notes.partition("```sh\n")
    commands = block.partition("```")[0].splitlines()
    assert len(commands) == 2
    for line in commands:
        call(dist, "sh", "-c", line)
    with tarfile.open(dist / archive) as packed:
        folders = {name.split("/")[1] for name in packed.getnames() if "/" in name}
    assert "tests" not in folders
    assert "hardware" in folders
    sums = dist / "SHA256SUMS"
    sums.write_text(sums.read_text().replace("0", "1"))
    for line in commands:
        call(dist, "sh", "-c", f"! {line}")


def test_a_work_tree_with_changes_is_refused(clone: Path) -> None:
    (clone / "README.md").write_text("changed")
    said = call(clone, clone / ".ci" / "release", VERSION, status=1)
    assert said == "release: the work tree has changes: commit them first\n"


def test_a_release_without_notes_is_refused_before_its_tests(clone: Path, tmp_path: Path) -> None:
    """A `make` that only makes a file takes the place of the tests."""
    changes = clone / "CHANGELOG.md"
    changes.write_text(changes.read_text().replace(f"## {VERSION}", "## Unreleased"))
    call(clone, "git", "commit", "--quiet", "--all", "--message", "No release")
    tested = tmp_path / "tested"
    (tmp_path / "make").write_text(f"#!/bin/sh\ntouch {tested}\n")
    (tmp_path / "make").chmod(0o755)
    path = f"PATH={tmp_path}:{os.environ['PATH']}"
    command = ("env", "ARMTREE_UNTESTED=", path, clone / ".ci" / "release", VERSION)
    said = call(clone, *command, status=1)
    assert said == f"release: CHANGELOG.md has no section '## {VERSION}'\n"
    assert not tested.exists()
