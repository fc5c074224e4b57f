"""Runs that are stopped: by a person at any moment, by a fault, by a bug."""

import dataclasses
import gc
import logging
import os
import threading
import weakref
from collections.abc import Callable
from pathlib import Path

import pytest

import logs
from executive.api.outcome import GoalState
from hardware import Robot, SimulatedClock, State
from skills import Skill
from skills.leaves.execute import Execute
from skills.leaves.plan_group import PlanGripper
from skills.motion import Pool
from tests.conftest import Rig, RigMaker
from tests.support.arms.hardware_rigs import left, threads


def percentages(rig: Rig) -> list[int | None]:
    return [feedback.percentage for feedback in rig.recorded(logs.Feedback)]


def busy(rig: Rig) -> list[str]:
    """Paths of nodes that were reported as running and never as ended."""
    last = {node.path: node.status for node in rig.recorded(logs.NodeStatus)}
    return [path for path, status in last.items() if status == "RUNNING"]


def at(rig: Rig, name: str, act: Callable[[], None], status: str = "RUNNING") -> None:
    """Do something, on another thread, when a node of that name has that status.

    The run goes on when it is done, because a run needs no time until it moves.
    """

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.NodeStatus) and (record.name, record.status) == (name, status):
            rig.soon(act).join()

    rig.on_record = watch


def at_frame(rig: Rig, number: int, act: Callable[[], None]) -> None:
    """Do something, on another thread, when that many frames were sent."""

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(rig.recorded(logs.Sent)) == number:
            rig.soon(act)

    rig.on_record = watch


# Cancel


def check_canceled(arm: Rig, frames: int) -> None:
    outcome = arm.outcomes[-1]
    assert (outcome.state, outcome.code) == (GoalState.CANCELED, "goal.canceled"), outcome
    assert busy(arm) == []
    sent, holds = arm.recorded(logs.Sent), [f for f in arm.frames if f.startswith("(")]
    assert len(sent) == frames + bool(frames)
    assert holds == ([f"({arm.frames[-2]})"] if frames else [])
    assert 100 not in percentages(arm)


def test_cancel_before_the_run(rig: RigMaker) -> None:
    arm = rig()
    arm.cancel()
    arm.run(1)
    check_canceled(arm, 0)
    assert arm.opened == 0


def test_cancel_during_boot(rig: RigMaker) -> None:
    arm = rig()

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Transition) and record.goal == "activating":
            arm.soon(cancel_later)

    def cancel_later() -> None:
        signal = arm.clock.signal()
        with signal:
            signal.wait(arm.clock.now() + 0.5)
        arm.cancel()

    arm.on_record = watch
    arm.run(1)
    check_canceled(arm, 0)
    assert arm.recorded(logs.Result)[0].duration == pytest.approx(0.5)


@pytest.mark.slow
@pytest.mark.parametrize("node", ["PlanArm", "PlanGripper"])
def test_cancel_during_planning(rig: RigMaker, node: str) -> None:
    arm = rig()
    at(arm, node, arm.cancel)
    arm.run(1)
    check_canceled(arm, 0)


@pytest.mark.slow
@pytest.mark.parametrize("node", ["SetStart", "CheckBounds", "PlanArm", "PlanGripper"])
def test_cancel_when_a_node_is_done(rig: RigMaker, node: str) -> None:
    arm = rig()
    at(arm, node, arm.cancel, "SUCCESS")
    arm.run(1)
    check_canceled(arm, 0)


@pytest.mark.slow
def test_cancel_during_the_check_of_the_frames(rig: RigMaker) -> None:
    arm = rig()
    at(arm, "Execute", arm.cancel)
    arm.run(1)
    check_canceled(arm, 0)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(1, 32))
def test_cancel_at_every_frame(rig: RigMaker, number: int) -> None:
    arm = rig()
    at_frame(arm, number, arm.cancel)
    arm.run(1)
    check_canceled(arm, number)


def test_cancel_twice(rig: RigMaker) -> None:
    arm = rig()

    def twice() -> None:
        arm.cancel()
        arm.cancel()
        arm.soon(arm.cancel)

    at_frame(arm, 10, twice)
    arm.run(1)
    check_canceled(arm, 10)


def test_cancel_after_the_end(rig: RigMaker) -> None:
    arm = rig()
    (outcome,) = arm.run(1)
    before = list(arm.records)
    arm.cancel()
    assert outcome.success
    assert arm.records == before


def test_cancel_between_two_tasks(rig: RigMaker) -> None:
    arm = rig()
    arm.outcomes = Canceling(arm)
    arm.run(1, 2)
    assert [outcome.state for outcome in arm.outcomes] == [GoalState.SUCCEEDED, GoalState.CANCELED]
    assert arm.frames[-1] == f"({arm.frames[-2]})"
    assert not arm.frames[-2].startswith("(")


class Canceling(list):  # type: ignore[type-arg]
    """Outcomes; the first one is answered with a cancel."""

    def __init__(self, arm: Rig) -> None:
        super().__init__()
        self._arm = arm

    def append(self, outcome: object) -> None:
        super().append(outcome)
        if len(self) == 1:
            self._arm.cancel()


