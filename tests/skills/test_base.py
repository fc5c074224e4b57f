"""The contract of every skill: started once, ticked until it ends, halted only while it runs."""

from collections.abc import Mapping
from typing import Any, cast

import pytest
from py_trees.common import Status

from hardware import NotActive, Robot
from skills import Skill, SkillBroken, SkillError
from skills.motion import PlanTimeout
from tests.conftest import Bench

S, F, R, INVALID = Status.SUCCESS, Status.FAILURE, Status.RUNNING, Status.INVALID


class Noted(Skill, register=False):
    """Returns scripted answers, and notes the calls."""

    INPUT_PORTS = {}
    OUTPUT_PORTS = {}

    def script(self, *answers: Status | BaseException) -> "Noted":
        self.answers = list(answers)
        self.done: list[str] = []
        return self

    def on_start(self) -> Status:
        return self._answer("start")

    def on_running(self) -> Status:
        return self._answer("running")

    def on_halt(self) -> None:
        self.done.append("halt")

    def _answer(self, what: str) -> Status:
        self.done.append(what)
        answer = self.answers.pop(0)
        if isinstance(answer, BaseException):
            raise answer
        return answer


class Hopeless(Noted, register=False):
    """Raises an exception when it is halted."""

    def on_halt(self) -> None:
        raise SystemExit(3)


def tick(skill: Skill, times: int = 1) -> Status:
    for _ in range(times):
        skill.tick_once()
    return skill.status


@pytest.mark.parametrize("end", [S, F])
def test_started_once_then_looked_at(bench: Bench, end: Status) -> None:
    skill = bench.skill(Noted).script(R, R, end)
    assert tick(skill, 3) is end
    assert skill.done == ["start", "running", "running"]


def test_halted_once_while_it_runs(bench: Bench) -> None:
    skill = bench.skill(Noted).script(R, R)
    tick(skill, 2)
    skill.stop(INVALID)
    skill.stop(INVALID)
    assert skill.done == ["start", "running", "halt"]


@pytest.mark.parametrize("end", [S, F, SkillError("x")])
def test_not_halted_when_it_has_ended(bench: Bench, end: Status | Exception) -> None:
    """py_trees calls terminate again for leaves that have ended."""
    skill = bench.skill(Noted).script(R, end)
    tick(skill, 2)
    skill.stop(INVALID)
    assert skill.done == ["start", "running"]


def test_not_halted_when_it_never_ran(bench: Bench) -> None:
    skill = bench.skill(Noted).script()
    skill.stop(INVALID)
    assert skill.done == []


@pytest.mark.parametrize("error", [SkillError("x"), PlanTimeout(5.0), NotActive("y")])
def test_an_error_of_ours_is_a_failure_with_a_cause(bench: Bench, error: Exception) -> None:
    for answers in ((error,), (R, error)):
        skill = bench.skill(Noted).script(*answers)
        assert tick(skill, len(answers)) is F
        assert skill.failure is error
        assert skill.feedback_message == str(error)


@pytest.mark.parametrize("raised", [ZeroDivisionError("zero"), SystemExit(3)])
def test_whatever_its_code_raises_is_a_failure_that_names_it(
    bench: Bench, raised: BaseException, caplog: pytest.LogCaptureFixture
) -> None:
    name = type(raised).__name__
    skill = bench.skill(Noted).script(raised)
    assert tick(skill) is F
    assert isinstance(skill.failure, SkillBroken)
    assert str(skill.failure) == f"Noted.on_start raised {name}: {raised}"
    skill = bench.skill(Noted).script(R, raised)
    assert tick(skill, 2) is F
    assert skill.done == ["start", "running", "halt"]
    assert f"Noted.on_running raised {name}: {raised}" in caplog.text


def test_what_cannot_halt_stops_the_arm(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    skill = bench.skill(Hopeless).script(R)
    stopped: list[bool] = []
    bench.arm.stop = lambda: stopped.append(True)  # type: ignore[method-assign]
    tick(skill)
    skill.stop(INVALID)
    assert stopped == [True]
    assert "Hopeless.on_halt raised SystemExit: 3" in caplog.text


def test_again_after_the_end_and_after_a_halt(bench: Bench) -> None:
    skill = bench.skill(Noted).script(S, R, R, S)
    tick(skill, 2)
    skill.stop(INVALID)
    assert tick(skill, 2) is S
    assert skill.done == ["start", "start", "halt", "start", "running"]


def test_what_a_skill_is_not_asked_to_do(bench: Bench) -> None:
    skill = bench.skill(Noted)
    Skill.validate(bench.robot, {})
    assert (skill.busy, skill.progress, skill.failure) == (False, None, None)
    with pytest.raises(NotImplementedError):
        Skill.on_start(skill)
    assert Skill.on_running(skill) is R


class _Validated(Skill, register=False):
    """Rejects all inputs."""

    @classmethod
    def validate(cls, robot: Robot, inputs: Mapping[str, Any]) -> None:
        raise SkillError("base")

    def on_start(self) -> Status:
        return S


def test_a_skill_with_the_old_names_works_for_one_release_with_a_warning(bench: Bench) -> None:
    members = {
        "judge": classmethod(lambda cls, robot, inputs: super(old, cls).judge(robot, inputs)),
        "judges_parts": True,
        "__module__": __name__,
    }
    with pytest.warns(DeprecationWarning, match="deprecated") as warned:
        old = cast("type[_Validated]", type("Old", (_Validated,), members, register=False))
    assert [str(each.message) for each in warned] == [
        f"{__file__}: Old.judge is deprecated; rename it to validate",
        f"{__file__}: Old.judges_parts is deprecated; rename it to validates_partial",
    ]
    assert old.validates_partial
    with pytest.raises(SkillError, match="base"):
        old.validate(bench.robot, {})
    assert not _Validated.validates_partial
