"""Cancels at any moment: every goal ends once, nothing keeps running, nothing more is sent."""

import random
from functools import partial
from pathlib import Path

import pytest

import logs
from executive.api import Policy
from executive.api.outcome import CancelCode, GoalState, Outcome
from hardware import State
from skills import Skill
from skills.leaves.plan_group import PlanGripper
from tests.conftest import Rig, RigMaker
from tests.support.servers.server_acts import at_frame, history, run


def check_ended(arm: Rig, outcome: Outcome, sent_before: int) -> None:
    """No node runs, nothing works on, nothing was sent after the hold."""
    last = {}
    for node in arm.recorded(logs.NodeStatus):
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
    - selector: [{inverter: CheckHardware}, {inverter: {Fail: {reason: meant}}}]
      memory: false
    - Succeed
"""


@pytest.mark.slow
def test_a_cancel_at_every_node_at_every_tick(
    server: RigMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "tasks"
    folder.mkdir()
    (folder / "14_kinds.yaml").write_text(KINDS)
    arm, ticks = server(tasks=folder), _Ticks(monkeypatch)
    names, number = set[str](), 0
    while ticks.came:
        arm.records.clear()
        swing = "0.1" if number % 2 else "-0.1"
        ticks.cancel_at(number, arm)
        goal = arm.executive.send(14, {"swing": swing}).identity
        outcome = arm.executive.result(goal)
        check_ended(arm, outcome, 0)
        # In the last tick of the tree, of its few nodes, it may come too late.
        assert outcome.state is GoalState.CANCELED or ticks.after < 10
        names |= ticks.names
        number += 1
    assert number > 50
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

    @property
    def after(self) -> int:
        """Ticks of skills from the cancel on."""
        return -self._left

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


@pytest.mark.slow
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


def test_a_skill_that_misses_the_deadline_deactivates_the_arm(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = server()
    with monkeypatch.context() as patch:
        patch.setattr(PlanGripper, "busy", True)
        at_frame(arm, 5, arm.executive.cancel)
        outcome = run(arm, 1)
    assert (outcome.state, outcome.code) == (GoalState.ABORTED, "hw.cancel_timeout")
    assert arm.executive.status().arm is State.UNCONFIGURED
    assert run(arm, 1).code == "hw.not_active"
    arm.executive.arm_to("configure")
    arm.executive.arm_to("activate")
    assert run(arm, 1).success
