"""Recordings of a server's goals: finished in the background, with a limit on unfinished ones."""

import errno
import gc
import logging
import os
import re
import shutil
import signal
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import logs
from executive.api import Policy
from executive.api.outcome import GoalState, Outcome
from executive.cli.support.log_handler import LogHandler
from executive.goals.goal import Goal
from executive.goals.mailbox import Mailbox
from executive.recording import recordings
from executive.recording.archive import restore_robot
from executive.replay.verification import verify
from executive.replay.verify_frames import result_difference
from hardware import RealClock, Robot, State, StateChanged, load_robot
from logs.reading.file_state import being_written, is_complete
from logs.views.narrative import narrative, overview
from logs.views.run_figure import _outcome
from logs.views.timeline import timeline
from logs.writing import recorder
from logs.writing.compaction_process import shared_process
from logs.writing.journal import Journal, PieceWriter
from tests.conftest import RigMaker
from tests.logs.test_run import fail
from tests.support.command_line.typed import typed
from tests.support.servers.server_acts import run


def test_another_process_finishes_the_recordings(
    server: RigMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("logs.writing.recorder.rewrite", fail)
    monkeypatch.setattr("logs.writing.compaction_process.rewrite", fail)
    arm = server()
    ran = [Path(run(arm, 1).recording) for _ in range(3)]
    arm.executive.close()
    assert all(is_complete(path, every_byte=True) for path in ran)


def test_a_servers_own_recording_mentions_goals_of_other_recordings(
    server: RigMaker, tmp_path: Path
) -> None:
    arm = server()
    assert run(arm, 1).success
    arm.executive.close()
    (own,) = (path for path in tmp_path.glob("*.mcap") if recordings.is_server_recording(path))
    verification = verify(own)
    assert verification.holds, verification.text()
    reported = [words for _, words in narrative(own, everything=False)]
    assert "goal: task 1" in reported
    found = overview(own)
    assert (found.goal, found.result, found.outcome) == (None, None, "-")
    run_drawn = timeline(own)
    assert (run_drawn.goal, run_drawn.result) == (None, None)


def test_the_holds_of_a_servers_own_recording_repeat_frames_of_other_recordings(
    server: RigMaker, tmp_path: Path
) -> None:
    """A stop between two goals repeats the last frame, which is in the recording of its goal."""
    arm = server()
    for task in (1, 0):
        assert run(arm, task).success
        arm.rest(1.0)
        arm.executive.cancel()
        arm.rest(1.0)
    arm.executive.close()
    (own,) = (path for path in tmp_path.glob("*.mcap") if recordings.is_server_recording(path))
    one, other = logs.Recording(own).frames()
    assert one.hold
    assert other.hold
    assert one.data != other.data
    verification = verify(own)
    assert verification.holds, verification.text()


class SlowBegin:
    """A journal that starts slowly, as the first one of a process does."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, error: Exception | None = None) -> None:
        self._error, self._clock = error, threading.Event()
        self._real: Any = Journal
        monkeypatch.setattr("logs.writing.journal.Journal", self)

    def __call__(self, *given: Any) -> Journal:
        self._clock.wait(0.2)  # nothing ends it
        if self._error:
            raise self._error
        made: Journal = self._real(*given)
        return made


@pytest.fixture
def configured(robot: Robot, tmp_path: Path) -> Robot:
    """The Arduinobot with a firmware that is configured by commands as soon as it has booted."""
    folder = tmp_path / "robot"
    folder.mkdir()
    shutil.copy(robot.urdf, folder)
    path = folder / robot.path.name
    path.write_text(robot.path.read_text().replace('firmware = "stock"', 'firmware = "armtree"'))
    return load_robot(path)


@pytest.mark.parametrize("single_user", [True, False])
def test_the_recording_begins_before_the_first_command(
    rig: RigMaker,
    configured: Robot,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    single_user: bool,
) -> None:
    """A server waits even before the board boots, because it starts long before its first goal."""
    SlowBegin(monkeypatch)
    arm = rig(robot=configured, single_user=single_user)
    first, kept = "write" if single_user else "open", tmp_path / "kept.mcap"
    real = getattr(arm.link, first)

    def keep(*data: bytes) -> None:
        if not kept.exists():
            (path,) = tmp_path.glob("*.mcap")
            shutil.copy(path, kept)
        real(*data)

    monkeypatch.setattr(arm.link, first, keep)
    if single_user:
        assert arm.run(1)[0].success
        assert len(list(logs.Recording(kept).records(logs.Goal))) == 1
    else:
        with arm.clock.working():
            arm.executive.start()
            arm.executive.arm_to("configure")
            arm.executive.arm_to("activate")
            arm.executive.close()
    found = logs.Recording(kept)
    assert list(found.records(logs.Sent)) == []
    assert "versions" in found.notes
    assert any(name.endswith(".urdf") for name in found.files)


def test_no_command_is_sent_without_a_recording(
    rig: RigMaker, configured: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    SlowBegin(monkeypatch, OSError(errno.EIO, os.strerror(errno.EIO)))
    arm, sent = rig(robot=configured), list[bytes]()
    monkeypatch.setattr(arm.link, "write", sent.append)
    (outcome,) = arm.run(1)
    assert (outcome.code, arm.opened, sent) == ("log.incomplete", 1, [])


def test_the_first_frame_of_a_later_goal_waits_for_its_beginning(
    rig: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, begun = rig(), list[int]()
    real, never = recorder.Recorder._make, threading.Event()

    def slow(self: recorder.Recorder, make: Any) -> None:
        never.wait(0.2)
        real(self, make)
        begun.append(len(arm.frames))

    monkeypatch.setattr(recorder.Recorder, "_make", slow)
    first, second = arm.run(1, 0)
    assert begun == [0, first.frames]
    assert second.success


def test_a_recording_that_begins_too_late_is_the_cause(
    rig: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    SlowBegin(monkeypatch)
    monkeypatch.setattr(recorder, "_BEGIN_S", 0.01)
    monkeypatch.setattr(recorder.Recorder.wait, "__defaults__", (0.01,))
    (outcome,) = rig().run(1)
    assert outcome.code == "log.incomplete"
    assert "the disk is too slow" in outcome.message


@pytest.mark.parametrize("canceled", [True, False])
def test_a_lost_recording_is_reported_whatever_the_outcome(
    rig: RigMaker, tmp_path: Path, canceled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "FSYNC_S", 60.0)  # the end finds the loss
    arm = rig()

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(arm.frames) == 5:
            (path,) = tmp_path.glob("*.mcap")
            path.unlink()
            arm.cancel() if canceled else arm.executive._interrupt(OSError("odd"))

    arm.on_record = watch
    (outcome,) = arm.run(1)
    assert outcome.state is (GoalState.CANCELED if canceled else GoalState.ABORTED)
    assert not outcome.code.startswith("log.")
    assert "was moved or deleted while it was written" in outcome.message
    assert outcome.cause is None or "was moved or deleted" in outcome.cause.message


def test_a_disk_that_fills_up_is_reported_once(
    rig: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, write = rig(), PieceWriter._write
    refused = iter([OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))])

    def write_once_in_vain(self: PieceWriter, data: bytes) -> None:
        if len(arm.frames) >= 5:
            for error in refused:
                raise error
        write(self, data)

    monkeypatch.setattr(PieceWriter, "_write", write_once_in_vain)
    (outcome,) = arm.run(1)
    assert outcome.code == "log.disk_full"
    assert outcome.cause
    for words in (outcome.message, outcome.cause.message):
        assert words.count("the disk is full") == 1
        assert "its end was still recorded" in words


def test_a_server_whose_own_recording_failed_opens_another_one(
    server: RigMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, write = server(), PieceWriter._write
    full = True

    def write_in_vain(self: PieceWriter, data: bytes) -> None:
        if full and recordings.is_server_recording(Path(str(self._stream.name))):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(self, data)

    monkeypatch.setattr(PieceWriter, "_write", write_in_vain)
    run(arm, 1)  # aborted if the recording of the server fails before its end
    arm.rest(1.0)  # else another one may fail during the next goal
    arm.executive._recordings.wait()
    full = False
    assert run(arm, 1).success
    arm.rest(1.0)
    arm.executive.cancel()
    arm.rest(1.0)
    with pytest.raises(logs.LogError, match="recording incomplete"):
        arm.executive.close()
    *_, last = sorted(filter(recordings.is_server_recording, tmp_path.glob("*.mcap")))
    assert [frame.hold for frame in logs.Recording(last).frames()] == [True]
    verification = verify(last)
    assert verification.holds, verification.text()


def test_failed_recordings_do_not_stay_in_memory(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, failed, close = server(), [], PieceWriter.close

    def close_in_vain(self: PieceWriter) -> None:
        close(self)
        failed.append(weakref.ref(self))
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(PieceWriter, "close", close_in_vain)
    for name in ("executive.recording.recordings", "logs.writing.recorder"):
        monkeypatch.setattr(logging.getLogger(name), "disabled", True)  # pytest keeps its lines
    for _ in range(4):
        run(arm, 7)  # there is no task 7
    with pytest.raises(logs.LogError, match="recording incomplete"):
        arm.executive.close()
    for name in ("recorder", "fsync"):
        done = threading.Event()
        recorder._queue(name).put(done.set)  # the jobs before it have recorders
        assert done.wait(20.0)
    gc.collect()
    assert len(failed) == 5  # one is the server's own
    assert sum(writer() is not None for writer in failed) <= 1  # of the error that was raised


def test_a_goal_and_an_activation_open_one_recording_after_a_failed_one(
    server: RigMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, both = server(), threading.Barrier(2)
    kept = arm.executive._recordings
    own = kept._server
    monkeypatch.setattr(logs.Recorder, "failed", property(lambda self: self is own))

    def check_space() -> None:
        with suppress(threading.BrokenBarrierError):
            both.wait(0.2)  # the other thread, if it does not wait for this one

    monkeypatch.setattr(kept, "check_space", check_space)
    changed = StateChanged(arm.clock.now(), "activate", State.INACTIVE, State.ACTIVATING)
    with ThreadPoolExecutor() as threads:
        ended = threads.submit(kept.goal_ended)
        recorded = threads.submit(kept.on_arm_event, changed)
    ended.result()
    recorded.result()
    arm.executive.close()
    assert len([*filter(recordings.is_server_recording, tmp_path.glob("*.mcap"))]) == 2


def test_a_lost_recording_of_a_task_that_succeeded_ends_the_sequence(
    rig: RigMaker, tmp_path: Path
) -> None:
    arm = rig()

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Result):
            (path,) = tmp_path.glob("*.mcap")
            path.unlink()

    arm.on_record = watch
    (outcome,) = arm.run(0, 1)
    assert (outcome.state, outcome.code) == (GoalState.SUCCEEDED, "log.incomplete")


def test_goals_wait_if_too_many_recordings_are_unfinished(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recordings, "_UNFINISHED", 2)
    monkeypatch.setattr("logs.writing.compaction_process._STOPPED", 60.0)
    arm = server(policy=Policy.QUEUE)
    pid = shared_process().pid
    os.kill(pid, signal.SIGSTOP)
    sent = [arm.executive.send(7).identity for _ in range(4)]  # there is no task 7
    third = arm.executive.result(sent[2])
    unfinished = [Path(arm.executive.result(goal).recording) for goal in sent[:3]]
    assert all(map(being_written, unfinished))
    current = arm.executive.status().goal
    assert current is not None
    assert (current.identity, current.state) == (sent[3], GoalState.ACCEPTED)
    os.kill(pid, signal.SIGCONT)
    assert arm.executive.result(sent[3]).code == third.code == "goal.unknown_task"
    arm.executive.close()
    assert all(is_complete(path, every_byte=True) for path in unfinished)


def test_the_time_in_the_queue_is_shown_apart_from_the_run(
    server: RigMaker, tmp_path: Path
) -> None:
    arm = server(policy=Policy.QUEUE)
    first, second = (arm.executive.send(task).identity for task in (1, 0))
    one, two = map(arm.executive.result, (first, second))
    arm.executive.close()
    assert overview(Path(one.recording)).waited == 0.0
    found = overview(Path(two.recording))
    assert found.waited == pytest.approx(one.duration)
    assert found.goal
    assert found.result
    ran = found.result.time - found.goal.time
    assert found.waited + ran == pytest.approx(found.result.duration)
    words = f"{found.waited:.2f} s in the queue"
    assert words in typed(tmp_path, "log", "ls", str(tmp_path))[1]
    assert f"{found.waited:.3f} s of it in" in typed(tmp_path, "log", "info", two.recording)[1]
    drawn = _outcome(timeline(Path(two.recording)))
    assert drawn == f"SUCCEEDED, {found.result.duration:.2f} s, {words.replace(' in', ' of it in')}"


@pytest.mark.parametrize("single_user", [True, False])
def test_earlier_log_lines_are_at_the_start_of_a_recording(
    rig: RigMaker, tmp_path: Path, single_user: bool
) -> None:
    arm = rig(single_user=single_user)
    begun = arm.clock.now()
    for words in ("one", "two"):
        arm.executive.record(logs.LogLine(begun, 30, "logs", words))
    arm.rest(1.0)
    if single_user:
        assert arm.run(0)[0].success
    else:
        arm.executive.start()
        arm.executive.close()
    (path,) = tmp_path.glob("*.mcap")
    found = [line for line in logs.Recording(path).records() if isinstance(line, logs.LogLine)]
    assert [line.message for line in found] == ["one", "two"]
    assert [line.time for line in found] == pytest.approx([begun, begun])
    assert verify(path).holds


def test_the_log_line_that_begins_a_goal_is_in_its_recording(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    arm = server()
    root = logging.getLogger()
    handler = LogHandler(arm.executive)
    monkeypatch.setattr(root, "handlers", [*root.handlers, handler])
    outcome = run(arm, 1)
    arm.executive.close()
    lines = [words for _, words in narrative(Path(outcome.recording), everything=False)]
    executing = "log: executive.goals.executor: Executing the goal"
    assert any(line.startswith(executing) for line in lines)


def test_a_result_counts_the_frames_before_it_whenever_they_come(
    tmp_path: Path, robot: Robot
) -> None:
    """A stop may repeat a frame while a goal begins or ends, on a thread of its own."""
    clock = RealClock()
    found = recordings.Recordings(tmp_path, robot, clock, lambda _: None, lambda _: None, {})
    joints, pose = tuple(joint.name for joint in robot.actuated), robot.boot_pose
    ended = threading.Event()

    def hold() -> None:
        while not ended.is_set():
            data = b"b090,s090,e090,g000,"
            found.record(logs.Sent(clock.now(), data, None, True, joints, pose))
            ended.wait(0.0005)

    def outcome(frames: int, path: str) -> Outcome:
        ended.wait(0.01)  # nothing ends it; frames come meanwhile
        return Outcome.of(1, GoalState.SUCCEEDED, None, frames, 0.0, path)

    holds = clock.spawn(hold, "holds")
    paths = []
    for number in range(5):
        goal = Goal(f"{number:032x}", 1, {}, clock.now(), 0, Mailbox(clock))
        found.open(goal.status, "pick", 1, {}, {})
        paths.append(Path(found.path))
        found.record_result(goal.identity, outcome)
        found.goal_ended()
    ended.set()
    holds.join()
    found.close()
    for path in paths:
        assert result_difference(list(logs.Recording(path).records())) == ""


def test_an_edit_of_the_robot_file_before_a_run_changes_no_recording(
    tmp_path: Path, robot: Robot
) -> None:
    """The run plans with the margin that was read before."""
    for path in robot.files:
        shutil.copy(path, tmp_path)
    file, clock = tmp_path / robot.path.name, RealClock()
    before = load_robot(file)
    found = recordings.Recordings(tmp_path, before, clock, lambda _: None, lambda _: None, {})
    file.write_text(re.sub("margin_m *=.*", "margin_m = 0.04", file.read_text()))
    goal = Goal(f"{1:032x}", 1, {}, clock.now(), 0, Mailbox(clock))
    found.open(goal.status, "pick", 1, {}, {})
    recording = Path(found.path)
    found.goal_ended()
    found.close()
    assert restore_robot(logs.Recording(recording)).collision == before.collision
    assert load_robot(file).collision.margin == 0.04
