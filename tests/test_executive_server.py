"""One executive for many: what becomes of second goals, cancels from everywhere, the recordings."""

import random
from functools import partial
from pathlib import Path

import pytest

import logs
from executive.errors import ResultTimeout, UnknownGoal
from executive.goal import GoalState, GoalStatus, Outcome
from executive.goals import CancelCode, Policy
from executive.replay.proof import prove
from hardware import NotActive, State, TransitionRefused
from skills import PlanGripper, Skill
from tests.conftest import Rig, RigMaker


def at_frame(rig: Rig, number: int, act: object) -> None:
    """Do something, on another thread, when that many frames were sent."""

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(rig.told(logs.Sent)) == number:
            rig.on_record = lambda _: None
            rig.soon(act)  # type: ignore[arg-type]

    rig.on_record = watch


def history(rig: Rig, identity: str) -> list[str]:
    return [status.state.name for status in rig.statuses if status.identity == identity]


def run(rig: Rig, task: int) -> Outcome:
    return rig.executive.result(rig.executive.send(task).identity)


# The plain way


def test_goals_by_name_and_their_history(server: RigMaker) -> None:
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
    assert outcome.cause.hint == "configure and activate it"
    assert arm.opened == 0


def test_parameters_as_texts(server: RigMaker) -> None:
    import trees

    arm = server(tasks=Path(trees.__file__).parent / "examples")
    sent = arm.executive.send(3, {"swing": "5 deg", "times": "1"})
    assert arm.executive.result(sent.identity).success
    assert "b095" in {frame[:4] for frame in arm.frames}
    wrong = arm.executive.send(3, {"swing": "["})
    assert arm.executive.result(wrong.identity).code == "file.task"


def test_an_arm_of_which_a_person_takes_care(server: RigMaker) -> None:
    arm = server(active=False).executive
    assert arm.arm_to("configure") is State.INACTIVE
    assert arm.snapshot().commanded is None
    assert arm.arm_to("activate") is State.ACTIVE
    assert arm.snapshot().commanded == dict.fromkeys(("joint_1", "joint_2", "joint_3"), 0.0) | {
        "joint_4": 0.0
    }
    with pytest.raises(TransitionRefused, match="legal: deactivate, shutdown"):
        arm.arm_to("configure")
    with pytest.raises(TransitionRefused, match="no transition fly"):
        arm.arm_to("fly")
    assert arm.arm_to("deactivate") is State.INACTIVE
    assert arm.arm_to("cleanup") is State.UNCONFIGURED


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


def test_deactivating_stops_a_goal(server: RigMaker) -> None:
    arm = server()
    at_frame(arm, 10, lambda: arm.executive.arm_to("deactivate"))
    outcome = run(arm, 1)
    assert outcome.state is GoalState.ABORTED
    assert outcome.code in ("hw.stopped", "hw.not_active")
    assert arm.frames[-1] == f"({arm.frames[-2]})"
    assert run(arm, 1).code == "hw.not_active"


def test_a_fault_is_not_resumed_from_by_a_goal(server: RigMaker) -> None:
    arm = server()
    at_frame(arm, 10, arm.link.unplug)
    assert run(arm, 1).code == "hw.port_lost"
    assert run(arm, 1).code == "hw.not_active"
    assert arm.opened == 1


def test_how_things_are(server: RigMaker) -> None:
    arm = server(policy=Policy.QUEUE)
    seen = []
    at_frame(arm, 20, lambda: seen.append(arm.executive.snapshot()))
    first, second = (arm.executive.send(n).identity for n in (1, 2))
    arm.executive.result(second)
    (snapshot,) = seen
    assert snapshot.goal
    assert (snapshot.goal.identity, snapshot.goal.state) == (first, GoalState.EXECUTING)
    assert snapshot.progress
    assert 0 < (snapshot.progress.percentage or 0) < 100
    assert snapshot.waiting == (second,)
    assert (snapshot.arm, snapshot.port, snapshot.paused) == (State.ACTIVE, "board", False)
    assert snapshot.commanded
    assert snapshot.commanded["joint_1"] < 0.0
    after = arm.executive.snapshot()
    assert (after.goal, after.progress, after.waiting) == (None, None, ())
    assert after.uptime > 2.0


def test_a_watcher_that_fails_or_leaves(server: RigMaker) -> None:
    arm = server()
    told: list[object] = []

    def fail(_: object) -> None:
        raise ZeroDivisionError

    end = arm.executive.subscribe(fail)
    leave = arm.executive.subscribe(told.append)
    assert run(arm, 1).success
    assert any(isinstance(event, GoalStatus) for event in told)
    assert any(isinstance(event, logs.Sent) for event in told)
    leave()
    end()
    count = len(told)
    assert run(arm, 0).success
    assert len(told) == count


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
    order = [record.task for record in arm.told(logs.Goal)]
    assert order == [1, 2, 0]


