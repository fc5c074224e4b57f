"""Recovery and retention: neither touches a recording that is being written."""

import errno
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

import logs
from logs import DiskFull, Recorder, RecordingInUse, recover, recover_all
from logs.folder import recording_path
from logs.reading.file_state import being_written, is_complete, locked
from logs.records.file_format import RECOVERED
from logs.writing import journal
from logs.writing.compaction import part_of
from logs.writing.journal import PieceWriter
from logs.writing.recorder import _queue
from logs.writing.retention import Rule, pin, pinned, prune
from tests.logs.test_run import EPOCH_NS, RUNS, fail, record
from tests.logs.writing.test_compaction import run_journal
from tests.logs.writing.test_recorder import sent
from tests.support.paths import ROOT
from tests.support.recordings.compact import compact

NOW = 2_000_000_000.0
DAY = 86400.0
FOOTER_BYTES = 37  # opcode, length, two offsets, checksum, magic


def test_a_journal_that_was_cut_is_recovered_and_the_loss_counted(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path, finish=False)
    torn = path.read_bytes() + b"\x05\x99torn"
    path.write_bytes(torn)
    made = recover(path)
    assert made is not None
    assert (made.whole, made.torn) == (False, 6)
    assert made.text().endswith(
        " messages; 6 bytes after them are incomplete or damaged; the original file is kept as "
        "run.mcap.damaged"
    )
    assert made.damaged is not None
    assert made.damaged.name == "run.mcap.damaged"
    assert made.damaged.read_bytes() == torn
    assert logs.Recording(path).notes[RECOVERED] == {"torn_bytes": "6"}
    with path.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())
    assert recover(path) is None


def test_recovery_keeps_the_pin_the_age_and_what_was_kept_before(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path, finish=False)
    whole, kept = path.read_bytes(), []
    for torn in (b"\x05\x99one", b"\x05\x99two"):
        path.unlink()
        path.write_bytes(whole + torn)
        os.utime(path, (0, 0))
        pin(path, True)
        made = recover(path)
        assert made is not None
        assert made.damaged is not None
        kept.append(made.damaged.read_bytes())
        assert pinned(path)
        assert path.stat().st_mtime == 0
    assert kept == [whole + b"\x05\x99one", whole + b"\x05\x99two"]
    assert [file.name for file in sorted(tmp_path.glob("*.damaged*"))] == [
        "run.mcap.damaged",
        "run.mcap.damaged2",
    ]


def test_a_closed_journal_that_was_never_compacted_is_recovered(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path)
    (made,) = recover_all(tmp_path)
    assert isinstance(made, logs.Summary)
    assert (made.whole, made.torn) == (True, 0)
    assert list(recover_all(tmp_path)) == []


def test_damage_in_the_middle_is_found_by_the_command(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    assert list(recover_all(tmp_path)) == []  # at start-up only the ends are read
    made = recover(path)
    assert made is not None
    assert made.torn > 0


def test_a_damaged_attachment_is_found_and_dropped(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path)
    data = path.read_bytes()
    for whole in (data, data[:-40]):  # closed, and cut off
        path.write_bytes(whole.replace(b"task: 1\n", b"task: 2\n", 1))
        made = recover(path)
        assert made is not None
        assert made.torn > 0
        assert "task.yaml" not in logs.Recording(path).files


@pytest.mark.slow
def test_every_flip_in_the_footer_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    whole = path.read_bytes()
    for place in range(len(whole) - FOOTER_BYTES, len(whole)):
        for bit in range(8):
            data = bytearray(whole)
            data[place] ^= 1 << bit
            path.write_bytes(data)
            assert not is_complete(path, every_byte=True), (place - len(whole), bit)


def test_partial_copies_are_removed_and_other_files_stay(tmp_path: Path) -> None:
    record(tmp_path / "run.mcap", RUNS["refused"])
    for name in ("run.mcap.part", "gone.mcap.part", "odd.mcap.part"):
        (tmp_path / name).write_bytes(b"half")
    (tmp_path / "note.txt").write_text("mine")
    (tmp_path / "odd.mcap").write_text("no recording")
    assert list(recover_all(tmp_path)) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["note.txt", "odd.mcap", "run.mcap"]


def test_a_recording_with_a_damaged_head_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path)
    path.write_bytes(b"?" + path.read_bytes()[1:])
    (error,) = recover_all(tmp_path)
    assert isinstance(error, logs.RecordingError)
    assert "is not an MCAP file" in str(error)


