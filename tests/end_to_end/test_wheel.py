"""The wheel: it has every file that a user needs, and works without the repository."""

import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("armtree.py", "executive", "hardware", "logs", "skills", "trees")
# What builds the page's libraries, and recordings of the examples for the tests.
NOT_PACKED = ("executive/server/page/", "trees/examples/recordings/")

pytestmark = pytest.mark.slow


def call(*command: str | Path, folder: Path, env: Mapping[str, str] | None = None) -> str:
    done = subprocess.run(
        command, check=False, cwd=folder, env=env, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of the files that git knows."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    beside = ("pyproject.toml", "README.md", "docs/LICENSE")
    names = call("git", "ls-files", *ROOMS, *beside, folder=ROOT).split()
    for name in names:
        path = source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes((ROOT / name).read_bytes())
    options = ("--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--wheel-dir", folder)
    call(sys.executable, "-m", "pip", "wheel", *options, source, folder=folder)
    (built,) = folder.glob("*.whl")
    return built


def test_it_has_every_file_of_the_rooms(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        packed = set(archive.namelist())
    tracked = set(call("git", "ls-files", *ROOMS, folder=ROOT).split())
    missing = {name for name in tracked - packed if not name.startswith(NOT_PACKED)}
    assert not missing
    assert {name for name in tracked if name.startswith("executive/server/page/static/")} <= packed
    assert not {name for name in packed - tracked if ".dist-info/" not in name}
    assert any(name.endswith(".dist-info/licenses/docs/LICENSE") for name in packed)


def test_it_runs_without_the_repository(wheel: Path, tmp_path: Path) -> None:
    place, home = tmp_path / "packages", tmp_path / "home"
    home.mkdir()
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(place)
    packages = [each for each in sys.path if each.endswith("site-packages")]
    env = {"PYTHONPATH": ":".join((str(place), *packages)), "HOME": str(home), "LANG": "C.UTF-8"}

    def armtree(*words: str) -> str:
        command = (sys.executable, "-S", "-m", "armtree", *words)  # without the editable install
        return call(*command, folder=home, env=env)

    assert "rest" in armtree("tasks")
    assert "SUCCEEDED" in armtree("run", "rest", "--port", "virtual")
    assert "plan -> frames  holds" in armtree("replay", "recordings", "--verify")