@pytest.mark.parametrize("number", [1, 8, 20, 30])
def test_preempt(server: RigMaker, number: int) -> None:
    arm = server(policy=Policy.PREEMPT)
    second = []
    at_frame(arm, number, lambda: second.append(arm.executive.send(2).identity))
    first = arm.executive.send(1).identity
    outcome = arm.executive.result(first)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "goal.preempted")
    assert history(arm, first) == ["ACCEPTED", "EXECUTING", "ABORTED"]
    assert arm.executive.result(second[0]).success
    held = [i for i, frame in enumerate(arm.frames) if frame.startswith("(")]
    assert held == [number]  # the arm stood before the second motion began
    plan = next(p for p in arm.told(logs.Plan)[2:] if p.group == "arm")
    stood = arm.told(logs.Sent)[number]
    assert plan.start == dict(zip(stood.joints, stood.positions, strict=True))
    arm.executive.close()
    assert prove(Path(arm.executive.result(second[0]).recording)).holds


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


# Cancels


def check_ended(arm: Rig, outcome: Outcome, sent_before: int) -> None:
    """No node runs, nothing works on, nothing was sent after the hold."""
    last = {}
    for node in arm.told(logs.NodeStatus):
        last[node.path] = node.status
    assert "RUNNING" not in last.values(), last
    frames = arm.frames[sent_before:]
    holds = [i for i, frame in enumerate(frames) if frame.startswith("(")]
    assert holds in ([], [len(frames) - 1])
    assert outcome.state in (GoalState.CANCELED, GoalState.SUCCEEDED), outcome


KINDS = """\
task: 14
name: kinds
description: A node of every kind around a motion.
parameters:
  swing: {type: angle, default: 0.2, min: -1, max: 1, description: where to}
tree:
  sequence:
    - force_success:
        retry: {sequence: [{Wait: {duration: 0.1 s}}, {Fail: {reason: meant}}]}
        attempts: 2
        backoff: 0.1 s
    - repeat:
        parallel: [{Wait: {duration: 0.3 s}}, {Wait: {duration: 0.1 s}}]
        policy: any
      times: 2
    - guard:
        timeout:
          subtree: reach
          with:
            arm: {joint_1: $swing, joint_2: 0, joint_3: 0}
            gripper: {joint_4: 0}
        after: 60 s
      while: CheckHardware
    - selector: [{Fail: {reason: meant}}, {inverter: {Fail: {reason: meant}}}]
      memory: false
    - Succeed
"""