def test_files_of_other_programs_stay(tmp_path: Path) -> None:
    path = tmp_path / "theirs.mcap"
    writer = Writer(str(path))
    writer.start("ros2", "rosbag2")
    assert path.read_bytes() == b""
    assert list(recover_all(tmp_path)) == []
    writer.flush()  # type: ignore[no-untyped-call]
    assert path.read_bytes() != b""
    assert list(recover_all(tmp_path)) == []
    inode = path.stat().st_ino
    writer.finish()  # type: ignore[no-untyped-call]
    os.utime(path, (0, 0))
    assert list(prune(tmp_path, Rule(0.0, 0.0), NOW)) == []
    assert path.stat().st_ino == inode


def test_an_empty_recording_of_a_killed_process_is_removed(tmp_path: Path) -> None:
    path = recording_path(tmp_path, EPOCH_NS, 1)
    for act in (lambda: recover_all(tmp_path), lambda: [recover(path)]):
        path.touch()
        with locked(path):
            assert list(recover_all(tmp_path)) == []
        (made,) = act()
        assert isinstance(made, logs.Summary)
        assert made.text().endswith("was empty and is removed: its run had recorded nothing")
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_only_a_file_is_a_recording(tmp_path: Path, make: Callable[[Path], None]) -> None:
    path = tmp_path / "20261121T103155.123Z-1.mcap"
    make(path)
    before = path.stat()
    for act in (logs.Recording, logs.read, recover, compact, partial(pin, on=True)):
        with pytest.raises(logs.RecordingError, match="is not a file; give a recording"):
            act(path)
    assert list(recover_all(tmp_path)) == []
    assert list(logs.closed_recordings(tmp_path, 0.0)) == []
    assert list(prune(tmp_path, Rule(0.0, 0.0), NOW)) == []
    assert path.stat() == before


def test_files_that_vanish_are_skipped(tmp_path: Path) -> None:
    (tmp_path / "gone.mcap").symlink_to(tmp_path / "away")
    old = aged(tmp_path, "old", 9)
    assert list(prune(tmp_path, Rule(7.0, None), NOW)) == [old]
    assert list(recover_all(tmp_path)) == []


def test_the_partial_copy_of_a_running_compaction_stays(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path)
    with locked(path):
        part_of(path).write_bytes(b"half")
        assert list(recover_all(tmp_path)) == []
        assert part_of(path).exists()


