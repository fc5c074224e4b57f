"""Every command and every block of the documentation does what the page says."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import click
import pytest
from ruamel.yaml import YAML

import armtree
from executive.cli.main import cli
from executive.session import open_executive
from hardware import Robot, load_robot
from skills.motion import Pool
from tests.support.arms.urdfs import urdf
from tests.support.command_line.typed import typed
from tests.support.paths import DATA, ROBOT_FILE, ROOT
from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]

PAGES = ROOT / "docs" / "pages"
_FENCE = re.compile(r'^```(\w*)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
# Pages whose commands are for a server that runs.
SERVED = {"how_to/move.md", "how_to/server.md"}
# Pages whose programs run side by side; tests/docs/test_programs.py types their lines.
SIDE_BY_SIDE = {"how_to/fleet.md", "how_to/language_models.md", "how_to/ros2.md"}
# Other tests run these: the tour, and that of a driver with its package.
ELSEWHERE = {"start.md", "how_to/own_driver.md", *SIDE_BY_SIDE}
# Commands that install or never end, and those of another test.
NOT_TYPED = ("make ", "armtree serve", "curl ")
# How many blocks of a page are `text`: no test types their lines from the page.
TEXT = {
    "how_to/own_driver.md": 1,  # it installs; tests/hardware/drivers/test_driver.py
    "how_to/real_arduino.md": 1,  # avrdude writes into a board
    "how_to/ros2.md": 1,  # colcon; tests/executive/ros2 types what colcon does
    "how_to/service.md": 4,  # they change the system; tests/executive/cli/test_service.py
    "install.md": 4,  # they install; tests/end_to_end/test_wheel.py
}


# The URDF of the arm in `own_arm.md`: it turns and lifts.
_SHAPE = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
_JOINT = (
    '<origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>'
    '<limit velocity="3" effort="1" lower="0" upper="0.4"/>'
)
LIFT = urdf(
    [f"base -> column: continuous turn {_JOINT}", f"column -> carriage: prismatic lift {_JOINT}"],
    _SHAPE,
)
TASK = "task: {0}\nname: {1}\ndescription: A task.\ntree:\n  Succeed: {{}}\n"


class Block(NamedTuple):
    page: str
    language: str
    title: str
    text: str


def _blocks() -> Iterator[Block]:
    for path in sorted(PAGES.rglob("*.md")):
        for language, title, text in _FENCE.findall(path.read_text()):
            yield Block(str(path.relative_to(PAGES)), language, title, text)


BLOCKS = list(_blocks())
TYPED = sorted({block.page for block in BLOCKS if block.language == "sh"} - ELSEWHERE)


def lines(page: str, left_out: tuple[str, ...] = NOT_TYPED) -> list[str]:
    """The commands of a page that are typed, in order."""
    found = "".join(block.text for block in BLOCKS if block[:2] == (page, "sh"))
    return [line for line in found.splitlines() if line and not line.startswith(left_out)]


def texts(page: str, language: str) -> list[str]:
    """The blocks of a page in a language, in order."""
    return [block.text for block in BLOCKS if block[:2] == (page, language)]


def test_only_these_blocks_are_not_run() -> None:
    assert Counter(block.page for block in BLOCKS if block.language == "text") == TEXT


def test_every_block_has_a_language() -> None:
    assert {block.language for block in BLOCKS} <= {
        "ini", "json", "python", "sh", "text", "toml", "xml", "yaml",
    }  # fmt: skip


def _mentioned() -> Iterator[tuple[str, str]]:
    """Every command that a page names, in a block or in a sentence."""
    others = [ROOT / "README.md", *(ROOT / ".github").rglob("*.*")]
    for path in [*PAGES.rglob("*.md"), *others]:
        text = path.read_text()
        fenced = "".join(words for *_, words in _FENCE.findall(text))
        found = re.findall(r"`(armtree [^`\n]+)`", _FENCE.sub("", text))
        for line in found + re.findall(r"^armtree .+$", fenced, re.MULTILINE):
            yield path.name, line


def test_every_command_and_option_that_a_page_names_exists() -> None:
    found = list(_mentioned())
    assert len(found) > 150
    assert [(page, line, word) for page, line in found if (word := _unknown(line))] == []


def _unknown(line: str) -> str:
    """Return the word of a command line that names no command or option; "" if there is none."""
    command: click.Command = cli
    options = {"--help", "--version"}
    for word in re.split(r"\s+", re.split(r" (?:[|&#]|-- )", line)[0])[1:]:
        options |= {name for each in command.params for name in (*each.opts, *each.secondary_opts)}
        if word.startswith("-"):
            if re.match("--?[a-z]", word) and word.partition("=")[0] not in options:
                return word
        elif isinstance(command, click.Group) and re.fullmatch("[a-z-]+", word):
            inner = command.get_command(click.Context(command), word)
            if inner is None:
                return word
            command = inner
    return ""


def test_data_of_the_pages_can_be_read() -> None:
    read: dict[str, Callable[[str], Any]] = {
        "json": json.loads,
        "toml": tomllib.loads,
        "yaml": YAML(typ="safe").load,
    }
    for block in BLOCKS:
        if block.language in read:
            assert read[block.language](block.text), block
        elif block.language == "python":
            compile(block.text, block.page, "exec")


@pytest.fixture
def quick(
    quick_robot: Robot, real_pool: Pool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """A folder to type commands in, with the quick arm and planners that are ready."""
    runs = partial(open_executive, pool=real_pool)
    monkeypatch.setattr("executive.cli.support.run_tasks.open_executive", runs)
    monkeypatch.setenv("ARMTREE_ROBOT", str(quick_robot.path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_arm.urdf").write_bytes(ROBOT_FILE.with_suffix(".urdf").read_bytes())
    (tmp_path / "lift.urdf").write_text(LIFT)
    shutil.copytree(DATA / "upgrades" / "0.1.0" / "recordings", tmp_path / "recordings")
    return tmp_path


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("page", [page for page in TYPED if page not in SERVED])
def test_the_commands_of_a_page(page: str, quick: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for block in BLOCKS:
        if block.page == page and block.title:
            (quick / block.title).parent.mkdir(parents=True, exist_ok=True)
            (quick / block.title).write_text(block.text)
    for line in lines(page):
        words = shlex.split(line.replace("JOINT", "joint_1").replace("/dev/ttyACM0", "virtual"))
        if words[0] == "export":
            for word in words[1:]:
                monkeypatch.setenv(*word.split("=", 1))
            continue
        if "--robot" in words:  # the planners that are ready are for another arm
            monkeypatch.setattr("executive.cli.support.run_tasks.open_executive", open_executive)
        status, out, err = typed(quick / "recordings", *words[1:])
        expected = 12 if line.startswith("armtree log diff") else 0  # the two runs differ
        assert status == expected, f"{line}\n{out}\n{err}"


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted(SERVED))
def test_the_commands_for_a_server(
    page: str, serve: Serve, quick: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = serve(active="armtree arm activate" not in lines(page))
    monkeypatch.setenv("ARMTREE_SERVER", f"http://127.0.0.1:{served.server.port}")
    for line in lines(page):
        status, out, err = typed(quick / "recordings", *shlex.split(line)[1:])
        assert status == 0, f"{line}\n{out}\n{err}"
    for block in BLOCKS:
        if block[:2] == (page, "python"):
            exec(compile(block.text, page, "exec"), {})


@pytest.mark.slow
def test_a_task_over_http(serve: Serve) -> None:
    if not shutil.which("curl"):
        pytest.skip("curl is not installed")
    served = serve()
    page = "".join(block.text for block in BLOCKS if block[:2] == ("how_to/server.md", "sh"))
    answer: dict[str, Any] = {}
    for line in re.findall(r"^curl .+$", page, re.MULTILINE):
        for words, actual in (
            ("TOKEN", served.server.token),
            ("GOAL_ID", answer.get("goal_id", "")),
            ("localhost:8765", f"localhost:{served.server.port}"),
        ):
            line = line.replace(words, actual)  # noqa: PLW2901
        done = subprocess.run(
            [*shlex.split(line), "--silent"], check=True, capture_output=True, text=True, timeout=60
        )
        answer = json.loads(done.stdout)
    assert (answer["task"], answer["state"]) == (1, "SUCCEEDED")


@pytest.mark.slow
def test_the_programs_of_the_python_pages(quick: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one process."""
    arm = partial(armtree.Arm, robot=Path(os.environ["ARMTREE_ROBOT"]))
    monkeypatch.setattr(armtree, "Arm", arm)
    names: dict[str, Any] = {}
    (quick / "trees").mkdir()
    for page in ("how_to/recordings.md", "how_to/python.md", "how_to/ci.md"):
        for block in BLOCKS:
            if block[:2] == (page, "python"):
                exec(compile(block.text, page, "exec"), names)
    names["test_pick"]()
    assert {"time_ns", "joint_1"} <= {*names["joints"].columns}
    assert len(names["joints"]) > 10


