"""Execute: frames are checked, then streamed, and can be halted at any moment."""

import numpy as np
import pytest
from py_trees.common import Status

from hardware import FrameSent, Schedule
from skills import Interrupted, Scheduled, StartMoved
from skills.leaves.execute import Execute
from skills.merged_motion import MergedMotion
from skills.motion import MotionCollides, Plan, PlanCanceled, Rest, Verify
from tests.conftest import Bench

Plans = tuple[Plan, Plan]


@pytest.fixture
def skill(bench: Bench, plans: Plans) -> Execute:
    made: Execute = bench.skill(Execute, arm_plan=plans[0], gripper_plan=plans[1])
    return made


def sent(bench: Bench) -> list[FrameSent]:
    return [event for event in bench.events if isinstance(event, FrameSent)]


def to_the_end(bench: Bench, skill: Execute) -> Status:
    while skill.status is Status.RUNNING:
        bench.wait()
        skill.tick_once()
    return skill.status


def moving(bench: Bench, skill: Execute, frames: int = 0) -> None:
    """Tick until so many frames are sent."""
    skill.tick_once()
    bench.desk.jobs[-1].answer(None)
    skill.tick_once()
    while len(sent(bench)) < frames:
        bench.wait()
        skill.tick_once()


def test_nothing_moves_before_the_check(bench: Bench, skill: Execute) -> None:
    for _ in range(3):
        skill.tick_once()
        assert (skill.status, skill.busy, skill.progress) == (Status.RUNNING, True, None)
    (job,) = bench.desk.jobs
    assert isinstance(job.request, Verify)
    rows = np.asarray(job.request.configurations)
    assert np.abs(rows[0]).max() < 0.01  # the decoded frame of the boot pose
    (reported,) = bench.reported
    assert isinstance(reported, Scheduled)
    assert len(rows) > len(reported.schedule.setpoints)
    assert sent(bench) == []


def test_to_the_end(bench: Bench, skill: Execute) -> None:
    moving(bench, skill)
    assert to_the_end(bench, skill) is Status.SUCCESS
    assert (skill.busy, skill.progress) == (False, 1.0)
    (reported,) = bench.reported
    assert isinstance(reported, Scheduled)
    frames = [setpoint.frame.data for setpoint in reported.schedule.setpoints]
    assert [event.data for event in sent(bench)] == frames
    assert skill.feedback_message == f"{len(frames)} of {len(frames)} frames"
    assert bench.arm.commanded == (0.3, 0.0, 0.0, -0.2)
    assert bench.link.board.state(bench.clock.now()).servos[0] == 107.0


def test_progress_grows_with_the_frames(bench: Bench, skill: Execute) -> None:
    moving(bench, skill)
    shares = []
    while skill.status is Status.RUNNING:
        shares.append(skill.progress)
        bench.wait()
        skill.tick_once()
    assert shares[0] == 0.0
    assert shares == sorted(share for share in shares if share is not None)


def test_a_check_that_fails(bench: Bench, skill: Execute) -> None:
    collides = MotionCollides(3, None, "gripper_left", "floor", -0.01, 0.002)
    skill.tick_once()
    bench.desk.jobs[0].answer(collides)
    skill.tick_once()
    assert (skill.status, skill.failure) == (Status.FAILURE, collides)
    assert sent(bench) == []


def test_halted_during_the_check(bench: Bench, skill: Execute) -> None:
    skill.tick_once()
    skill.stop(Status.INVALID)
    assert bench.desk.jobs[0].canceled == 1
    assert skill.busy
    bench.desk.jobs[0].answer(PlanCanceled())
    assert not skill.busy
    assert sent(bench) == []


@pytest.mark.parametrize("frames", [1, 5])
def test_halted_while_it_moves(bench: Bench, skill: Execute, frames: int) -> None:
    moving(bench, skill, frames)
    skill.stop(Status.INVALID)
    assert not skill.busy
    events = sent(bench)
    assert events[-1].scheduled is None
    assert events[-1].data == events[-2].data
    assert len(events) == frames + 1


def test_halted_when_done(bench: Bench, skill: Execute) -> None:
    moving(bench, skill)
    to_the_end(bench, skill)
    count = len(sent(bench))
    skill.stop(Status.INVALID)
    assert len(sent(bench)) == count


