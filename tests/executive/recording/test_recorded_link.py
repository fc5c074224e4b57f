"""Frames wait for the recording of the frames before them; a stop does not."""

import logging
import os
import threading
from collections.abc import Sequence
from itertools import pairwise

import pytest

import logs
from executive.errors import RecordingBehind
from executive.recording.recorded_link import RecordedLink
from hardware import State
from tests.conftest import Rig, RigMaker


class Late:
    """Recordings that are late for so many calls, each of its whole timeout."""

    def __init__(self, rig: Rig, calls: float, write_s: float = 0.0) -> None:
        self._rig, self.calls, self._write_s = rig, calls, write_s
        self.begun = True

    def caught_up(self, timeout: float) -> bool:
        if self.calls <= 0:
            return True
        self.calls -= 1
        self._rig.rest(timeout)
        return False

    def write_time(self) -> float:
        return self._write_s


def link_of(rig: Rig, late: Late, timeout: float = 5.0) -> RecordedLink:
    return RecordedLink(rig.link, late, rig.clock, timeout)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("write_s", "cause"), [(0.9, "writes to the disk took 0.90 s"), (0.1, "computer is busy")]
)
def test_a_late_recording_is_reported_with_its_likely_cause(
    rig: RigMaker, caplog: pytest.LogCaptureFixture, write_s: float, cause: str
) -> None:
    arm = rig()
    link = link_of(arm, Late(arm, 10, write_s))
    with arm.clock.working():
        assert [link.ready(0.1) for _ in range(11)] == [False] * 10 + [True]
        assert link.ready(0.1)
    (line,) = caplog.messages
    assert line.startswith("A frame waited 1.00 s for the recording of the previous one.")
    assert cause in line


def test_a_long_write_on_a_busy_computer_has_two_likely_causes(
    rig: RigMaker, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set())  # this thread is one too many
    arm = rig()
    link = link_of(arm, Late(arm, 10, write_s=0.9))
    with arm.clock.working():
        assert [link.ready(0.1) for _ in range(11)] == [False] * 10 + [True]
    (line,) = caplog.messages
    assert "writes to the disk took 0.90 s" in line
    assert "the computer is busy" in line


def test_a_recording_that_is_too_late_ends_the_motion(rig: RigMaker) -> None:
    arm = rig()
    link = link_of(arm, Late(arm, float("inf")), timeout=0.5)
    with arm.clock.working():
        assert not link.ready(0.4)
        with pytest.raises(RecordingBehind, match=r"within 0\.5 s \(--recording-timeout\)"):
            link.ready(0.2)


def test_a_stop_waits_only_briefly(rig: RigMaker) -> None:
    arm = rig()
    link = link_of(arm, Late(arm, float("inf")))
    with arm.clock.working():
        link.open()
        before = arm.clock.now()
        link.write(b"b090,s090,e090,g000,")
        assert arm.clock.now() - before == pytest.approx(0.002)
        link.close()


def test_a_stop_does_not_wait_for_a_file_that_is_being_created(rig: RigMaker) -> None:
    arm = rig()
    late = Late(arm, float("inf"))
    late.begun = False
    link = link_of(arm, late)
    with arm.clock.working():
        link.open()
        before = arm.clock.now()
        link.write(b"b090,s090,e090,g000,")
        assert arm.clock.now() == before
        link.close()


def delayed(
    arm: Rig, monkeypatch: pytest.MonkeyPatch, seconds: float, frames: Sequence[int] = (3,)
) -> None:
    """The recording is late once by so long, after each of these frames."""
    recordings = arm.executive._recordings
    caught_up, left = recordings.caught_up, dict.fromkeys(frames, seconds)

    def late(timeout: float) -> bool:
        if left.get(recordings.frames, 0.0) > 0:
            left[recordings.frames] -= timeout
            if threading.current_thread().name == "streamer":  # a stop writes on another one
                arm.rest(timeout)
            return False
        return caught_up(timeout)

    monkeypatch.setattr(recordings, "caught_up", late)


def test_a_motion_waits_for_its_recording_and_goes_on(
    rig: RigMaker, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    arm = rig()
    delayed(arm, monkeypatch, 2.0)
    caplog.set_level(logging.WARNING)
    (outcome,) = arm.run(1)
    assert outcome.success, outcome.message
    frames = [frame.time for frame in arm.recorded(logs.Sent)]
    gaps = [after - before for before, after in pairwise(frames)]
    assert gaps[2] >= 2.0
    assert min(gaps) > 0.09  # no burst after it
    assert any("A frame waited 2.0" in line for line in caplog.messages)


def test_a_disk_with_stalls_of_300_ms(rig: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    stalls = (3, 8, 14, 20)
    arm, impatient = rig(), rig(recording_timeout=0.2)
    delayed(arm, monkeypatch, 0.3, stalls)
    (outcome,) = arm.run(1)
    assert outcome.success, outcome.message
    frames = [frame.time for frame in arm.recorded(logs.Sent)]
    late = [n for n, (one, next_one) in enumerate(pairwise(frames), 1) if next_one - one >= 0.3]
    assert tuple(late) == stalls
    delayed(impatient, monkeypatch, 0.3, stalls)
    (outcome,) = impatient.run(1)
    assert (outcome.code, outcome.frames) == ("log.behind", 3)


def test_the_arm_stays_active_if_the_recording_is_too_late(
    server: RigMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = server(recording_timeout=0.5)
    delayed(arm, monkeypatch, 0.6)
    goal = arm.executive.send(1).identity
    outcome = arm.executive.result(goal)
    assert (outcome.code, outcome.frames) == ("log.behind", 3)
    assert arm.executive.status().arm is State.ACTIVE
    assert arm.executive.result(arm.executive.send(1).identity).success


def test_a_stop_ends_a_frame_that_waits(server: RigMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = server()
    delayed(arm, monkeypatch, 1e9)

    def cancel() -> None:
        arm.rest(0.3)
        arm.executive.cancel()

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(arm.recorded(logs.Sent)) == 3:
            arm.soon(cancel)

    arm.on_record = watch
    outcome = arm.executive.result(arm.executive.send(1).identity)
    assert outcome.code == "goal.canceled"
    assert [frame.hold for frame in arm.recorded(logs.Sent)] == [False] * 3 + [True]
    assert arm.executive.status().arm is State.ACTIVE
