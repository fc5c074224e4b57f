"""What is installed, compared with importlib.metadata."""

import importlib.metadata
from pathlib import Path

import pytest

from hardware.installed import entry_points, version


@pytest.mark.parametrize("group", ["armtree.hardware", "pytest11", "no.such.group"])
def test_entry_points_are_those_of_the_standard_library(group: str) -> None:
    wanted = {each.name: each for each in importlib.metadata.entry_points(group=group)}
    found = entry_points(group)
    assert {name: each.module for name, each in found.items()} == {
        name: each.module for name, each in wanted.items()
    }
    assert all(each.load() is wanted[name].load() for name, each in found.items())


def test_versions_are_those_of_the_standard_library() -> None:
    for name in ("armtree", "numpy", "pin", "coal", "py_trees"):
        assert version(name) == importlib.metadata.version(name)
    assert version("no_such_package") == ""


def test_the_first_package_on_the_path_has_precedence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder, text in (
        ("a", "# x = y\n[other]\nz = z\n\n[arms]\none = first:Arm [extra]\n"),
        ("b", "[arms]\n; two = no\none=second\ntwo = math:pi\n[more]\nthree = second\n"),
    ):
        info = tmp_path / folder / f"{folder}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "entry_points.txt").write_text(text)
        monkeypatch.syspath_prepend(tmp_path / "missing")
    monkeypatch.syspath_prepend(tmp_path / "b")
    monkeypatch.syspath_prepend(tmp_path / "a")
    found = entry_points("arms")
    assert {name: each.value for name, each in found.items()} == {
        "one": "first:Arm",
        "two": "math:pi",
    }
    assert found["two"].load() == pytest.approx(3.14159265)
    assert version("b") == "1.0"