def test_a_cancel_at_every_node_at_every_tick(
    server: RigMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "tasks"
    folder.mkdir()
    (folder / "14_kinds.yaml").write_text(KINDS)
    arm, ticks = server(tasks=folder), _Ticks(monkeypatch)
    states, names, number = list[GoalState](), set[str](), 0
    while ticks.came:
        arm.records.clear()
        swing = "0.1" if number % 2 else "-0.1"
        goal = arm.executive.send(14, {"swing": swing}).identity
        ticks.cancel_at(number, arm)
        outcome = arm.executive.result(goal)
        check_ended(arm, outcome, 0)
        states.append(outcome.state)
        names |= ticks.names
        number += 1
    assert number > 50
    assert set(states[:-10]) == {GoalState.CANCELED}  # in the last tick it may come too late
    assert names >= {"Wait", "Fail", "CheckHardware", "PlanArm", "PlanGripper", "Execute"}


class _Ticks:
    """Counts ticks of skills, and cancels at one of them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.came, self.names = True, set[str]()
        self._left = 0
        self._arm: Rig | None = None
        update = Skill.update

        def counted(skill: Skill) -> object:
            if self._left == 0 and self._arm:
                self.came = True
                self.names.add(skill.name)
                self._arm.executive.cancel()
            self._left -= 1
            return update(skill)

        monkeypatch.setattr(Skill, "update", counted)

    def cancel_at(self, number: int, arm: Rig) -> None:
        """Cancel at the tick of that number from now on."""
        self._left, self._arm, self.came = number, arm, False


def storm(arm: Rig, seed: int) -> None:
    """Cancel in every way, at random instants."""
    rng = random.Random(seed)
    for _ in range(60):
        known = arm.executive.goals()
        if rng.random() < 0.3 or not known:
            arm.executive.cancel()
        elif rng.random() < 0.5:
            arm.executive.cancel(rng.choice(known).identity)
        else:
            arm.executive.cancel(stamp_ns=rng.choice(known).stamp_ns)
        arm.rest(rng.uniform(0.0, 0.5))


def test_a_storm_of_cancels(server: RigMaker) -> None:
    """Eight threads cancel in every way while goals come: one end per goal, and no deadlock."""
    arm, rng = server(policy=Policy.QUEUE), random.Random(1)
    threads = [arm.clock.spawn(partial(storm, arm, seed), "storm") for seed in range(8)]
    goals = []
    for _ in range(40):
        goals.append(arm.executive.send(rng.choice((0, 1, 2))).identity)
        arm.rest(rng.uniform(0.0, 0.5))
    ends = [arm.executive.result(goal).state for goal in goals]
    while any(thread.is_alive() for thread in threads):
        arm.rest(0.1)
    assert set(ends) <= {GoalState.CANCELED, GoalState.SUCCEEDED}
    assert ends.count(GoalState.CANCELED) > 20
    for goal in goals:
        past = history(arm, goal)
        assert sum(state in ("SUCCEEDED", "CANCELED", "ABORTED") for state in past) == 1
    assert run(arm, 1).success  # and the arm is as good as new


def test_a_cancel_by_name_leaves_the_others(server: RigMaker) -> None:
    arm = server(policy=Policy.QUEUE)
    one, two, three = (arm.executive.send(task).identity for task in (1, 2, 0))
    assert arm.executive.cancel(two).goals == (two,)
    assert arm.executive.cancel(two).code is CancelCode.GOAL_TERMINATED
    assert arm.executive.cancel("f" * 32).code is CancelCode.UNKNOWN_GOAL_ID
    states = [arm.executive.result(goal).state.name for goal in (one, two, three)]
    assert states == ["SUCCEEDED", "CANCELED", "SUCCEEDED"]
    assert not [frame for frame in arm.frames if frame.startswith("(")]


def test_what_does_not_stop_takes_the_arm_down(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = server()
    with monkeypatch.context() as patch:
        patch.setattr(PlanGripper, "busy", True)
        at_frame(arm, 5, arm.executive.cancel)
        outcome = run(arm, 1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.cancel_timeout")
    assert arm.executive.snapshot().arm is State.UNCONFIGURED
    assert run(arm, 1).code == "hw.not_active"
    arm.executive.arm_to("configure")
    arm.executive.arm_to("activate")
    assert run(arm, 1).success


# Results and recordings


def test_who_asks_in_vain(server: RigMaker) -> None:
    arm = server(result_timeout=5.0)
    sent = arm.executive.send(1).identity
    with pytest.raises(ResultTimeout):
        arm.executive.result(sent, 0.01)
    assert arm.executive.result(sent).success
    arm.rest(6.0)
    with pytest.raises(UnknownGoal):
        arm.executive.result(sent)
    told: list[Outcome] = []
    with pytest.raises(UnknownGoal):
        arm.executive.on_result(sent, told.append)


def test_closing_cancels_what_runs_and_what_waits(server: RigMaker, tmp_path: Path) -> None:
    arm = server(policy=Policy.QUEUE)
    sent = [arm.executive.send(task).identity for task in (1, 2)]
    arm.rest(1.0)
    arm.executive.close()
    states = [arm.executive.result(goal).state.name for goal in sent]
    assert states == ["CANCELED", "CANCELED"]
    assert arm.executive.send(1).code == "server.closing"
    assert arm.frames[-1] == f"({arm.frames[-2]})"
    assert arm.executive.snapshot().arm is State.FINALIZED
    assert all(logs.Recording(path).complete for path in tmp_path.glob("*.mcap"))


def test_what_happens_between_goals_is_recorded_too(server: RigMaker, tmp_path: Path) -> None:
    arm = server()
    for task in (1, 7):
        arm.executive.tell(logs.LogLine(arm.clock.now(), 20, "door", f"somebody asks for {task}"))
        run(arm, task)
    arm.executive.arm_to("deactivate")
    arm.executive.close()
    (between,) = tmp_path.glob("*-server.mcap")
    story = list(logs.Recording(between).records(logs.Transition, logs.LogLine, logs.Goal))
    said = [line.message for line in story if isinstance(line, logs.LogLine)]
    assert said == ["somebody asks for 1", "somebody asks for 7"]
    states = [record.goal for record in story if isinstance(record, logs.Transition)]
    assert states[:4] == ["configuring", "inactive", "activating", "active"]
    assert states[-4:] == ["deactivating", "inactive", "shuttingdown", "finalized"]
    assert not [record for record in story if isinstance(record, logs.Goal)]
    goals = [logs.Recording(path) for path in sorted(tmp_path.glob("*Z-[0-9].mcap"))]
    ends = [[r.code for r in file.records(logs.Result)] for file in goals]  # type: ignore[union-attr]
    assert sorted(ends) == [["goal.unknown_task"], ["ok"]]
    assert not [record for file in goals for record in file.records(logs.Transition)]


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
        assert run(arm, 1).code == "internal"
    assert run(arm, 1).success


def test_where_the_arm_stands_is_known_while_active_only(server: RigMaker) -> None:
    arm = server(active=False)
    with pytest.raises(NotActive):
        _ = arm.executive._arm.commanded
    assert arm.executive.snapshot().commanded is None
