"""The recorder never blocks a run, and reports every loss."""

import errno
import fcntl
import logging
import os
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Queue
from types import SimpleNamespace

import pytest

import logs.writing.recorder
from logs import (
    DiskFull,
    LogError,
    NodeStatus,
    Recorder,
    Recording,
    RecordingExists,
    RecordingIncomplete,
    RecordingNotCreated,
    Sent,
    read,
    recording_path,
    recover,
    recover_all,
)
from logs.reading.file_state import is_complete
from logs.records.records import Item
from logs.writing.compaction import rewrite
from logs.writing.journal import Journal
from tests.logs.test_run import EPOCH_NS, fail, node
from tests.support.paths import ROOT
from tests.support.recordings.compact import compact

UTC_NS = 1_795_257_115_123_456_789


def sent(number: int) -> Sent:
    return Sent(number / 100, b"b090,s090,e090,g000,", number / 100, False, ("joint_1",), (0.5,))


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """The kernel refuses to write any file beyond `size` [bytes]."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_name_holds_time_and_task(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    assert recording_path(folder, UTC_NS, 1) == folder / "20261121T103155.123Z-1.mcap"
    assert folder.is_dir()


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(RecordingNotCreated, match=r"file/x: cannot be created \(Not a directory\)"):
        recording_path(tmp_path / "file" / "x", UTC_NS, 1)
    with pytest.raises(RecordingNotCreated, match="give another folder"):
        Recorder(tmp_path / "missing" / "run.mcap", EPOCH_NS, fail)


def test_an_existing_name_is_refused_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_text("precious")
    with pytest.raises(RecordingExists, match="1 ms later") as caught:
        Recorder(path, EPOCH_NS, fail)
    assert isinstance(caught.value, FileExistsError)
    assert caught.value.path == path
    assert path.read_text() == "precious"


def test_of_two_recorders_racing_for_a_name_one_wins(tmp_path: Path) -> None:
    start = threading.Barrier(2)
    won: list[Recorder] = []
    lost: list[LogError] = []

    def race() -> None:
        start.wait()
        try:
            won.append(Recorder(tmp_path / "run.mcap", EPOCH_NS, fail))
        except RecordingExists as error:
            lost.append(error)

    threads = [threading.Thread(target=race) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(won), len(lost)) == (1, 1)
    assert won[0].close().messages == 0


def test_a_name_that_another_armtree_recovers_before_it_is_locked_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, lock = recording_path(tmp_path, UTC_NS, 1), fcntl.flock

    def late(handle: int, how: int) -> None:
        monkeypatch.setattr(fcntl, "flock", lock)
        assert len(list(recover_all(tmp_path))) == 1
        lock(handle, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with pytest.raises(RecordingExists):
        Recorder(path, EPOCH_NS, fail)
    assert list(tmp_path.iterdir()) == []


def test_many_threads_one_file(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.mcap", EPOCH_NS, fail) as recorder:

        def work(thread: int) -> None:
            for number in range(100):
                recorder.put(node(number / 10, f"{thread}", "RUNNING", str(number)))

        threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    found = [message.fields() for message in read(recorder.path)]
    for name in "0123":
        numbers = [int(item["message"]) for item in found if item["name"] == name]
        assert numbers == list(range(100))


def test_all_recorders_share_two_threads_and_each_has_its_own_file(tmp_path: Path) -> None:
    recorders = [Recorder(tmp_path / f"{i}.mcap", EPOCH_NS, fail) for i in range(5)]
    for number in range(20):
        for i, recorder in enumerate(recorders):
            recorder.put(node(number / 10, f"{i}", "RUNNING", str(number)))
    names = [thread.name for thread in threading.enumerate()]
    assert (names.count("recorder"), names.count("fsync")) == (1, 1)
    for i, recorder in enumerate(recorders):
        recorder.close()
        found = [message.fields() for message in read(recorder.path)]
        assert {item["name"] for item in found} == {f"{i}"}
        assert [int(item["message"]) for item in found] == list(range(20))


class Disk:
    """Notes every fsync; can let them fail."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, refuses: int = 0) -> None:
        self.synced: Queue[int] = Queue()
        self._real, self._refuses = os.fsync, refuses
        monkeypatch.setattr(os, "fsync", self)
        monkeypatch.setattr(logs.writing.recorder, "FSYNC_S", 0.001)

    def __call__(self, handle: int) -> None:
        self.synced.put(os.fstat(handle).st_ino)
        self._refuses -= 1
        if self._refuses >= 0:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        self._real(handle)