def test_the_files_of_reference_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A block that is a part of a file is completed."""
    monkeypatch.chdir(tmp_path)
    wave, tree, parameters, subtree = texts("reference/tasks.md", "yaml")
    head = "task: {0}\nname: {1}\ndescription: A task.\n"
    uses = "tree:\n  repeat:\n    {Say: {text: $mode, value: $swing}}\n  times: $times\n"
    for name, text in (
        ("3_wave.yaml", wave),
        ("4_tree.yaml", head.format(4, "tree") + tree),
        ("5_set.yaml", head.format(5, "set") + parameters + uses),
        ("move_both.yaml", subtree),
    ):
        Path("trees", name).parent.mkdir(exist_ok=True)
        Path("trees", name).write_text(text)
    status, out, err = typed(tmp_path, "check")
    assert status == 0, out + err

    (settings,) = texts("reference/settings.md", "toml")
    Path("armtree.toml").write_text(settings)
    status, out, err = typed(tmp_path, "config", "recording_timeout")
    assert (status, "armtree.toml" in out) == (0, True), out + err


def test_the_robot_file_of_bus_servos(tmp_path: Path) -> None:
    (block,) = texts("how_to/bus_servos.md", "toml")
    (tmp_path / "one.urdf").write_text(urdf([f"base -> arm: revolute joint_1 {_JOINT}"], _SHAPE))
    (tmp_path / "one.toml").write_text(
        f'name = "one"\nurdf = "one.urdf"\n{block}\n[groups]\narm = ["joint_1"]\n'
        '[collision]\nmargin_m = 0.005\nfloor_ignores = []\nallowed = [["base", "arm"]]\n'
    )
    assert load_robot(tmp_path / "one.toml").actuated[0].name == "joint_1"


def test_the_hook_checks_every_task_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (hook,) = YAML(typ="safe").load((ROOT / ".pre-commit-hooks.yaml").read_text())
    monkeypatch.chdir(tmp_path)
    for name, text in (
        ("3_wave.yaml", TASK.format(3, "wave")),
        ("arduinobot/4_greet.yaml", TASK.format(4, "greet")),
        ("arduinobot/poses.yaml", "poses: {low: {joint_1: 1}}\n"),
    ):
        path = Path("trees", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    found = [path for path in Path().rglob("*.yaml") if re.search(hook["files"], str(path))]
    assert len(found) == 3
    assert not re.search(hook["files"], "street/trees.yaml")
    status, out, err = typed(tmp_path, *hook["entry"].split()[1:], *map(str, found))
    assert status == 0, out + err


def test_the_service_is_accepted_by_systemd(tmp_path: Path) -> None:
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd-analyze is not installed")
    (unit,) = (block.text for block in BLOCKS if block.language == "ini")
    file = tmp_path / "armtree.service"
    file.write_text(unit.replace("/opt/armtree/bin/armtree", sys.executable))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(file)],
        check=False,
        capture_output=True,
        text=True,
    )
    ours = [line for line in done.stderr.splitlines() if "armtree" in line]
    assert (done.returncode, ours) == (0, [])
