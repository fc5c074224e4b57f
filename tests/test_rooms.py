"""The house: names, sizes, and what each room says is public."""

import ast
import dataclasses
import importlib
import importlib.metadata
import re
import subprocess
from pathlib import Path

import pytest

from executive.api.codes import INTERRUPTED_EXIT, READER_ENDED_EXIT
from executive.api.events import EVENTS, KINDS, UNITS
from executive.api.outcome import Cause, GoalState, Outcome
from executive.cli.main import cli
from hardware import load_robot, shipped_robots
from hardware.toml_table import TomlTable
from tests.support.codes import all_codes
from tests.support.paths import ROOT

PAGES = ROOT / "docs" / "pages"
ROOMS = ("executive", "skills", "hardware", "trees", "logs")


@pytest.mark.parametrize("name", ["hardware", "logs", "skills", "skills.motion", "trees"])
def test_a_room_marks_its_public_names(name: str) -> None:
    """`from .arm import Arm as Arm` marks a name as public, for people and for type checkers."""
    room = importlib.import_module(name)
    tree = ast.parse(Path(str(room.__file__)).read_text())
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level]
    public = {alias.name: alias.asname for node in imports for alias in node.names}
    public.pop("lazy_exports", None)
    assert len(public) > 10
    assert {name for name, marked in public.items() if marked != name} == set()
    assert [name for name in public if getattr(room, name) is None] == []


def test_the_top_level_is_as_agreed() -> None:
    agreed = {
        *ROOMS,
        "armtree.py",
        "docs",
        "tests",
        "pyproject.toml",
        "README.md",
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "Makefile",
    }
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout, so the files of this project cannot be listed")
    command = ["git", "ls-files", "--cached"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    ours = {Path(line).parts[0] for line in listed.splitlines()}
    assert {name for name in ours if not name.startswith(".")} == agreed


@pytest.mark.slow
def test_the_names_are_ours() -> None:
    claims = importlib.metadata.packages_distributions()
    assert {n: claims[n] for n in ROOMS if set(claims.get(n, ["armtree"])) != {"armtree"}} == {}


def test_architecture_fits_on_a_page() -> None:
    assert len((ROOT / "ARCHITECTURE.md").read_text().splitlines()) <= 120


def test_readme_fits_on_a_screen() -> None:
    """A screen has about 32 rows of 110 characters beside the pictures."""
    shown = re.sub(r"\]\([^)]*\)|<img[^>]*>", "", (ROOT / "README.md").read_text())
    assert sum(1 + len(line) // 110 for line in shown.splitlines()) <= 32


def test_files_that_the_documents_name_exist() -> None:
    for document in ("ARCHITECTURE.md", "README.md"):
        text = (ROOT / document).read_text()
        named = re.findall(r"`((?:executive|skills|hardware|trees|logs|tests)/[\w./]+)`", text)
        assert [name for name in named if not (ROOT / name).exists()] == []


def test_links_of_the_documents_beside_the_site_lead_to_files() -> None:
    """mkdocs checks those of the site."""
    readmes = [path for room in ROOMS for path in (ROOT / room).rglob("README.md")]
    documents = [*ROOT.glob("*.md"), *ROOT.glob(".github/*.md"), *ROOT.glob("docs/*.md"), *readmes]
    found = [
        (path, link)
        for path in documents
        if "node_modules" not in path.parts
        for link in re.findall(r"""(?:\]\(|src=")([^)#"]+)""", path.read_text())
        if not link.startswith("https:")
    ]
    assert len(found) > 20
    assert [(path, link) for path, link in found if not (path.parent / link).exists()] == []


def test_the_page_lists_every_event_and_its_fields() -> None:
    _, _, table = (PAGES / "reference" / "output.md").read_text().partition("## Events")
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == {*KINDS, "result", "error"}
    (ends,) = re.findall(r"^\| `result` \|.*", table, re.MULTILINE)
    ended = Outcome.of(1, GoalState.ABORTED, Cause("", "")).to_json()
    assert set(re.findall(r"`(\w+)`", ends)) == {"result", *ended, *ended["cause"]}
    for kind, event in EVENTS.items():
        row = next(line for line in table.splitlines() if line.startswith(f"| `{event}` |"))
        fields = {UNITS.get(field.name, field.name) for field in dataclasses.fields(kind)}
        named = set(re.findall(r"`(\w+)`", row)) - {event}
        assert named <= fields
        assert "…" in row or named | {"time_s"} == fields


def test_the_robot_page_lists_every_key_that_is_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    done, read = TomlTable.done, {"NAME"}  # in the header of a joint's table

    def noted(table: TomlTable) -> None:
        read.update(table._known)
        done(table)

    monkeypatch.setattr(TomlTable, "done", noted)
    for path in shipped_robots().values():
        robot = load_robot(path)
    guarded = tmp_path / "guarded.toml"  # the last one, with an optional table
    guarded.write_text(f"{robot.path.read_text()}\n[guards]\n")
    load_robot(guarded, robot.urdf)
    page = (PAGES / "reference" / "robot_file.md").read_text()
    listed = set[str]()
    for row in re.findall(r"^\| (`.*?) \|", page, re.MULTILINE):
        listed.update(re.findall(r"\w+", " ".join(re.findall("`.*?`", row))))
    assert listed - {"serial_servo", "feetech"} == read  # names of the drivers


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("lock", 30),
        ("lock-dev", 15),
        ("lock-fleet", 3),
        ("lock-mcp", 15),
        ("lock-ros2", 60),
        ("lock-jazzy", 60),
    ],
)
def test_a_lock_names_no_host_and_hashes_everything(name: str, least: int) -> None:
    lock = (ROOT / ".ci" / f"{name}.txt").read_text()
    assert "://" not in lock
    pins = re.findall(r"^[\w.\-\[\]]+==\S+", lock, re.MULTILINE)
    assert len(pins) > least
    assert len(re.findall(r"^[\w.\-\[\]]+==[^\n]*\\\n    --hash", lock, re.MULTILINE)) == len(pins)


def test_the_locks_agree_and_what_runs_needs_no_tool_of_tests() -> None:
    runs, tests = (
        dict(re.findall(r"^([\w.\-]+)==(\S+)", (ROOT / ".ci" / name).read_text(), re.MULTILINE))
        for name in ("lock.txt", "lock-dev.txt")
    )
    assert {name: runs[name] for name in runs.keys() & tests} == {
        name: tests[name] for name in runs.keys() & tests
    }
    assert not runs.keys() & {"pytest", "mypy", "ruff", "hypothesis", "import-linter"}


def test_the_help_lists_every_exit_status() -> None:
    """The documentation takes them from the help."""
    statuses = {0, INTERRUPTED_EXIT, READER_ENDED_EXIT}
    statuses |= {kind.exit_status for kind in all_codes().values()}
    _, _, listed = (cli.help or "").partition("Exit status:")
    assert {int(number) for number in re.findall(r"(\d+) [a-z]", listed)} == statuses
