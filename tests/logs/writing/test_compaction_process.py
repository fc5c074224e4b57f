"""The compaction process: if any process dies, a journal or a finished recording is left."""

import fcntl
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import logs
import logs.writing.compaction_process
from logs import Recorder, RecordingIncomplete, read
from logs.reading.file_state import being_written, is_complete
from logs.writing.compaction_process import CompactionProcess
from tests.logs.test_run import EPOCH_NS, fail
from tests.logs.writing.test_recorder import sent
from tests.support.paths import ROOT


@pytest.fixture
def compaction() -> Iterator[CompactionProcess]:
    made = CompactionProcess()
    yield made
    made.close()


def recorded(path: Path) -> Recorder:
    recorder = Recorder(path, EPOCH_NS, fail)
    for number in range(300):
        recorder.put(sent(number))
    return recorder


def test_the_recording_is_made_by_another_process(
    tmp_path: Path, compaction: CompactionProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logs.writing.compaction_process, "rewrite", fail)
    summary = recorded(tmp_path / "run.mcap").close(compaction)
    assert (summary.path, summary.messages, summary.whole) == (tmp_path / "run.mcap", 900, True)
    assert is_complete(summary.path, every_byte=True)
    assert not being_written(summary.path)


@pytest.mark.slow
def test_many_at_once(tmp_path: Path, compaction: CompactionProcess) -> None:
    recorders = [recorded(tmp_path / f"{number}.mcap") for number in range(20)]
    threads = [threading.Thread(target=each.close, args=(compaction,)) for each in recorders]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(is_complete(recorder.path, every_byte=True) for recorder in recorders)


def test_a_stopped_process_is_continued(
    tmp_path: Path, compaction: CompactionProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logs.writing.compaction_process, "_STOPPED", 0.01)
    recorder = recorded(tmp_path / "run.mcap")
    os.kill(compaction.pid, signal.SIGSTOP)
    assert recorder.close(compaction).whole
    os.kill(compaction.pid, signal.SIGSTOP)  # then the fixture ends it


def test_if_the_process_was_killed_the_caller_compacts_and_a_new_one_starts(
    tmp_path: Path, compaction: CompactionProcess
) -> None:
    first = compaction.pid
    os.kill(first, signal.SIGSTOP)
    recorder = recorded(tmp_path / "run.mcap")
    closing = threading.Thread(target=recorder.close, args=(compaction,))
    closing.start()
    os.kill(first, signal.SIGKILL)
    closing.join()
    assert is_complete(recorder.path, every_byte=True)
    after = recorded(tmp_path / "after.mcap")
    after.close(compaction)
    assert is_complete(after.path, every_byte=True)
    assert compaction.pid != first


def test_a_failed_compaction_is_reported_by_the_caller(
    tmp_path: Path, compaction: CompactionProcess
) -> None:
    recorder = recorded(tmp_path / "run.mcap")
    (tmp_path / "run.mcap.part").mkdir()  # the path of the partial copy
    with pytest.raises(RecordingIncomplete, match="Is a directory"):
        recorder.close(compaction)
    assert sum(1 for _ in read(recorder.path)) == 900


# Prints when it sent its request, then waits forever.
ASKER = """
import os, signal, socket, sys
from pathlib import Path
from logs import Recorder, Sent
from logs.writing import compaction_process
from logs.writing.compaction_process import CompactionProcess

compaction_process._STOPPED = 60.0
compaction = CompactionProcess()
os.kill(compaction.pid, signal.SIGSTOP)
recorder = Recorder(Path(sys.argv[1]), 10**18, print)
for number in range(300):
    recorder.put(Sent(number / 100, b"%d," % number, None, False, (), ()))
send = socket.send_fds

def reported(*what):
    send(*what)
    print(compaction.pid, flush=True)

socket.send_fds = reported
recorder.close(compaction)
"""


def test_if_the_caller_was_killed_the_recording_is_finished_under_its_lock(tmp_path: Path) -> None:
    path, root = tmp_path / "run.mcap", ROOT
    command = [sys.executable, "-c", ASKER, str(path)]
    with subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE) as asker:
        assert asker.stdout
        pid = int(asker.stdout.readline())
        asker.kill()
    assert being_written(path)
    with path.open("rb") as journal:
        os.kill(pid, signal.SIGCONT)
        fcntl.flock(journal, fcntl.LOCK_EX)  # until it is done
    assert is_complete(path, every_byte=True)
    assert sum(1 for _ in read(path, ["/serial/tx"])) == 300
