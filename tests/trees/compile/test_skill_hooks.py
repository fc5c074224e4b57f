"""What breaks in the code of a skill before the run: a mistake at its node, and nowhere else."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from py_trees.common import Status
from py_trees.ports import PortInformation

from executive.cli.main import cli
from hardware import Robot
from skills import BadTarget, Positions, Skill
from trees.check import check

HEAD = "task: {}\nname: {}\ndescription: d\ntree:\n  sequence:\n    - {}\n"


class Frail(Skill):
    """Answers what a test says."""

    answers: dict[str, Callable[[], Any]]

    def __init__(self, name: str, context: Any) -> None:
        if self.answers["__init__"]() is None:
            super().__init__(name, context)

    def on_start(self) -> Status:
        return Status.SUCCESS

    @classmethod
    def min_duration(cls, *_: object) -> Any:
        return cls.answers["min_duration"]()

    @classmethod
    def poses(cls, *_: object) -> Any:
        return cls.answers["poses"]()

    @classmethod
    def body(cls, *_: object) -> Any:
        return cls.answers["body"]()


def boom() -> Any:
    raise RuntimeError("boom")


def leave() -> Any:
    raise SystemExit(3)


def refuse() -> Any:
    raise BadTarget("not there")


RAISED = "Frail.{} raised RuntimeError: boom"
POSES = "a list of tuples of 4 numbers"
BREAKS: list[tuple[str, Callable[[], Any], str]] = [
    ("__init__", boom, RAISED.format("__init__")),
    ("__init__", lambda: "no call of that of Skill", "Frail.__init__ gave "),
    ("min_duration", boom, RAISED.format("min_duration")),
    ("min_duration", leave, "Frail.min_duration raised SystemExit: 3"),
    ("min_duration", lambda: "long", "Frail.min_duration gave 'long', not a number"),
    (
        "min_duration",
        lambda: [10**5000],
        "Frail.min_duration gave a list that cannot be shown, not a",
    ),
    ("min_duration", lambda: math.nan, "Frail.min_duration gave nan, not a number"),
    ("min_duration", lambda: 10**400, "Frail.min_duration gave 1000"),
    ("poses", boom, RAISED.format("poses")),
    ("poses", refuse, "Frail: not there"),
    ("poses", lambda: None, f"Frail.poses gave None, not {POSES}"),
    ("poses", lambda: [("x",)], f"Frail.poses gave [('x',)], not {POSES}"),
    ("poses", lambda: [(math.nan,) * 4], f"not {POSES}"),
    ("poses", lambda: [(10**400,) * 4], f"not {POSES}"),
    ("body", boom, RAISED.format("body")),
    ("body", lambda: "a cup", "Frail.body gave 'a cup', not a Body or None"),
]


@pytest.fixture
def answer(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, Callable[[], Any]], None]:
    """Says what Frail answers when it is asked one thing; all else it answers rightly."""

    def say(what: str, how: Callable[[], Any]) -> None:
        right: dict[str, Callable[[], Any]] = {
            "__init__": lambda: None,
            "min_duration": lambda: 0.0,
            "poses": list,
            "body": lambda: None,
        }
        monkeypatch.setattr(Frail, "answers", right | {what: how}, raising=False)

    return say


@pytest.mark.slow
@pytest.mark.parametrize(("what", "how", "words"), BREAKS)
def test_check_names_it_at_its_node_and_tells_all_else(
    robot: Robot, tmp_path: Path, answer: Any, what: str, how: Callable[[], Any], words: str
) -> None:
    answer(what, how)
    (tmp_path / "3_x.yaml").write_text(HEAD.format(3, "x", "Frail") + "    - Frail\n")
    (tmp_path / "4_y.yaml").write_text(HEAD.format(4, "y", "Sukseed"))
    first, second, other = check(robot, tmp_path).mistakes
    assert [m.place.line for m in (first, second)] == [6, 7]
    assert words in first.message
    assert "no skill Sukseed" in other.message


@pytest.mark.parametrize("what", ["__init__", "min_duration"])
@pytest.mark.parametrize("command", ["show", "plan"])
def test_commands_refuse_the_file(tmp_path: Path, answer: Any, what: str, command: str) -> None:
    answer(what, boom)
    (tmp_path / "3_x.yaml").write_text(HEAD.format(3, "x", "Frail"))
    result = CliRunner().invoke(cli, [command, "3", "--trees", str(tmp_path)])
    assert type(result.exception).__name__ == "FileError"
    assert RAISED.format(what) in str(result.exception)


def test_plan_refuses_poses_that_break(tmp_path: Path, answer: Any) -> None:
    answer("poses", boom)
    (tmp_path / "3_x.yaml").write_text(HEAD.format(3, "x", "Frail"))
    result = CliRunner().invoke(cli, ["plan", "3", "--trees", str(tmp_path)])
    assert RAISED.format("poses") in str(result.exception)


class Farsighted(Skill):
    """Refuses far positions, always with the same exception object."""

    INPUT_PORTS = {"joints": PortInformation(Positions, description="targets [rad]")}
    far = BadTarget("too far").at("joints", "joint_1")

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        if inputs.get("joints", {}).get("joint_1", 0.0) > 2.0:
            raise cls.far

    def on_start(self) -> Status:
        return Status.SUCCESS


def test_an_error_that_is_raised_again_suggests_a_unit_once(robot: Robot, tmp_path: Path) -> None:
    file = tmp_path / "7_near.yaml"
    file.write_text(HEAD.format(7, "near", "Farsighted: {joints: {joint_1: 70}}"))
    for _ in range(2):
        (mistake,) = check(robot, None, [file]).mistakes
        assert (
            mistake.message
            == "Farsighted: too far; 70 without a unit is 70 rad; did you mean 70 deg?"
        )
        assert mistake.instead
        assert mistake.instead.text.strip() == "- Farsighted: {joints: {joint_1: 70 deg}}"
