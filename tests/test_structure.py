"""The structure: which file may import which, and how much a folder or a file holds."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from itertools import takewhile
from pathlib import Path

import pytest

from executive.cli.main import SECTIONS
from tests.support.paths import ROOT

BELOW = {
    "hardware": set[str](),
    "logs": {"hardware"},
    "skills": {"hardware"},
    "trees": {"hardware", "skills"},
    "executive": {"hardware", "logs", "skills", "trees"},
}
# Folders that may hold more: how much, and why.
CROWDED = {
    "executive": (20, "one folder per part, beside the ways to open an arm"),
    "executive/server/page/static/views": (16, "one file per part of the page"),
    "hardware": (16, "one folder per part, beside what all rooms share, such as clock and errors"),
    "skills": (16, "what all skills share, beside the folders of leaves and motion"),
    "skills/leaves": (20, "one file per skill"),
    "skills/motion": (14, "one folder per step of a plan, beside the values that all steps share"),
    "executive/cli": (28, "one file per group of commands, beside folders of helpers"),
    "docs/pages/how_to": (20, "one page per thing to do"),
    "tests": (20, "one folder per room and per kind of test"),
    "tests/faults/rows": (20, "one file per part that fails"),
    "tests/executive": (19, "one folder per part, as the code"),
    "tests/executive/cli": (28, "one file per group of commands, as the code"),
    "tests/trees": (14, "one folder per part, as the code"),
    "tests/executive/server": (16, "one file per promise of the server"),
    "tests/skills/motion": (
        14,
        "one file per kind of arm and request, beside the folders of the code",
    ),
}
# Files that import others by name, and why.
LOADERS = {
    "hardware.loading.lazy_exports": "public names of a room: the imports that its package lists",
    "hardware.installed": "drivers and skills of other packages",
    "skills.leaves": "a skill is one file of this folder",
    "trees.nodes": "in the order in which messages list the kinds",
    "executive.cli.support.command_group": "a command when it is typed, from the table of `main`",
}
SIBLINGS = 13  # about a dozen
LINES = 600


def modules() -> dict[str, Path]:
    """Every file of the rooms, by its dotted name; a package goes by its own name."""
    files = [path for room in BELOW for path in (ROOT / room).rglob("*.py")]
    named = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in files}
    return {name.removesuffix(".__init__"): path for name, path in named.items()}


MODULES = modules()


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """What a file imports, and its constants."""
    kinds = ast.Import | ast.ImportFrom | ast.Constant
    return tuple(node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, kinds))


def imports(name: str, path: Path) -> Iterator[str]:
    """The files of ours that a file imports or names in a string, wherever in it that is."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            source = ".".join([*above, node.module or ""]).strip(".") if node.level else node.module
            for alias in node.names:
                inner = f"{source}.{alias.name}"
                found = inner if inner in MODULES else source
                if found in MODULES and found != name:
                    yield found
        elif isinstance(node, ast.Constant) and "." in str(node.value) and node.value in MODULES:
            yield str(node.value)


@pytest.fixture(scope="module")
def arrows() -> dict[str, set[str]]:
    """What each file imports."""
    found = {name: set(imports(name, path)) for name, path in MODULES.items()}
    for folder in ("skills.leaves", "trees.nodes"):
        found[folder] |= {name for name in MODULES if name.rpartition(".")[0] == folder}
    commands = [place for section in SECTIONS.values() for place in section]
    found["executive.cli.main"] |= {f"executive.cli.{way.partition('.')[0]}" for way in commands}
    return found


def test_the_arrows_are_seen(arrows: dict[str, set[str]]) -> None:
    assert "hardware.arm.arm" in arrows["hardware"]
    assert "skills" in arrows["executive.executive"]
    assert len(arrows) > 150


def test_only_a_loader_imports_by_name(arrows: dict[str, set[str]]) -> None:
    by_name = re.compile(r"\b(import_module|__import__|run_module)\b")
    found = {name for name, path in MODULES.items() if by_name.search(path.read_text())}
    assert found == {*LOADERS}
    assert "executive.cli.run" in arrows["executive.cli.main"]
    assert "skills.motion.workers.worker_main" in arrows["skills.motion.workers.fork_server"]


def test_rooms_import_only_rooms_below(arrows: dict[str, set[str]]) -> None:
    wrong = [
        f"{name} -> {other}"
        for name, others in arrows.items()
        for other in others
        if (room := name.partition(".")[0]) != (below := other.partition(".")[0])
        and below not in BELOW[room]
    ]
    assert wrong == []


