"""An exception from the code of a skill ends its goal with a cause, and never the server."""

from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

import logs
from executive.api import Policy
from executive.api.outcome import GoalState
from hardware import Clock, RealClock, State
from skills import Skill, skill
from tests.conftest import RigMaker
from tests.support.recordings.finished import finished
from tests.support.servers.server_acts import at_frame, run

_NAMES = (
    *("leaves", "Leaves", "Doubts", "Hangs", "Unsure", "Lost", "Restless", "Unmade", "Timeless"),
    "Ponders",
)


@skill
def leaves() -> None:
    """Exit the process, as a library for programs may do."""
    raise SystemExit(3)


class Leaves(Skill):
    """The same on the thread that ticks."""

    INPUT_PORTS: dict[str, Any] = {}
    OUTPUT_PORTS: dict[str, Any] = {}

    def on_start(self) -> Status:
        raise SystemExit(3)


class Doubts(Skill):
    """Its validation fails."""

    INPUT_PORTS: dict[str, Any] = {}
    OUTPUT_PORTS: dict[str, Any] = {}

    @classmethod
    def validate(cls, *_: object) -> None:
        raise ValueError("no idea")


class Hangs(Skill):
    """Holds the thread that ticks for an hour."""

    INPUT_PORTS: dict[str, Any] = {}
    OUTPUT_PORTS: dict[str, Any] = {}

    def on_start(self) -> Status:
        clock = self.context.clock
        signal, until = clock.signal(), clock.now() + 3600.0
        with signal:
            signal.wait(until)
        return Status.SUCCESS


class Unsure(Skill):
    """Cannot say whether it is busy; names no ports, as it has none."""

    def on_start(self) -> Status:
        return Status.SUCCESS

    @property
    def busy(self) -> bool:
        raise ValueError("no idea")


class Lost(Skill):
    """Cannot say how far it is."""

    def on_start(self) -> Status:
        return Status.RUNNING

    @property
    def progress(self) -> float | None:
        raise ValueError("no idea")


class Restless(Skill):
    """Its pause fails."""

    def on_start(self) -> Status:
        return Status.RUNNING

    def on_pause(self) -> None:
        raise ValueError("no idea")


class Unmade(Skill):
    """Cannot be made."""

    def __init__(self, *_: object) -> None:
        raise ValueError("no idea")

    def on_start(self) -> Status:
        return Status.SUCCESS


class Timeless(Skill):
    """Cannot say how long it takes."""

    def on_start(self) -> Status:
        return Status.SUCCESS

    @classmethod
    def min_duration(cls, *_: object) -> float:
        raise ValueError("no idea")


class Ponders(Skill):
    """Its validation takes an hour."""

    clock: Clock = RealClock()

    def on_start(self) -> Status:
        return Status.SUCCESS

    @classmethod
    def validate(cls, *_: object) -> None:
        signal, until = cls.clock.signal(), cls.clock.now() + 3600.0
        with signal:
            signal.wait(until)


@pytest.fixture
def tasks(tmp_path: Path) -> Path:
    folder = tmp_path / "tasks"
    folder.mkdir()
    for number, name in enumerate(_NAMES, 40):
        tree = f"  sequence:\n    - {name}\n    - Succeed\n"
        head = f"task: {number}\nname: t{number}\ndescription: Breaks.\n"
        (folder / f"{number}_t{number}.yaml").write_text(f"{head}tree:\n{tree}")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "code", "node", "words"),
    [
        (40, "task.function", "t40/leaves", "leaves: SystemExit: 3"),
        (41, "skill.broken", "t41/Leaves", "Leaves.on_start raised SystemExit: 3"),
        (42, "skill.broken", "t42/Doubts", "Doubts.validate raised ValueError: no idea"),
        (44, "skill.broken", "t44/Unsure", "Unsure.busy raised ValueError: no idea"),
        (45, "skill.broken", "t45/Lost", "Lost.progress raised ValueError: no idea"),
        (47, "skill.broken", "t47/Unmade", "Unmade.__init__ raised ValueError: no idea"),
        (48, "skill.broken", "t48/Timeless", "Timeless.min_duration raised ValueError: no idea"),
    ],
)
def test_the_goal_ends_with_its_cause_and_the_next_one_is_done(
    server: RigMaker, tasks: Path, task: int, code: str, node: str, words: str
) -> None:
    arm = server(tasks=tasks)
    outcome = run(arm, task)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, code)
    assert outcome.cause
    assert outcome.cause.node == node
    assert words in outcome.message
    assert run(arm, 1).success


