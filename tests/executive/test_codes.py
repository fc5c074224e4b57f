"""The table of codes: complete, and shown in the documents as it is."""

import importlib
import pkgutil

import executive
import hardware
import logs
import skills
import trees
from executive.codes import CODES, INTERNAL, code_table, look_up
from tests.support.paths import ROOT


def every_error() -> set[type[Exception]]:
    """All errors of all rooms."""
    for room in (executive, hardware, logs, skills, trees):
        for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."):
            if not module.name.endswith(("__main__", "worker")):
                importlib.import_module(module.name)
    found, left = set[type[Exception]](), list(Exception.__subclasses__())
    while left:
        kind = left.pop()
        left += kind.__subclasses__()
        if kind.__module__.partition(".")[0] in {
            "executive",
            "hardware",
            "logs",
            "skills",
            "trees",
        }:
            found.add(kind)
    return found


def test_every_error_has_a_code_of_the_table() -> None:
    codes = {kind: getattr(kind, "code", None) for kind in every_error()}
    assert len(codes) > 50
    assert {kind.__name__ for kind, code in codes.items() if code and code not in CODES} == set()


def test_the_document_shows_the_table() -> None:
    assert (ROOT / "executive" / "README.md").read_text().endswith(code_table())


def test_a_code_of_somebody_elses_is_looked_up_by_its_family() -> None:
    assert look_up("plan.of_my_own") is CODES["plan"]
    assert look_up("nobody.knows") is CODES[INTERNAL]


def test_what_fails_says_what_to_do() -> None:
    assert [code for code, known in CODES.items() if not known.means] == []
    assert [code for code, known in CODES.items() if not known.hint] == ["ok", "goal.canceled"]