def test_what_a_room_exports_is_imported_from_it() -> None:
    exported = {
        (".".join((room, str(node.module))), alias.name)
        for room in BELOW
        for node in nodes(ROOT / room / "__init__.py")
        if isinstance(node, ast.ImportFrom) and node.level
        for alias in node.names
        if alias.name == alias.asname
    }
    wrong = [
        f"{name}: from {node.module} import {alias.name}"
        for name, path in MODULES.items()
        for node in nodes(path)
        if isinstance(node, ast.ImportFrom) and node.module and not node.level
        if name.partition(".")[0] != node.module.partition(".")[0]
        for alias in node.names
        if (node.module, alias.name) in exported
    ]
    assert wrong == []


def test_no_file_imports_itself_by_way_of_others(arrows: dict[str, set[str]]) -> None:
    assert circles(arrows) == []


def test_a_folder_and_what_is_beside_it_do_not_import_each_other(
    arrows: dict[str, set[str]],
) -> None:
    pairs = set(folder_arrows(arrows))
    assert sorted(pair for pair in pairs if pair[::-1] in pairs) == []


def folder_arrows(arrows: dict[str, set[str]]) -> Iterator[tuple[str, str]]:
    """Which folder imports which folder or file beside it, or is imported by one."""
    for name, others in arrows.items():
        for other in others:
            ways = zip(name.split("."), other.split("."), strict=False)
            same = len(list(takewhile(lambda pair: pair[0] == pair[1], ways)))
            one, two = (".".join(each.split(".")[: same + 1]) for each in (name, other))
            if one != name or two != other:
                yield one, two


def test_an_arrow_between_folders_is_found() -> None:
    arrows = {"a.b.c": {"a.d.e"}, "a.b.f": {"a.b.c", "a.g"}, "a.g": {"a.d.e"}}
    assert list(folder_arrows(arrows)) == [("a.b", "a.d"), ("a.b", "a.g"), ("a.g", "a.d")]


def circles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """The circles that a walk along all arrows closes."""
    found: list[list[str]] = []
    done: set[str] = set()

    def walk(name: str, way: list[str]) -> None:
        if name in way:
            found.append([*way[way.index(name) :], name])
        elif name not in done:
            for other in sorted(arrows[name]):
                walk(other, [*way, name])
            done.add(name)

    for name in sorted(arrows):
        walk(name, [])
    return found


def test_a_circle_is_found() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == [["b", "c", "b"]]


def siblings(folder: Path) -> list[Path]:
    """What people put into a folder, of whatever kind, except what every folder may have."""
    common = {"README.md", "py.typed", "node_modules"}
    found = [path for path in sorted(folder.iterdir()) if path.name not in common]
    named = [path for path in found if not path.name.startswith((".", "__"))]
    return [path for path in named if not path.is_dir() or siblings(path)]


def folders(above: Path) -> Iterator[Path]:
    """A folder and all folders in it."""
    yield above
    for path in siblings(above):
        if path.is_dir():
            yield from folders(path)


FOLDERS = [folder for top in (*BELOW, "docs", "tests") for folder in folders(ROOT / top)]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_folder_holds_about_a_dozen(folder: Path) -> None:
    most, _ = CROWDED.get(str(folder.relative_to(ROOT)), (SIBLINGS, ""))
    assert len(siblings(folder)) <= most


def test_a_folder_that_is_no_longer_crowded_is_not_listed() -> None:
    assert [name for name in CROWDED if len(siblings(ROOT / name)) <= SIBLINGS] == []


def test_no_file_is_long() -> None:
    files = [*MODULES.values(), *(ROOT / "tests").rglob("*.py")]
    long = {str(path): n for path in files if (n := len(path.read_text().splitlines())) > LINES}
    assert long == {}


def test_no_comment_is_behind_what_it_explains() -> None:
    """A formatter breaks a line with a long comment; the comment then belongs above it."""
    torn = re.compile(r"^ *[])}].*  # (?!fmt:|noqa|type:)|= \($\n.*  # .*\n *\)$", re.MULTILINE)
    files = [*MODULES.values(), *(ROOT / "tests").rglob("*.py"), *(ROOT / "docs").rglob("*.py")]
    assert [str(path) for path in files if torn.search(path.read_text())] == []


def test_every_test_lies_where_its_code_does() -> None:
    """`tests/hardware/arm/test_arm_stop.py` tests `hardware/arm/`."""
    homes = [
        path.parent.relative_to(ROOT / "tests") for path in (ROOT / "tests").rglob("test_*.py")
    ]
    rooms = [home for home in homes if home.parts and home.parts[0] in BELOW]
    assert [str(home) for home in rooms if not (ROOT / home).is_dir()] == []
