"""An installed armtree has every file, works without the repository, and leaves others alone."""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.support.arms.quick_arm import quick_arm
from tests.support.paths import ROOT

ROOMS = ("armtree.py", "executive", "hardware", "logs", "skills", "trees")
BESIDE = ("pyproject.toml", "README.md", "docs/LICENSE", ".ci/build_backend.py")
# What builds the page's libraries, and recordings of the examples for the tests.
NOT_PACKED = ("executive/server/page/", "trees/examples/recordings/")
FOLDER = "armtree_rooms/"

pytestmark = pytest.mark.slow


def call(*command: str | Path, folder: Path, status: int = 0, longest: float = 120.0) -> str:
    """Run a command for at most `longest` [s], and return what it printed."""
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        command,
        check=False,
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
        timeout=longest,
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def tracked() -> list[str]:
    """The files of the rooms that git knows."""
    return call("git", "ls-files", *ROOMS, folder=ROOT).split()


def copy_sources(tracked: list[str], folder: Path) -> None:
    """Copy what a wheel is built from."""
    for name in (*tracked, *BESIDE):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes((ROOT / name).read_bytes())


@pytest.fixture(scope="module")
def wheel(tracked: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel, built from the source archive that was built from the files that git knows."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    copy_sources(tracked, source)
    build = "import sys; sys.path.insert(0, '.ci'); import build_backend as b; b.build_{}('{}')"
    call(sys.executable, "-c", build.format("sdist", folder), folder=source)
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        packed.extraction_filter = getattr(tarfile, "data_filter", None)  # not in Python 3.11.2
        packed.extractall(folder / "unpacked")
    (unpacked,) = (folder / "unpacked").iterdir()
    call(sys.executable, "-c", build.format("wheel", folder), folder=unpacked)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new environment with the wheel. Its other packages are those of the tests."""
    place = tmp_path_factory.mktemp("environment")
    call(sys.executable, "-m", "venv", "--without-pip", place, folder=place)
    pip = (sys.executable, "-m", "pip", "--python", place / "bin" / "python")
    call(*pip, "install", "--quiet", "--no-deps", "--no-index", wheel, folder=place)
    packages = [each for each in sys.path if each.endswith("site-packages")]
    (own,) = place.glob("lib/python*/site-packages")
    (own / "dependencies.pth").write_text("\n".join(packages))  # without the editable install
    return place


def test_it_has_every_file_of_the_rooms(wheel: Path, tracked: list[str]) -> None:
    with zipfile.ZipFile(wheel) as archive:
        assert archive.testzip() is None
        packed = {name.removeprefix(FOLDER) for name in archive.namelist()}
    missing = {name for name in {*tracked} - packed if not name.startswith(NOT_PACKED)}
    assert not missing
    assert {name for name in tracked if name.startswith("executive/server/page/static/")} <= packed
    others = {name for name in packed - {*tracked} if ".dist-info/" not in name}
    assert others == {"armtree.pth"}
    assert any(name.endswith(".dist-info/licenses/docs/LICENSE") for name in packed)


def test_it_has_only_names_of_its_own(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        top = {name.partition("/")[0] for name in archive.namelist()}
    assert {name for name in top if not name.startswith("armtree")} == set()


def test_it_runs_without_the_repository(environment: Path, tmp_path: Path) -> None:
    def armtree(*words: str) -> str:
        return call(environment / "bin" / "armtree", *words, folder=tmp_path)

    assert "rest" in armtree("tasks")
    assert "SUCCEEDED" in armtree("run", "rest", "--robot", str(quick_arm(tmp_path)))
    assert "plan -> frames  holds" in armtree("replay", "recordings", "--verify")
    python = environment / "bin" / "python"
    where = "import logs, armtree; print(armtree.Arm.__module__, logs.__file__)"
    assert f"executive.arm {environment}" in call(python, "-c", where, folder=tmp_path)


def test_another_package_keeps_its_name(environment: Path, tmp_path: Path) -> None:
    (own,) = environment.glob("lib/python*/site-packages")
    other = own / "logs.py"
    other.write_text("NAME = 'other'\n")
    try:
        python, named = environment / "bin" / "python", "import logs; print(logs.NAME)"
        assert call(python, "-c", named, folder=tmp_path) == "other\n"
        said = call(environment / "bin" / "armtree", "tasks", folder=tmp_path, status=1)
        assert (
            f"Another package named logs hides the package logs of armtree: {other}. If that "
            "package is yours, rename it" in said
        )
    finally:
        other.unlink()


def test_the_page_builds_it(tracked: list[str], wheel: Path, tmp_path: Path) -> None:
    """The page lets pip fetch what builds; here it is installed."""
    copy_sources(tracked, tmp_path)
    (line,) = re.findall(
        r"^pip wheel .*$", (ROOT / "docs/pages/install.md").read_text(), re.MULTILINE
    )
    call(sys.executable, "-m", *line.split(), "--no-build-isolation", folder=tmp_path)
    assert [each.name for each in (tmp_path / "dist").iterdir()] == [wheel.name]


@pytest.mark.parametrize("tool", ["pipx", "uv", "uvx"])
def test_a_tool_installs_it_as_the_page_says(tool: str, wheel: Path, tmp_path: Path) -> None:
    """With all that it needs, from the index of packages."""
    page = (ROOT / "docs" / "pages" / "install.md").read_text()
    (line,) = re.findall(rf"^{tool} .*\.whl.*$", page, re.MULTILINE)
    (tmp_path / "dist").mkdir()
    shutil.copy(wheel, tmp_path / "dist")
    cache = os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")
    with TemporaryDirectory() as home:  # half a gigabyte, which pytest would keep for three runs
        own = {
            "HOME": home,
            "PATH": f"{home}/.local/bin:{Path(sys.executable).parent}:{os.environ['PATH']}",
            "XDG_CACHE_HOME": cache,
            "PIPX_DEFAULT_PYTHON": sys.executable,
            "UV_PYTHON": sys.executable,
            "ARMTREE_ROBOT": quick_arm(tmp_path),
        }
        words = f"{line}\n" if tool == "uvx" else f"{line}\ncommand -v armtree\narmtree doctor\n"
        said = call("env", *(f"{name}={value}" for name, value in own.items()), "sh", "-euc", words,
                    folder=tmp_path, longest=600.0)  # fmt: skip
    found = (
        ("task 1 SUCCEEDED",) if tool == "uvx" else (f"{home}/.local/bin/armtree", "ok  planner")
    )
    assert [each for each in found if each not in said] == []


def test_the_lines_of_the_container_install_it(wheel: Path, tmp_path: Path) -> None:
    """No builder runs here. Each line runs in a folder in place of the root of the image."""
    recipe = (ROOT / ".ci" / "Containerfile").read_text()
    lines = [line.partition(" ") for line in recipe.splitlines() if not line.startswith("#")]
    assert [word for word, *_ in lines] == [
        *("FROM", "RUN", "COPY", "RUN", "RUN", "RUN"),
        *("USER", "WORKDIR", "ENV", "ENTRYPOINT", "CMD"),
    ]
    for folder in ("bin", "tmp", "opt"):
        (tmp_path / folder).mkdir()
    (tmp_path / "tmp" / wheel.name).write_bytes(wheel.read_bytes())
    for name in ("useradd", "install", "apt-get"):  # only a builder may change a system
        (tmp_path / "bin" / name).write_text(f"#!/bin/sh\ncommand -v /usr/*bin/{name}\n")
        (tmp_path / "bin" / name).chmod(0o755)
    own = {"PATH": f"{tmp_path}/bin:{os.environ['PATH']}", "PIP_NO_DEPS": "1", "PIP_NO_INDEX": "1"}
    for line in (words for word, _, words in lines if word == "RUN"):
        placed = re.sub(r"(?<= )/(?=opt|tmp|work)|^/(?=opt)", f"{tmp_path}/", line)
        call("env", *(f"{name}={value}" for name, value in own.items()), "sh", "-euc", placed,
             folder=tmp_path)  # fmt: skip
    (site,) = tmp_path.glob("opt/armtree/lib/python*/site-packages")
    packages = [each for each in sys.path if each.endswith("site-packages")]
    (site / "dependencies.pth").write_text("\n".join(packages))
    (entry,) = (json.loads(words) for word, _, words in lines if word == "ENTRYPOINT")
    said = call(f"{tmp_path}{entry[0]}", "run", "rest", "--port", "virtual", folder=tmp_path)
    assert "SUCCEEDED" in said
