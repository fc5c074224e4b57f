"""What an editor says of task files, by the language server that most of them use."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.command_line.language_server import LanguageServer
from tests.support.paths import EXAMPLES, TASKS
from tests.support.servers.javascript import without_node

pytestmark = pytest.mark.slow

MISTAKEN = """\
# yaml-language-server: $schema=task.schema.json
task: 3
name: wave
descripton: Raise the arm.
tree:
  sequence:
    - Wiat: {duration: 1 s}
    - Wait: {duration: 3 kg}
    - subtree: reach
      with: {arm: upright}
    - Say: {text: done}
"""

BEGUN = """\
# yaml-language-server: $schema=task.schema.json
task: 3
name: wave
description: Raise the arm.
tree:
  sequence:
    - subtree: {nothing}
    - Wa: {nothing}
    - subtree: reach
      with:
        {nothing}
"""

if why := without_node("yaml-language-server"):
    pytest.skip(why, allow_module_level=True)


@pytest.fixture(scope="module")
def server() -> Iterator[LanguageServer]:
    with LanguageServer() as server:
        yield server


@pytest.mark.parametrize("folder", [TASKS, EXAMPLES], ids=["shipped", "examples"])
def test_nothing_is_underlined_in_what_ships(server: LanguageServer, folder: Path) -> None:
    files = sorted(folder.glob("**/*.yaml"))
    assert len(files) > 5
    assert {path.name: server.underlined(path) for path in files} == {p.name: [] for p in files}


def test_mistakes_are_underlined(server: LanguageServer, tmp_path: Path) -> None:
    shutil.copy(TASKS / "task.schema.json", tmp_path)
    (tmp_path / "3_wave.yaml").write_text(MISTAKEN)
    lines = {line for line, _ in server.underlined(tmp_path / "3_wave.yaml")}
    assert {4, 7, 8, 10} <= lines
    assert not lines & {3, 6, 9, 11}


def test_what_may_come_is_offered(server: LanguageServer, tmp_path: Path) -> None:
    shutil.copy(TASKS / "task.schema.json", tmp_path)
    path = tmp_path / "4_wave.yaml"
    path.write_text(BEGUN.format(nothing=""))
    server.underlined(path)
    assert {"reach", "move_tool", "open_gripper"} <= server.completed(path, 7, 16)
    assert {"arm", "gripper"} <= server.completed(path, 11, 9)
    assert {"Wait", "PlanArm", "Ask"} <= server.completed(path, 8, 7)