def test_an_exception_in_a_pause_ends_the_goal(server: RigMaker, tasks: Path) -> None:
    arm = server(tasks=tasks)
    goal = arm.executive.send(46).identity
    arm.rest(1.0)
    arm.executive.pause(goal)
    outcome = arm.executive.result(goal, 60.0)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "skill.broken")
    assert outcome.cause
    assert outcome.cause.node == "t46/Restless"
    assert run(arm, 1).success


def test_a_goal_whose_validation_fails_preempts_nothing(server: RigMaker, tasks: Path) -> None:
    arm = server(tasks=tasks, policy=Policy.PREEMPT)
    refused = []
    at_frame(arm, 10, lambda: refused.append(arm.executive.send(42)))
    assert run(arm, 1).success
    assert [each.code for each in refused] == ["skill.broken"]
    assert not any(frame.hold for frame in arm.recorded(logs.Sent))


def test_a_cancel_ends_a_goal_whose_skill_does_not_return(server: RigMaker, tasks: Path) -> None:
    arm = server(tasks=tasks)
    goal = arm.executive.send(43).identity
    arm.rest(1.0)
    arm.executive.cancel(goal)
    begun = arm.clock.now()
    outcome = arm.executive.result(goal, 60.0)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.cancel_timeout")
    assert arm.clock.now() - begun == pytest.approx(0.25)
    assert outcome.cause
    assert outcome.cause.node == "t43/Hangs"
    assert "the code of t43/Hangs does not return" in outcome.message
    assert arm.executive.status().arm is State.UNCONFIGURED
    refused = arm.executive.send(1)
    assert (refused.code, arm.executive.goals()[-1].identity) == ("server.held", goal)
    words = f"goal {goal} for task 43 blocks all other goals, because the code of t43/Hangs"
    assert refused.message.startswith(words)
    arm.rest(3600.0)
    finished(Path(outcome.recording).parent)  # by threads in real time
    (result,) = logs.Recording(Path(outcome.recording)).records(logs.Result)
    assert isinstance(result, logs.Result)
    assert result.state == "ABORTED"
    arm.executive.arm_to("configure")
    arm.executive.arm_to("activate")
    assert run(arm, 1).success


@pytest.mark.parametrize("policy", [Policy.QUEUE, Policy.PREEMPT])
def test_goals_behind_a_skill_that_does_not_return_are_aborted(
    server: RigMaker, tasks: Path, policy: Policy
) -> None:
    arm = server(tasks=tasks, policy=policy)
    first = arm.executive.send(43).identity
    arm.rest(1.0)
    waiting = arm.executive.send(1).identity
    arm.executive.cancel(first)
    outcome = arm.executive.result(waiting, 60.0)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "server.held")
    assert arm.executive.result(first).code == "hw.cancel_timeout"
    assert [arm.executive.send(1).code for _ in range(2)] == ["server.held"] * 2
    arm.rest(3600.0)


def test_a_server_ends_though_something_never_returns(server: RigMaker, tasks: Path) -> None:
    arm = server(tasks=tasks)
    goal = arm.executive.send(43).identity
    arm.rest(1.0)
    begun = arm.clock.now()
    arm.executive.close()
    assert arm.clock.now() - begun < 60.0
    assert arm.executive.result(goal).code == "hw.cancel_timeout"
    arm.rest(3600.0)


def test_a_cancel_ends_a_goal_whose_validation_does_not_return(
    server: RigMaker, tasks: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = server(tasks=tasks)
    monkeypatch.setattr(Ponders, "clock", arm.clock)
    goal = arm.executive.send(49).identity
    arm.rest(1.0)
    arm.executive.cancel(goal)
    outcome = arm.executive.result(goal, 60.0)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "server.held")
    assert "does not return" in outcome.message
    assert arm.executive.send(1).code == "server.held"
    assert arm.executive.status().arm is State.ACTIVE
    arm.rest(7200.0)
    assert run(arm, 1).success


@pytest.mark.parametrize("policy", Policy)
def test_wrong_requests_are_refused_and_broken_skills_are_not(
    server: RigMaker, tasks: Path, policy: Policy
) -> None:
    arm = server(tasks=tasks, policy=policy)
    asked: list[tuple[int, dict[str, str]]] = [(99, {}), (2, {"nonsense": "3"}), (42, {})]
    answers = [arm.executive.send_and_record(*each, "") for each in asked]
    codes = ["goal.unknown_task", "goal.bad_arguments"]
    last = "skill.broken" if policy is Policy.PREEMPT else "ok"
    assert [answer.code for answer in answers] == [*codes, last]
    assert [answer.cause is None for answer in answers] == [False, False, last == "ok"]
