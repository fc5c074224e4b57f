"""Skills of an installed package: built and installed by pip, found by entry point."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from skills.user_skills import load_skills
from trees.compile.port_types import known_skills
from trees.nodes.kind import reserved_names

pytestmark = pytest.mark.slow

ARMTREE = [sys.executable, "-P", "-m", "armtree"]
PROJECT = """\
[build-system]
requires = ["setuptools"]
build-backend = "setuptools.build_meta"

[project]
name = "armtree-kitchen"
version = "1.0"

[project.entry-points."armtree.skills"]
kitchen = "kitchen"
broken = "kitchen_broken"

[tool.setuptools]
py-modules = ["kitchen", "kitchen_broken"]
"""
KITCHEN = '''\
from skills import skill

@skill
def count_cups(shelf: int) -> int:
    """Count the cups on a shelf."""
    return 2 * shelf
'''
TASK = """\
task: 9
name: cups
description: Count cups.
tree:
  sequence:
    - count_cups: {shelf: 4, result: $cups}
    - Say: {text: cups, value: $cups}
"""


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (os.mkfifo, "it is not an ordinary file"),
        (lambda path: path.symlink_to("/dev/zero"), "it is not an ordinary file"),
        (Path.mkdir, "Is a directory"),
        (lambda path: path.symlink_to("nowhere"), "No such file or directory"),
        (lambda path: path.write_bytes(bytes(2**20 + 1)), "it is larger than 1048576 bytes"),
    ],
    ids=["pipe", "device", "folder", "link", "size"],
)
def test_a_file_that_may_never_end_is_not_read(
    tmp_path: Path, make: Callable[[Path], object], why: str
) -> None:
    path = tmp_path / "endless.py"
    make(path)
    assert load_skills(tmp_path, reserved_names()) == [f"{path}: {why}"]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which the package was installed."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    (source / "pyproject.toml").write_text(PROJECT)
    (source / "kitchen.py").write_text(KITCHEN)
    (source / "kitchen_broken.py").write_text("import no_such_module\n")
    offline = ["--no-index", "--no-build-isolation", "--no-deps", "--quiet"]
    pip = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", *offline]
    subprocess.run([*pip, "--target", str(target), str(source)], check=True)
    return target


def armtree(installed: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [*ARMTREE, *arguments],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(installed)},
    )


def test_its_skills_are_listed_and_a_broken_module_costs_only_itself(installed: Path) -> None:
    done = armtree(installed, "skills", "--json")
    skills = {row["skill"]: row for row in map(json.loads, done.stdout.splitlines())}
    assert skills["count_cups"]["description"] == "Count the cups on a shelf."
    assert set(skills["count_cups"]["ports"]) == {"shelf", "result"}
    assert "broken (kitchen_broken)" in done.stderr
    assert "No module named 'no_such_module'" in done.stderr


def test_its_skills_are_in_the_schema_and_in_tasks(installed: Path, tmp_path: Path) -> None:
    assert '"count_cups"' in armtree(installed, "schema").stdout
    (tmp_path / "9_cups.yaml").write_text(TASK)
    folders = ["--trees", str(tmp_path), "--recordings", str(tmp_path / "recordings")]
    done = armtree(installed, "run", "9", "--port", "virtual", *folders)
    assert "cups 8" in done.stdout


@pytest.mark.parametrize(
    ("function", "words"),
    [
        ("async def wipe() -> None: ...", "wipe is async; a skill is a plain function"),
        ("def wipe(*places: int) -> None: ...", "*places: int is not a port; name each parameter"),
        ("def sequence() -> None: ...", "sequence: a word of the grammar; rename the skill"),
        ("def name() -> None: ...", "name: a word of the grammar"),
    ],
)
def test_functions_that_no_task_could_call(tmp_path: Path, function: str, words: str) -> None:
    (tmp_path / "own.py").write_text(f"from skills import skill\n\n@skill\n{function}\n")
    (wrong,) = load_skills(tmp_path, reserved_names())
    assert words in wrong
    assert not {"wipe", "sequence", "name"} & set(known_skills())


@pytest.mark.parametrize(
    "raised", ["KeyboardInterrupt", "SystemExit(0)", "GeneratorExit", "OSError"]
)
def test_a_plugin_that_raises_costs_only_itself(tmp_path: Path, raised: str) -> None:
    (tmp_path / "own.py").write_text(f"raise {raised}\n")
    name = f"polish_{raised[:5]}"
    (tmp_path / "right.py").write_text(
        f"from skills import skill\n\n@skill\ndef {name}() -> None: ...\n"
    )
    (wrong,) = load_skills(tmp_path, reserved_names())
    assert f"own.py:1: {raised.partition('(')[0]}" in wrong
    assert name in known_skills()


def test_what_a_plugin_prints_goes_to_stderr(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.py").write_text("print('hello')\n")
    assert load_skills(tmp_path, reserved_names()) == []
    assert capsys.readouterr() == ("", "hello\n")


def test_a_skill_with_an_old_name_is_loaded_with_a_warning(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from skills import Skill\n\nclass OldPump(Skill):\n"
        "    def on_start(self): ...\n    def judge(self, robot): ...\n"
    )
    words = f"{tmp_path / 'own.py'}: OldPump.judge is deprecated; rename it to validate"
    with pytest.warns(DeprecationWarning, match=re.escape(words)):
        assert load_skills(tmp_path, reserved_names()) == []


def test_ctrl_c_while_a_plugin_loads_is_meant_for_the_command(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    command = [*ARMTREE, "skills", "--skills", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert "left out" not in done.stderr


@pytest.mark.parametrize(
    "own",
    [
        "from armtree import Skill\nclass Wait(Skill):\n    def on_start(self): ...",
        "from armtree import skill\n@skill\ndef Wait() -> None: ...",
    ],
    ids=["class", "function"],
)
def test_a_skill_of_a_program_replaces_the_shipped_one(own: str) -> None:
    shown = "from trees.compile.port_types import known_skills\nprint(known_skills()['Wait'])"
    command = [sys.executable, "-W", "ignore", "-c", f"{own}\n{shown}"]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ran.stdout == "<class '__main__.Wait'>\n"