def test_written_records_are_synced_soon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = Disk(monkeypatch)
    with (
        Recorder(tmp_path / "a.mcap", EPOCH_NS, fail) as first,
        Recorder(tmp_path / "b.mcap", EPOCH_NS, fail) as second,
    ):
        for recorder in (first, second, first):
            recorder.put(sent(1))
            assert disk.synced.get(timeout=5) == recorder.path.stat().st_ino


def test_a_process_that_was_frozen_does_not_blame_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    disk, now = Disk(monkeypatch), [0.0]
    monkeypatch.setattr(logs.writing.recorder, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(logs.writing.recorder, "FSYNC_S", 0.2)
    with Recorder(tmp_path / "run.mcap", EPOCH_NS, fail) as recorder:
        recorder.put(sent(1))
        assert recorder.wait(5)
        now[0] = 12.0  # while the sync waits for its time
        assert disk.synced.get(timeout=5) == recorder.path.stat().st_ino
    assert not caplog.records


def test_a_slow_disk_is_logged_once_and_delays_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    disk, go_on = Disk(monkeypatch), threading.Semaphore(0)
    sync = os.fsync

    class Clock:
        """A clock on which each fsync takes 3 s."""

        now = 0.0

        def monotonic(self) -> float:
            return self.now

    clock = Clock()

    def slow(handle: int) -> None:
        go_on.acquire()
        clock.now += 3.0
        sync(handle)

    monkeypatch.setattr(os, "fsync", slow)
    monkeypatch.setattr(logs.writing.recorder, "time", clock)
    monkeypatch.setattr(logs.writing.recorder, "FSYNC_S", 0.0)
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, fail)
    for number in range(2):
        recorder.put(sent(number))
        assert recorder.wait(5)  # while the disk is busy
        go_on.release()
        assert disk.synced.get(timeout=5) == recorder.path.stat().st_ino
    monkeypatch.setattr(os, "fsync", sync)
    recorder.close()
    (reported,) = caplog.records
    assert "took 3.0 s to sync the recording to the disk" in reported.getMessage()


def test_a_failing_disk_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Disk(monkeypatch, refuses=1)
    failures: Queue[Exception] = Queue()
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, failures.put)
    recorder.put(sent(1))
    assert isinstance(failures.get(timeout=5), OSError)
    with pytest.raises(RecordingIncomplete, match="Input/output error"):
        recorder.close()
    assert sum(1 for _ in read(recorder.path)) == 3


def test_a_failure_at_the_end_is_raised_and_not_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next run may have begun, and its recording has not failed."""
    finish, reported = Journal.finish, list[Exception]()

    def fail_to_finish(self: Journal) -> None:
        finish(self)
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, reported.append)
    recorder.put(sent(1))
    monkeypatch.setattr(Journal, "finish", fail_to_finish)
    with pytest.raises(RecordingIncomplete, match="Input/output error"):
        recorder.close()
    assert not reported


def test_a_recording_that_is_deleted_is_reported_while_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = Disk(monkeypatch)
    failures: Queue[Exception] = Queue()
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, failures.put)
    recorder.put(sent(1))
    disk.synced.get(timeout=5)
    assert recorder.caught_up(5)
    recorder.path.unlink()
    recorder.put(sent(2))
    assert "it was deleted" in str(failures.get(timeout=5))
    assert not recorder.caught_up(0.0)
    with pytest.raises(RecordingIncomplete, match="was moved or deleted while it was written"):
        recorder.close()


def test_a_sync_that_ends_after_the_recording_is_complete_is_no_loss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The complete recording has taken the place of the file that was synced."""
    syncs, complete = threading.Event(), threading.Event()

    def sync(_: int) -> None:
        if not syncs.is_set():  # the first one is that of the written records
            syncs.set()
            assert complete.wait(20)

    def rewritten(path: Path) -> object:
        summary = rewrite(path)
        complete.set()
        return summary

    monkeypatch.setattr(logs.writing.recorder, "rewrite", rewritten)
    monkeypatch.setattr(logs.writing.recorder, "FSYNC_S", 0.0)
    monkeypatch.setattr(os, "fsync", sync)
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, lambda _: None)
    recorder.put(sent(0))
    assert syncs.wait(20)
    assert recorder.close().messages == 3