def test_stopped_from_outside_the_tree(bench: Bench, skill: Execute) -> None:
    moving(bench, skill, 3)
    bench.arm.stop()
    skill.tick_once()
    assert skill.status is Status.FAILURE
    assert isinstance(skill.failure, Interrupted)
    assert "stopped after 3 of" in str(skill.failure)


def test_the_port_is_lost(bench: Bench, skill: Execute) -> None:
    moving(bench, skill, 3)
    bench.link.unplug()
    assert to_the_end(bench, skill) is Status.FAILURE
    assert skill.failure is not None
    assert skill.failure.code == "hw.port_lost"


def test_a_plan_that_begins_elsewhere(bench: Bench, skill: Execute) -> None:
    moving(bench, skill)
    to_the_end(bench, skill)
    skill.tick_once()
    assert skill.status is Status.FAILURE
    assert isinstance(skill.failure, StartMoved)
    assert len(bench.desk.jobs) == 1


def test_together(bench: Bench, plans: Plans) -> None:
    durations = []
    for together in (False, True):
        skill = bench.skill(Execute, arm_plan=plans[0], gripper_plan=plans[1], together=together)
        skill.tick_once()
        reported = bench.reported[-1]
        assert isinstance(reported, Scheduled)
        durations.append(reported.schedule.duration)
        skill.stop(Status.INVALID)
    assert durations[1] < durations[0]


def test_the_arm_left_the_active_state_meanwhile(bench: Bench, skill: Execute) -> None:
    skill.tick_once()
    bench.arm.deactivate()
    bench.desk.jobs[0].answer(None)
    skill.tick_once()
    assert skill.status is Status.FAILURE
    assert skill.failure is not None
    assert skill.failure.code == "hw.not_active"


# Paused


class Unplanned(Execute, register=False):
    """Frames without a known motion."""

    def compile_motion(self, start: tuple[float, ...]) -> tuple[Schedule, MergedMotion | None]:
        schedule, _ = super().compile_motion(start)
        return schedule, None


def test_what_is_left_of_unplanned_frames_starts_from_standstill(
    bench: Bench, plans: Plans
) -> None:
    skill = bench.skill(Unplanned, arm_plan=plans[0], gripper_plan=plans[1])
    moving(bench, skill, 5)
    skill.on_pause()
    skill.tick_once()
    while len(bench.desk.jobs) < 2:
        bench.wait()
        skill.tick_once()
    moving(bench, skill)
    assert to_the_end(bench, skill) is Status.SUCCESS
    whole, left = (
        reported.schedule for reported in bench.reported if isinstance(reported, Scheduled)
    )
    assert left.setpoints[0].time > 4 * (whole.setpoints[5].time - whole.setpoints[4].time)
    assert [s.frame for s in left.setpoints] == [s.frame for s in whole.setpoints[5:]]
    frames = [event.data for event in sent(bench) if event.scheduled is not None]
    assert frames == [setpoint.frame.data for setpoint in whole.setpoints]
    assert skill.feedback_message == f"{len(frames)} of {len(frames)} frames"


def test_a_rest_that_cannot_be_timed_fails(bench: Bench, skill: Execute) -> None:
    moving(bench, skill, 5)
    skill.on_pause()
    while not isinstance(bench.desk.jobs[-1].request, Rest):
        skill.tick_once()
    share = skill.progress
    assert share
    assert skill.busy
    bench.desk.jobs[-1].answer(PlanCanceled())
    skill.tick_once()
    assert skill.status is Status.FAILURE
    assert isinstance(skill.failure, PlanCanceled)
    assert not skill.busy
    assert skill.progress == share


def test_a_rest_is_halted(bench: Bench, skill: Execute) -> None:
    moving(bench, skill, 5)
    skill.on_pause()
    while not isinstance(bench.desk.jobs[-1].request, Rest):
        skill.tick_once()
    skill.stop(Status.INVALID)
    assert bench.desk.jobs[-1].canceled == 1
    assert skill.busy
    bench.desk.jobs[-1].answer(PlanCanceled())
    assert not skill.busy
