"""Codes: every error class has one, and the documents show what the classes say."""

import importlib
import pkgutil
import subprocess
import sys

import pytest

import executive
import hardware
import logs
import skills
import trees
from executive.code_table import exit_status, look_up, meaning
from hardware import ArmtreeError, HardwareError
from tests.support.codes import all_codes
from tests.support.paths import ROOT

ROOMS = (executive, hardware, logs, skills, trees)


def every_error() -> set[type[Exception]]:
    """All errors of all rooms."""
    for room in ROOMS:
        for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."):
            if not module.name.endswith("worker") and ".ros2." not in module.name:
                importlib.import_module(module.name)  # ROS 2 may not be installed
    found, left = set[type[Exception]](), list(Exception.__subclasses__())
    while left:
        kind = left.pop()
        left += kind.__subclasses__()
        if kind.__module__.partition(".")[0] in {room.__name__ for room in ROOMS}:
            found.add(kind)
    return found


@pytest.mark.slow
def test_every_error_with_a_code_is_listed() -> None:
    codes = {kind: getattr(kind, "code", None) for kind in every_error()}
    assert len(codes) > 50
    listed = all_codes()
    assert {kind.__name__ for kind, code in codes.items() if code and code not in listed} == set()


def test_the_table_loads_every_module_that_has_an_error_with_a_code() -> None:
    """In a process of its own, as a client does that is told a code of another room."""
    show = "from executive.code_table import *; load_errors(); print(*ArmtreeError.by_code)"
    command = [sys.executable, "-c", show]
    loaded = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    every_error()
    assert {*all_codes()} == {*loaded.split()}


def test_a_code_belongs_to_one_class() -> None:
    kinds = every_error() - {ArmtreeError}  # the class of bugs has its code
    codes = [kind.__dict__["code"] for kind in kinds if "code" in kind.__dict__]
    assert sorted(codes) == sorted(set(codes))


@pytest.mark.parametrize(
    ("code", "known"),
    [
        ("plan.of_my_own", "plan.error"),
        ("hw.of_my_own", "hw.error"),
        ("task.of_my_own", "task.failed"),
        ("file.of_my_own", "file"),
        ("server.of_my_own", "server.error"),
        ("request.of_my_own", "request"),
        ("plan", "plan.error"),
        ("unknown.code", "internal"),
        ("", "internal"),
    ],
)
def test_an_unknown_code_is_looked_up_by_its_family(code: str, known: str) -> None:
    assert look_up(code) is all_codes()[known]


def test_success_is_no_error() -> None:
    assert exit_status("ok") == 0
    assert "ok" not in all_codes()


def test_only_a_bug_is_an_error_of_the_server() -> None:
    """The HTTP status of every other code blames the request, or the state of the arm."""
    assert [code for code, kind in all_codes().items() if kind.http_status >= 500] == ["internal"]


def test_a_driver_describes_its_own_errors() -> None:
    class GripperHot(HardwareError):
        """The motor of the gripper is hot. The driver reads its temperature."""

        code = "hw.test_gripper_hot"
        hint = "let it cool"

    known = look_up(GripperHot.code)
    assert (known.exit_status, known.hint) == (6, "let it cool")
    assert meaning(known) == "The motor of the gripper is hot"
    assert GripperHot.code not in all_codes()


def test_what_fails_says_what_to_do() -> None:
    codes = all_codes()
    assert [code for code, kind in codes.items() if not meaning(kind)] == []
    vague = ("", "see the message")
    assert [code for code, kind in codes.items() if kind.hint in vague] == []