def test_recovery_by_command_leaves_no_partial_copy(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["refused"])
    part_of(path).write_bytes(b"half")
    assert recover(path) is None
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("code", [errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS])
def test_without_hard_links_the_damaged_file_is_copied(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    def refuse(*paths: Path) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr("os.link", refuse)
    path = tmp_path / "run.mcap"
    (tmp_path / "run.mcap.damaged").write_bytes(b"an earlier one")
    run_journal(path, finish=False)
    torn = path.read_bytes() + b"\x05\x99torn"
    path.write_bytes(torn)
    made = recover(path)
    assert made is not None
    assert made.damaged is not None
    assert made.damaged.name == "run.mcap.damaged2"
    assert made.damaged.read_bytes() == torn
    assert is_complete(path, every_byte=True)
    assert (tmp_path / "run.mcap.damaged").read_bytes() == b"an earlier one"


def test_a_disk_too_full_for_the_copy_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*paths: Path) -> None:
        raise PermissionError

    def fill(*streams: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "run.mcap"
    run_journal(path, finish=False)
    torn = path.read_bytes() + b"\x05\x99torn"
    path.write_bytes(torn)
    monkeypatch.setattr("os.link", refuse)
    monkeypatch.setattr("shutil.copyfileobj", fill)
    with pytest.raises(OSError, match="No space left"):
        recover(path)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == torn


def test_those_who_look_whether_it_is_written_do_not_take_each_other_for_its_writer(
    tmp_path: Path,
) -> None:
    path = tmp_path / "run.mcap"
    path.touch()
    with locked(path, shared=True):
        assert not being_written(path)
    with locked(path):
        assert being_written(path)


def test_a_recording_being_written_stays(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(path, EPOCH_NS, fail) as recorder:
        recorder.put(sent(1))
        assert recorder.caught_up(5.0)
        code = f"import logs, pathlib; print(*logs.recover_all(pathlib.Path({str(tmp_path)!r})))"
        command = [sys.executable, "-c", code]
        root = ROOT
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
        assert done.stdout.strip() == ""
        with pytest.raises(RecordingInUse, match="being written by another armtree"):
            compact(path)
        assert list(prune(tmp_path, Rule(0.0, 0.0), NOW)) == []
    assert recover(path) is None


def test_a_recording_that_is_moved_while_it_is_written_can_be_recovered(tmp_path: Path) -> None:
    path, moved = tmp_path / "run.mcap", tmp_path / "moved.mcap"
    recorder = Recorder(path, EPOCH_NS, fail)
    recorder.put(sent(1))
    assert recorder.caught_up(5.0)
    path.rename(moved)
    with pytest.raises(logs.RecordingIncomplete) as raised:
        recorder.close()
    assert str(raised.value) == (
        f"{path}: was moved or deleted while it was written; if it was moved, "
        "`armtree log recover FILE` finishes it"
    )
    made = recover(moved)
    assert made is not None
    assert made.whole


def test_a_frame_that_is_not_recorded_in_time_raises(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.mcap", EPOCH_NS, fail) as recorder:
        assert recorder.caught_up(5.0)
        blocked = threading.Event()
        recorder._jobs.put(blocked.wait)  # later jobs wait for the thread
        recorder.put(sent(1))
        assert not recorder.caught_up(0.0)
        blocked.set()
        assert recorder.caught_up(5.0)


def test_a_recorder_has_begun_when_its_file_is_created(tmp_path: Path) -> None:
    created = threading.Event()
    _queue("recorder").put(created.wait)
    with Recorder(tmp_path / "run.mcap", EPOCH_NS, fail) as recorder:
        before = recorder.begun
        created.set()
        assert not before
        assert recorder.caught_up(5.0)
        assert recorder.begun


def test_a_full_disk_leaves_room_for_the_end(tmp_path: Path) -> None:
    path = tmp_path / "x"
    with path.open("xb") as stream:
        tail = PieceWriter(stream)
        refused = iter([OSError(28, "No space left on device")])

        def write(handle: int, data: bytes) -> int:
            for error in refused:
                raise error
            return real(handle, data)

        real, os.write = os.write, write  # type: ignore[assignment]
        try:
            tail.write(b"the end")
        finally:
            os.write = real
        assert tail.full
        assert path.read_bytes() == b"the end"
    assert "its end" not in str(DiskFull(path))  # not known yet


def test_a_failed_sync_leaves_no_open_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(handle: int) -> None:
        raise OSError(5, "Input/output error")

    tail = PieceWriter((tmp_path / "x").open("xb"))
    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OSError, match="Input/output"):
        tail.close()
    handles = [handle for handle in Path("/proc/self/fd").iterdir() if handle.is_symlink()]
    assert not [x for x in handles if str(tmp_path) in os.readlink(x)]  # also not the reserve


def test_the_time_of_all_writes_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now, real = [0.0], os.write

    def slow(handle: int, data: bytes) -> int:
        now[0] += 0.6
        if data == b"asks":
            assert tail.write_time() == pytest.approx(1.2)  # also of one that is not done
            now[0] += 0.1
        return real(handle, data)

    with (tmp_path / "x").open("xb") as stream:
        tail = PieceWriter(stream)
        monkeypatch.setattr(journal, "time", SimpleNamespace(monotonic=lambda: now[0]))
        monkeypatch.setattr(os, "write", slow)
        for data in (b"one", b"asks", b"two"):
            tail.write(data)
        assert tail.write_time() == pytest.approx(0.7)
        assert tail.write_time() == 0.0


def aged(folder: Path, name: str, days: float) -> Path:
    path = folder / f"{name}.mcap"
    record(path, RUNS["refused"])
    os.utime(path, (NOW - days * DAY, NOW - days * DAY))
    return path


def test_old_recordings_are_deleted_but_no_pinned_or_unfinished_one(tmp_path: Path) -> None:
    old, kept = aged(tmp_path, "old", 9), aged(tmp_path, "kept", 99)
    aged(tmp_path, "new", 1)
    pin(kept, True)
    run_journal(tmp_path / "unfinished.mcap")
    os.utime(tmp_path / "unfinished.mcap", (0, 0))
    assert list(prune(tmp_path, Rule(None, None), NOW)) == []
    assert list(prune(tmp_path, Rule(7.0, None), NOW)) == [old]
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["kept", "new", "unfinished"]
    assert pinned(kept)
    pin(kept, False)
    assert list(prune(tmp_path, Rule(7.0, None), NOW)) == [kept]


def test_pictures_are_deleted_with_their_recording(tmp_path: Path) -> None:
    old, new = aged(tmp_path, "old", 9), aged(tmp_path, "new", 1)
    pictures = [old.with_suffix(suffix) for suffix in (".png", ".svg")]
    for picture in (*pictures, new.with_suffix(".png"), tmp_path / "mine.png"):
        picture.touch()
    before = sorted(tmp_path.iterdir())
    assert list(prune(tmp_path, Rule(7.0, None), NOW, dry_run=True)) == [old, *pictures]
    assert sorted(tmp_path.iterdir()) == before
    assert list(prune(tmp_path, Rule(7.0, None), NOW)) == [old, *pictures]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.png", "new.mcap", "new.png"]


def test_a_kept_damaged_file_is_deleted_by_the_rule_unless_pinned(tmp_path: Path) -> None:
    for name, pinned_ in (("a", False), ("b", True)):
        path = tmp_path / f"{name}.mcap"
        run_journal(path, finish=False)
        with path.open("ab") as stream:
            stream.write(b"\x05\x99torn")
        pin(path, pinned_)
        recover(path)
        os.utime(path, (NOW, NOW))
        os.utime(tmp_path / f"{name}.mcap.damaged", (0, 0))
    (tmp_path / "theirs.mcap.damaged").write_bytes(b"another program's")
    assert list(prune(tmp_path, Rule(7.0, None), NOW)) == [tmp_path / "a.mcap.damaged"]
    assert len(list(tmp_path.glob("*.damaged"))) == 2
    size = sum(path.stat().st_size for path in tmp_path.iterdir())
    assert list(prune(tmp_path, Rule(None, (size + 1) / 1e6), NOW)) == []
    assert list(prune(tmp_path, Rule(None, (size - 1) / 1e6), NOW)) == [tmp_path / "a.mcap"]


def test_a_file_system_without_permissions_cannot_pin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["refused"])
    monkeypatch.setattr(Path, "chmod", lambda path, mode: None)  # as on exFAT
    with pytest.raises(PermissionError, match="has no write protection; move it"):
        pin(path, True)


def test_the_oldest_are_deleted_until_the_rest_fits(tmp_path: Path) -> None:
    paths = [aged(tmp_path, str(days), days) for days in (5, 4, 3, 2)]
    size = paths[0].stat().st_size
    assert list(prune(tmp_path, Rule(None, 2.5 * size / 1e6), NOW)) == paths[:2]
