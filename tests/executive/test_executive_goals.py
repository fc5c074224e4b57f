"""The executive of a server: second goals, cancels from every side, and recordings."""

import gc
import logging
import shutil
import weakref
from pathlib import Path
from typing import Any

import pytest
from py_trees.behaviour import Behaviour

import logs
from executive.api import Policy
from executive.api.outcome import Acceptance, GoalState, GoalStatus
from executive.cli.support.log_handler import LogHandler
from executive.cli.support.run_server import prepare
from executive.errors import GoalUnderWay, ResultTimeout, SentBeforeStop, UnknownGoal
from executive.goals import executor
from executive.replay.verification import verify
from hardware import NotActive, State, TransitionRefused
from hardware.errors import PortMissing
from skills.leaves.plan_group import PlanGripper
from tests.conftest import RigMaker
from tests.support.paths import EXAMPLES
from tests.support.servers.server_acts import at_frame, history, run
from trees.build import Tree, build

# Goals and the arm


def test_goals_by_id_and_their_history(server: RigMaker) -> None:
    arm = server()
    sent = arm.executive.send(1, identity="ab" * 16)
    assert (sent.identity, sent.accepted, sent.code) == ("ab" * 16, True, "ok")
    outcome = arm.executive.result(sent.identity, 100.0)
    assert outcome.success
    assert history(arm, sent.identity) == ["ACCEPTED", "EXECUTING", "SUCCEEDED"]
    assert arm.executive.goals() == (
        GoalStatus(sent.identity, 1, GoalState.SUCCEEDED, sent.stamp_ns, outcome),
    )
    assert arm.executive.send(2, identity=sent.identity).code == "goal.duplicate"