def test_closing_twice_gives_the_same_summary_and_late_records_are_ignored(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, fail)
    recorder.put(sent(1))
    summary = recorder.close()
    recorder.put(sent(2))
    assert recorder.close() is summary
    assert summary.messages == 3


def test_a_record_that_cannot_be_converted_costs_itself_only(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    failures: list[Exception] = []
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, failures.append)
    recorder.put(sent(1))
    recorder.put(logs.Feedback(0.1, "no uuid", 1, "planning", "PlanArm"))
    recorder.put(logs.Feedback(0.2, "none either", 1, "planning", "PlanArm"))
    recorder.put(sent(2))
    recorder.wait(5)
    with pytest.raises(RecordingIncomplete, match="2 records lost") as caught:
        recorder.close()
    assert [type(failure) for failure in failures] == [ValueError]
    assert caught.value.cause is failures[0]
    assert sum(message.topic == "/serial/tx" for message in read(recorder.path)) == 2
    assert [line.levelno for line in caplog.records] == [logging.ERROR]


def names(path: Path) -> list[str]:
    """The nodes of a recording's status changes."""
    records = Recording(path).records(NodeStatus)
    return [record.name for record in records if isinstance(record, NodeStatus)]


def test_items_are_made_by_the_writing_thread_in_their_turn(tmp_path: Path) -> None:
    path, threads = tmp_path / "run.mcap", list[int]()

    def make() -> list[Item]:
        threads.append(threading.get_ident())
        return [node(0.1, "second", "RUNNING"), node(0.1, "third", "RUNNING")]

    with Recorder(path, EPOCH_NS, fail) as recorder:
        recorder.put(node(0.1, "first", "RUNNING"))
        recorder.put_made(make)
        recorder.put(node(0.1, "fourth", "RUNNING"))
    assert threads != [threading.get_ident()]
    assert names(path) == ["first", "second", "third", "fourth"]


def test_items_that_cannot_be_made_are_reported(tmp_path: Path) -> None:
    reported = list[Exception]()
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, reported.append)

    def make() -> list[Item]:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    recorder.put_made(make)
    recorder.put(node(0.1, "next", "RUNNING"))
    recorder.wait()
    with pytest.raises(RecordingIncomplete, match="Input/output error"):
        recorder.close()
    assert [type(each) for each in reported] == [OSError]
    assert names(recorder.path) == ["next"]


def test_a_full_disk_leaves_no_empty_file(tmp_path: Path) -> None:
    with room_for(0):
        recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, lambda _: None)
        recorder.put(sent(0))
        with pytest.raises(
            RecordingIncomplete, match=r"nothing could be recorded \(.*File too large"
        ):
            recorder.close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("size", [5_000, 30_000])
def test_a_full_disk_is_reported_once_and_the_records_before_are_valid(
    tmp_path: Path, size: int
) -> None:
    path = tmp_path / "run.mcap"
    failures: list[Exception] = []
    reported = threading.Event()

    def on_failure(cause: Exception) -> None:
        failures.append(cause)
        reported.set()

    with room_for(size):
        recorder = Recorder(path, EPOCH_NS, on_failure)
        for number in range(300):
            recorder.put(sent(number))
        assert reported.wait(5)
        recorder.put(sent(300))
        with pytest.raises(RecordingIncomplete, match="run the task again") as caught:
            recorder.close()
    assert len(failures) == 1
    assert isinstance(failures[0], OSError)
    kept = 301 - (caught.value.lost or 0)
    assert compact(path).messages == 3 * kept
    assert (kept > 0) is (size == 30_000)
    assert sum(1 for _ in read(path)) == 3 * kept
    assert list(tmp_path.iterdir()) == [path]