def test_a_cancel_in_the_middle_of_a_tick(rig: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stop makes Execute fail in that tick, but it is the cancel that counts."""
    arm = rig()
    ticks, tick = [], Execute.on_running

    def on_running(skill: Execute) -> object:
        ticks.append(1)
        if len(ticks) == 20:
            arm.cancel()
        return tick(skill)

    monkeypatch.setattr(Execute, "on_running", on_running)
    arm.run(1)
    assert arm.outcomes[-1].state is GoalState.CANCELED
    assert arm.frames[-1] == f"({arm.frames[-2]})"


# Faults


@pytest.mark.slow
@pytest.mark.parametrize("node", ["PlanArm", "PlanGripper", "Execute"])
def test_unplugged_before_it_moves(rig: RigMaker, node: str) -> None:
    arm = rig()
    at(arm, node, arm.link.unplug)
    (outcome,) = arm.run(1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.port_lost")
    assert arm.frames == []
    check_given_up(arm)


@pytest.mark.parametrize("unplugged", [True, False])
def test_an_executive_that_is_closed_is_collected(
    rig: RigMaker, unplugged: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """A program may open and close many arms."""
    caplog.set_level(logging.CRITICAL)  # a captured fault would hold the arm
    arm = rig()
    if unplugged:
        at_frame(arm, 20, arm.link.unplug)
    arm.run(1)
    with arm.clock.working():
        arm.executive.close()
    gone = weakref.ref(arm.executive)
    del arm
    gc.collect()
    assert gone() is None


def test_a_motion_that_cannot_begin_for_a_fault_ends_with_that_fault(server: RigMaker) -> None:
    arm, failed = server(), threading.Event()

    class Telling(logging.Handler):
        """Delays the report of the arm's failure until the goal has ended."""

        def emit(self, _: logging.LogRecord) -> None:
            failed.set()
            arm.executive.result(arm.statuses[0].identity)

    def fail(record: logs.Record) -> None:
        if isinstance(record, logs.NodeStatus) and record.name == "Execute" and not failed.is_set():
            arm.link.unplug()
            assert failed.wait(5)

    telling, log = Telling(logging.ERROR), logging.getLogger("hardware.arm.arm")
    log.addHandler(telling)
    arm.on_record = fail
    try:
        outcome = arm.executive.result(arm.executive.send(1).identity)
    finally:
        log.removeHandler(telling)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.port_lost")
    assert arm.frames == []


@pytest.mark.parametrize("number", [1, 2, 20, 31])
def test_unplugged_while_it_moves(rig: RigMaker, number: int) -> None:
    arm = rig()
    at_frame(arm, number, arm.link.unplug)
    (outcome,) = arm.run(1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.port_lost")
    assert "port board" in outcome.message
    assert outcome.cause
    assert outcome.cause.node.endswith("/Execute")
    assert len(arm.frames) == number
    check_given_up(arm)


def check_given_up(arm: Rig) -> None:
    assert busy(arm) == []
    goals = [transition.goal for transition in arm.recorded(logs.Transition)]
    assert goals[goals.index("active") + 1 :][:2] == ["errorprocessing", "unconfigured"]
    assert 100 not in percentages(arm)


def test_a_fault_between_two_tasks_is_not_resumed_from(rig: RigMaker) -> None:
    """Coming back from a fault is a person's act."""
    arm = rig()
    lost = threading.Event()

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Transition) and record.goal == "unconfigured":
            lost.set()

    class Unplugging(list):  # type: ignore[type-arg]
        def append(self, outcome: object) -> None:
            super().append(outcome)
            if len(self) == 1:
                arm.link.unplug()
                assert lost.wait(5)

    arm.on_record, arm.outcomes = watch, Unplugging()
    arm.run(1, 2)
    assert [outcome.code for outcome in arm.outcomes] == ["ok", "hw.port_lost"]
    assert arm.opened == 1


def test_a_skill_that_does_not_stop(rig: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = rig()
    monkeypatch.setattr(PlanGripper, "busy", True)
    at_frame(arm, 5, arm.cancel)
    arm.run(1)
    outcome = arm.outcomes[-1]
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.cancel_timeout")
    assert "PlanGripper did not stop within 250 ms" in outcome.message
    check_given_up(arm)


def test_a_bug_in_a_skill_leaves_nothing_running(
    rig: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    def on_start(_: Skill) -> object:
        raise ZeroDivisionError("a bug")

    arm = rig()
    monkeypatch.setattr(PlanGripper, "on_start", on_start)
    (outcome,) = arm.run(1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "skill.broken")
    assert arm.frames == []


def test_no_port(rig: RigMaker) -> None:
    arm = rig()
    arm.executive._arm._link = None
    (outcome,) = arm.run(1)
    assert outcome.code == "hw.no_port"
    assert outcome.message.startswith("No serial port provided")


@pytest.mark.slow
def test_threads_and_descriptors_do_not_grow(rig: RigMaker) -> None:
    rig().run(1)
    before, descriptors = threads(), len(os.listdir("/proc/self/fd"))
    arm = rig()
    arm.run(1, 2, 0)
    assert arm.executive._arm.state is State.FINALIZED
    del arm
    assert not left(before)
    assert len(os.listdir("/proc/self/fd")) <= descriptors


def test_a_brake_adds_its_time_to_the_deadline(
    robot: Robot, shared_clock: SimulatedClock, shared_pool: Pool, tmp_path: Path
) -> None:
    arm = Rig(dataclasses.replace(robot, brake=1.0), shared_clock, shared_pool, tmp_path)
    at_frame(arm, 10, arm.cancel)
    arm.run(1)
    (outcome,) = arm.outcomes
    assert (outcome.state, outcome.code) == (GoalState.CANCELED, "goal.canceled")
    assert len(arm.frames) > 11
    assert arm.frames[-1] == f"({arm.frames[-2]})"