def test_an_arm_that_is_not_active_does_nothing(server: RigMaker) -> None:
    arm = server(active=False)
    outcome = run(arm, 1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.not_active")
    assert outcome.cause
    assert outcome.message == "the arm is unconfigured; configure and activate it first"
    assert "then `armtree arm activate`" in outcome.cause.hint
    assert arm.opened == 0


def test_a_goal_on_a_full_disk_does_nothing(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A recording may have been possible when the arm was activated."""
    arm = server()
    usage = shutil.disk_usage("/")._replace(free=900_000)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    for _ in range(2):
        outcome = run(arm, 1)
        assert (outcome.state, outcome.code) == (GoalState.ABORTED, "log.no_space")
        assert outcome.recording == ""
    assert arm.frames == []


def test_an_accepted_goal_that_does_not_run_yet_refuses_a_dry_run(rig: RigMaker) -> None:
    arm = rig(single_user=False).executive  # its executor is not started
    assert arm.send(1).accepted
    with pytest.raises(GoalUnderWay):
        arm.dry_run(1, {})


def test_parameters_as_texts(server: RigMaker) -> None:

    arm = server(tasks=EXAMPLES)
    sent = arm.executive.send(3, {"swing": "5 deg", "times": "1"})
    assert arm.executive.result(sent.identity).success
    assert "b095" in {frame[:4] for frame in arm.frames}
    wrong = arm.executive.send(3, {"swing": "["})
    assert arm.executive.result(wrong.identity).code == "goal.bad_arguments"


def test_a_person_activates_and_deactivates_the_arm(server: RigMaker) -> None:
    arm = server(active=False).executive
    assert arm.arm_to("configure") is State.INACTIVE
    assert arm.status().commanded is None
    assert arm.arm_to("activate") is State.ACTIVE
    assert arm.status().commanded == dict.fromkeys(("joint_1", "joint_2", "joint_3"), 0.0) | {
        "joint_4": 0.0
    }
    with pytest.raises(TransitionRefused, match="legal: deactivate, shutdown"):
        arm.arm_to("configure")
    with pytest.raises(TransitionRefused, match="no transition fly"):
        arm.arm_to("fly")
    assert arm.arm_to("deactivate") is State.INACTIVE
    assert arm.arm_to("cleanup") is State.UNCONFIGURED
    assert arm.arm_to("shutdown") is State.FINALIZED
    assert arm.arm_to("shutdown") is State.FINALIZED
    with pytest.raises(TransitionRefused, match="while finalized; start armtree again"):
        arm.arm_to("activate")


def test_a_stop_while_an_activation_waits_for_the_disk_ends_it(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = server(active=False)
    arm.executive.arm_to("configure")
    with monkeypatch.context() as patch:
        patch.setattr(arm.executive._recordings, "wait", arm.executive.cancel)
        with pytest.raises(SentBeforeStop):
            arm.executive.arm_to("activate")
    assert (arm.executive.status().arm, arm.opened) == (State.INACTIVE, 0)
    assert arm.executive.arm_to("activate") is State.ACTIVE


def test_a_stop_ends_the_wait_for_the_boot(server: RigMaker) -> None:
    arm = server(active=False)
    arm.executive.arm_to("configure")

    def stop() -> None:
        arm.rest(0.5)
        arm.executive.cancel()

    arm.soon(stop)
    begun = arm.clock.now()
    with pytest.raises(TransitionRefused, match="stopped while its board booted"):
        arm.executive.arm_to("activate")
    assert arm.clock.now() - begun == pytest.approx(0.5)


def test_a_goal_does_not_activate_the_arm_after_a_fault(server: RigMaker) -> None:
    arm = server()
    at_frame(arm, 10, arm.link.unplug)
    assert run(arm, 1).code == "hw.port_lost"
    arm.rest(0.1)  # the goal ends before the fault is processed
    for _ in range(3):
        refused = run(arm, 1)
        assert refused.code == "hw.not_active"
        words = "the arm is unconfigured; configure and activate it first; it failed: "
        assert refused.message.startswith(words)
        assert "the port board is gone" in refused.message
    assert arm.opened == 1
    for transition in ("configure", "activate", "deactivate"):
        arm.executive.arm_to(transition)
    assert run(arm, 1).message == "the arm is inactive; activate it first"


def test_a_fault_ends_only_the_running_goal(server: RigMaker, tmp_path: Path) -> None:
    (tmp_path / "10_wait.yaml").write_text(
        "task: 10\nname: wait\ndescription: x\ntree: {Wait: {duration: 60 s}}\n"
    )
    arm = server(tasks=tmp_path)
    second: list[str] = []

    class Telling(logging.Handler):
        """The arm still reports the fault when its goal has ended and another one comes."""

        def emit(self, _: logging.LogRecord) -> None:
            arm.executive.result(first)
            second.append(arm.executive.send(10).identity)
            arm.rest(1.0)

    telling, log = Telling(logging.ERROR), logging.getLogger("hardware.arm.arm")
    log.addHandler(telling)
    try:
        at_frame(arm, 10, arm.link.unplug)
        first = arm.executive.send(1).identity
        assert arm.executive.result(first).code == "hw.port_lost"
        arm.rest(2.0)
    finally:
        log.removeHandler(telling)
    outcome = arm.executive.result(second[0])
    assert (outcome.code, outcome.duration) == ("hw.not_active", 0.0)
    assert outcome.message.startswith("the arm is failing; configure and activate it first")


def test_the_log_contains_a_cancel_before_the_end(
    server: RigMaker, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    arm = server()
    at_frame(arm, 10, arm.executive.cancel)
    assert run(arm, 1).state is GoalState.CANCELED
    said = [record.message for record in caplog.records if "goal for task 1" in record.message]
    words = ("Received a goal", "Executing the goal", "Received a cancel", "The goal")
    assert [line.startswith(word) for line, word in zip(said, words, strict=True)] == [True] * 4


def test_a_port_that_is_missing_is_logged_once(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    arm = server(active=False, activate=True)

    def missing() -> None:
        raise PortMissing("board", [])

    monkeypatch.setattr(arm.link, "open", missing)
    prepare(arm.executive, stops=0)
    assert arm.executive.status().arm is State.INACTIVE
    assert len([each for each in caplog.records if each.levelno >= logging.ERROR]) == 1


def test_a_stop_while_a_server_starts_leaves_the_arm_inactive(server: RigMaker) -> None:
    """As Ctrl-C does."""
    arm = server(active=False, activate=True)
    arm.executive.cancel()
    prepare(arm.executive, stops=0)
    assert (arm.executive.status().arm, arm.opened) == (State.INACTIVE, 0)


def test_loaded_objects_are_excluded_from_garbage_collection(server: RigMaker) -> None:
    gc.unfreeze()
    prepare(server(active=False, activate=True).executive, stops=0)
    assert gc.get_freeze_count() > 0
    gc.unfreeze()


def test_the_status(server: RigMaker) -> None:
    arm = server(policy=Policy.QUEUE)
    seen = []
    at_frame(arm, 20, lambda: seen.append(arm.executive.status()))
    first, second = (arm.executive.send(n).identity for n in (1, 2))
    arm.executive.result(second)
    (snapshot,) = seen
    assert snapshot.goal
    assert (snapshot.goal.identity, snapshot.goal.state) == (first, GoalState.EXECUTING)
    assert 0 < (snapshot.percentage or 0) < 100
    assert (snapshot.phase, snapshot.node, snapshot.attempt) == ("executing", "Execute", 1)
    assert snapshot.waiting == (second,)
    assert (snapshot.arm, snapshot.port, snapshot.paused) == (State.ACTIVE, "board", False)
    assert snapshot.commanded
    assert snapshot.commanded["joint_1"] < 0.0
    after = arm.executive.status()
    assert (after.goal, after.percentage, after.phase, after.waiting) == (None, None, "", ())
    assert after.uptime > 2.0


def test_a_subscriber_that_fails_or_leaves(server: RigMaker) -> None:
    arm = server()
    reported: list[object] = []
    failed: list[object] = []

    def fail(event: object) -> None:
        failed.append(event)
        raise ZeroDivisionError

    handler = LogHandler(arm.executive)  # its log is an event as well
    logging.getLogger().addHandler(handler)
    arm.executive.subscribe(fail)
    leave = arm.executive.subscribe(reported.append)
    assert run(arm, 1).success
    logging.getLogger().removeHandler(handler)
    assert len(failed) == 1
    assert any(isinstance(event, GoalStatus) for event in reported)
    assert any(isinstance(event, logs.Sent) for event in reported)
    leave()
    leave()
    count = len(reported)
    assert run(arm, 0).success
    assert len(reported) == count


# Second goals


def test_reject(server: RigMaker) -> None:
    arm = server()
    answers = []
    at_frame(arm, 5, lambda: answers.append(arm.executive.send(2)))
    assert run(arm, 1).success
    assert [answer.code for answer in answers] == ["goal.busy"]
    assert run(arm, 2).success


def test_queue(server: RigMaker) -> None:
    arm = server(policy=Policy.QUEUE)
    sent = [arm.executive.send(task).identity for task in (1, 2, 0)]
    assert all(arm.executive.result(goal).success for goal in sent)
    order = [record.task for record in arm.recorded(logs.Goal)]
    assert order == [1, 2, 0]


@pytest.mark.parametrize("number", [1, 8, 20, 30])
def test_preempt(server: RigMaker, number: int) -> None:
    arm = server(policy=Policy.PREEMPT)
    at_frame(arm, number, lambda: arm.executive.send(2))
    first = arm.executive.send(1).identity
    outcome = arm.executive.result(first)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "goal.preempted")
    assert history(arm, first) == ["ACCEPTED", "EXECUTING", "ABORTED"]
    second = arm.executive.goals()[-1].identity
    assert arm.executive.result(second).success
    held = [i for i, frame in enumerate(arm.frames) if frame.startswith("(")]
    assert held == [number]  # the arm stopped before the second motion
    plan = next(p for p in arm.recorded(logs.Plan)[2:] if p.group == "arm")
    stood = arm.recorded(logs.Sent)[number]
    assert plan.start == dict(zip(stood.joints, stood.positions, strict=True))
    arm.executive.close()
    assert verify(Path(arm.executive.result(second).recording)).holds


def test_a_preempted_goal_is_kept_without_its_tree(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    roots = list[weakref.ref[Behaviour]]()

    def noted(*arguments: Any, **options: Any) -> Tree:
        tree = build(*arguments, **options)
        roots.append(weakref.ref(tree.root))
        return tree

    monkeypatch.setattr(executor, "build", noted)
    arm = server(policy=Policy.PREEMPT)
    at_frame(arm, 5, lambda: arm.executive.send(2))
    first = arm.executive.send(1).identity
    assert arm.executive.result(first).code == "goal.preempted"
    assert arm.executive.result(arm.executive.goals()[-1].identity).success
    arm.executive.close()
    gc.collect()
    assert arm.executive.result(first).code == "goal.preempted"  # it is still kept
    assert [root() for root in roots if root()] == []


def test_preempt_while_planning(server: RigMaker) -> None:
    arm = server(policy=Policy.PREEMPT)

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.NodeStatus) and record.name == "PlanArm":
            arm.on_record = lambda _: None
            arm.executive.send(2)

    arm.on_record = watch
    assert run(arm, 1).code == "goal.preempted"
    last = arm.executive.goals()[-1]
    assert arm.executive.result(last.identity).success


def test_an_invalid_goal_preempts_nothing(server: RigMaker) -> None:
    arm = server(policy=Policy.PREEMPT)
    answers: list[Acceptance] = []

    def act() -> None:
        answers.append(arm.executive.send(99, identity="ab" * 16))
        answers.append(arm.executive.send(2, {"nonsense": "3"}))

    at_frame(arm, 10, act)
    assert run(arm, 1).success
    assert [(each.accepted, each.code) for each in answers] == [
        (False, "goal.unknown_task"),
        (False, "goal.bad_arguments"),
    ]
    assert answers[0].identity == "ab" * 16


@pytest.mark.parametrize("policy", [Policy.REJECT, Policy.QUEUE])
def test_an_invalid_goal_is_not_refused_as_busy(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch, policy: Policy
) -> None:
    arm = server(policy=policy)
    asked: list[tuple[int, dict[str, str]]] = [(99, {}), (2, {"nonsense": "3"}), (2, {})]
    reported: list[str] = []

    def act() -> None:
        monkeypatch.setattr("executive.goals.queue.WAITING", 0)
        reported.extend(arm.executive.send(*each, strict=True).code for each in asked)

    at_frame(arm, 10, act)
    assert run(arm, 1).success
    last = "goal.busy" if policy is Policy.REJECT else "goal.queue_full"
    assert reported == ["goal.unknown_task", "goal.bad_arguments", last]


# Results and recordings


def test_unknown_goals_and_timeouts(server: RigMaker) -> None:
    arm = server(result_timeout=5.0)
    sent = arm.executive.send(1).identity
    with pytest.raises(ResultTimeout):
        arm.executive.result(sent, 0.01)
    assert arm.executive.result(sent).success
    arm.rest(6.0)
    with pytest.raises(UnknownGoal):
        arm.executive.result(sent)


def test_closing_cancels_running_and_waiting_goals(server: RigMaker, tmp_path: Path) -> None:
    arm = server(policy=Policy.QUEUE)
    sent = [arm.executive.send(task).identity for task in (1, 2)]
    arm.rest(1.0)
    arm.executive.close()
    states = [arm.executive.result(goal).state.name for goal in sent]
    assert states == ["CANCELED", "CANCELED"]
    assert arm.executive.send(1).code == "server.closing"
    assert arm.frames[-1] == f"({arm.frames[-2]})"
    assert arm.executive.status().arm is State.FINALIZED
    assert all(logs.Recording(path).complete for path in tmp_path.glob("*.mcap"))


def test_events_between_goals_are_recorded(server: RigMaker, tmp_path: Path) -> None:
    arm = server()
    for task in (1, 7):
        arm.executive.record(logs.LogLine(arm.clock.now(), 20, "network", f"a client sends {task}"))
        run(arm, task)
        arm.rest(0.1)
    arm.executive.arm_to("deactivate")
    arm.executive.close()
    (between,) = tmp_path.glob("*-server.mcap")
    records = list(logs.Recording(between).records(logs.Transition, logs.LogLine, logs.Goal))
    said = [line.message for line in records if isinstance(line, logs.LogLine)]
    assert said == ["a client sends 1", "a client sends 7"]
    states = [record.goal for record in records if isinstance(record, logs.Transition)]
    assert states.pop(0) == "unconfigured"
    assert states[:4] == ["configuring", "inactive", "activating", "active"]
    assert states[-4:] == ["deactivating", "inactive", "shuttingdown", "finalized"]
    assert [record.task for record in records if isinstance(record, logs.Goal)] == [1, 7]
    goals = [logs.Recording(path) for path in sorted(tmp_path.glob("*Z-[0-9].mcap"))]
    ends = [[r.code for r in file.records(logs.Result)] for file in goals]  # type: ignore[union-attr]
    assert sorted(ends) == [["goal.unknown_task"], ["ok"]]
    for file in goals:
        (standing,) = file.records(logs.Transition)
        assert isinstance(standing, logs.Transition)
        assert (standing.label, standing.start, standing.goal) == ("", "active", "active")


def test_the_cause_is_in_the_recording(server: RigMaker, tmp_path: Path) -> None:
    folder = tmp_path / "tasks"
    folder.mkdir()
    (folder / "10_out.yaml").write_text(
        "task: 10\nname: out\ndescription: x\ntree:\n  subtree: reach\n  with:\n"
        "    arm: {joint_1: 2.0, joint_2: 0, joint_3: 0}\n    gripper: {joint_4: 0}\n"
    )
    arm = server(tasks=folder)
    outcome = run(arm, 10)
    assert outcome.cause
    cause = outcome.cause
    assert (cause.code, cause.joint, cause.value) == ("goal.out_of_bounds", "joint_1", 2.0)
    assert cause.node == "out/CheckBounds"
    arm.executive.close()
    (result,) = logs.Recording(Path(outcome.recording)).records(logs.Result)
    assert isinstance(result, logs.Result)
    assert (result.joint, result.value, result.limit) == ("joint_1", 2.0, cause.limit)
    assert result.hint == cause.hint


def test_a_bug_ends_one_goal_only(server: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = server()

    def on_start(_: object) -> object:
        raise ZeroDivisionError("a bug")

    with monkeypatch.context() as patch:
        patch.setattr(PlanGripper, "on_start", on_start)
        assert run(arm, 1).code == "skill.broken"
    assert run(arm, 1).success


def test_the_commanded_position_is_known_only_while_active(server: RigMaker) -> None:
    arm = server(active=False)
    with pytest.raises(NotActive):
        _ = arm.executive._arm.commanded
    assert arm.executive.status().commanded is None