def test_a_frame_does_not_follow_one_whose_write_fails_while_it_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder, waits = Recorder(tmp_path / "run.mcap", EPOCH_NS, lambda _: None), threading.Event()
    write_to_disk = Journal.write

    def write(journal: Journal, *items: Item) -> None:
        assert waits.wait(20)
        with room_for(0):
            write_to_disk(journal, *items)

    def wait(timeout: float) -> bool:
        waits.set()
        return Recorder.wait(recorder, timeout)

    assert recorder.caught_up(20)
    monkeypatch.setattr(Journal, "write", write)
    monkeypatch.setattr(recorder, "wait", wait)
    recorder.put(sent(0))
    assert not recorder.caught_up(20)
    with pytest.raises(RecordingIncomplete):
        recorder.close()


def test_a_full_disk_that_loses_nothing_is_reported_as_such(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reported: list[Exception] = []
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, reported.append)
    assert recorder.wait()
    refused = iter([OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))])
    real = os.write

    def write(handle: int, data: bytes) -> int:
        for error in refused:
            raise error
        return real(handle, data)

    monkeypatch.setattr(os, "write", write)
    recorder.put(sent(1))
    recorder.wait(5)
    with pytest.raises(DiskFull, match="its end was still recorded"):
        recorder.close()
    assert len(reported) == 1
    assert is_complete(recorder.path, every_byte=True)


def test_if_compaction_fails_the_error_names_recover(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("logs.writing.recorder.rewrite", refuse)
    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, fail)
    recorder.put(sent(1))
    with pytest.raises(RecordingIncomplete, match=r"0 records lost .*`armtree log recover FILE`"):
        recorder.close()
    monkeypatch.undo()
    assert recover(recorder.path)


def test_dev_full_is_an_error_at_once() -> None:
    with Path("/dev/full").open("wb") as stream:
        with pytest.raises(OSError, match="No space left"):
            Journal(stream, EPOCH_NS)
        assert stream.closed


def test_a_failing_on_failure_does_not_stop_the_recorder(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    def on_failure(cause: Exception) -> None:
        raise RuntimeError("the listener's own fault")

    recorder = Recorder(tmp_path / "run.mcap", EPOCH_NS, on_failure)
    recorder.put(logs.Feedback(0.1, "no uuid", 1, "planning", "PlanArm"))
    recorder.put(sent(1))
    recorder.wait(5)
    with pytest.raises(RecordingIncomplete, match="1 records lost"):
        recorder.close()
    assert "could not be reported" in caplog.text
    assert sum(1 for _ in read(recorder.path)) == 3


CHILD = """
import sys
from pathlib import Path
from types import SimpleNamespace
from logs import Sent
from logs.records.records import Item
from logs.writing.journal import Journal

journal = Journal(Path(sys.argv[1]).open("xb"), 10**18)
number = 0
while True:
    journal.write(Sent(number / 100, b"%d," % number, None, False, (), ()))
    number += 1
    sys.stdout.write(f"{number}\\n")
    sys.stdout.flush()
"""


def test_kill_9_loses_nothing_that_was_written(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    command = [sys.executable, "-c", CHILD, str(path)]
    root = ROOT
    with subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        for _ in range(300):
            child.stdout.readline()
        child.send_signal(signal.SIGKILL)
        rest = child.stdout.read().splitlines(keepends=True)
    reported = 300 + sum(line.endswith(b"\n") for line in rest)
    compact(path)
    frames = [bytes(message.data.data) for message in read(path, ["/serial/tx"])]
    assert frames == [b"%d," % number for number in range(len(frames))]
    assert reported <= len(frames) <= reported + 1
