"""Compaction makes a recording from any journal."""

import io
import os
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from logs import Attachment, RecordingError, RecordingTruncated, read
from logs.records.file_format import DIGESTS, RECOVERED
from logs.writing.journal import Journal
from tests.logs.test_run import EPOCH_NS, RUNS, record
from tests.support.recordings.compact import compact

MAGIC = 8


def small_journal(path: Path) -> list[int]:
    """Writes a journal of five messages; returns its size after each piece."""
    sizes = []
    with path.open("wb") as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start("ros2", "test")
        writer.flush()  # type: ignore[no-untyped-call]
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/tree", "cdr", schema, {"a": "b"})
        writer.add_attachment(0, 0, "task.yaml", "text/plain", b"task: 1")
        for number in range(5):
            data = b"\x00\x01\x00\x00\x02\x00\x00\x00%d\x00" % number
            writer.add_message(channel, number, data, number, number)
            writer.flush()  # type: ignore[no-untyped-call]
            sizes.append(stream.tell())
    return sizes


def run_journal(path: Path, finish: bool = True) -> None:
    stream = path.open("xb")
    journal = Journal(stream, EPOCH_NS)
    journal.write(Attachment("task.yaml", "application/yaml", b"task: 1\n"))
    for item in RUNS["ok"]:
        journal.write(item)
    if finish:
        journal.finish()
    stream.close()


def content(path: Path) -> list[object]:
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        messages = reader.iter_messages(log_time_order=False)
        found: list[object] = [
            (schema and schema.data, channel.topic, channel.metadata, message.log_time,
             message.sequence, message.data)
            for schema, channel, message in messages
        ]  # fmt: skip
        return found + list(reader.iter_attachments()) + list(reader.iter_metadata())


@pytest.mark.slow
def test_cut_at_every_byte_the_valid_prefix_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # 1500 compactions: skip the cost of fsync.
    monkeypatch.setattr("os.fsync", lambda handle: None)
    path = tmp_path / "run.mcap"
    sizes = small_journal(path)
    whole = path.read_bytes()
    for cut in range(len(whole) + 1):
        path.write_bytes(whole[:cut])
        expected = sum(size <= cut for size in sizes)
        made = compact(path)
        assert (made.path, made.messages) == (path, expected)
        assert made.bytes == path.stat().st_size
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            assert sum(1 for _ in reader.iter_messages()) == expected


def test_a_real_run_cut_anywhere_near_a_message(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path, finish=False)
    whole = path.read_bytes()
    before = 10**6
    for cut in range(len(whole), len(whole) - 20_000, -809):
        path.write_bytes(whole[:cut])
        messages = compact(path).messages
        assert messages <= before
        before = messages
        assert sum(1 for _ in read(path)) == messages


def test_compaction_changes_nothing_but_the_form(tmp_path: Path) -> None:
    ended, cut = tmp_path / "ended.mcap", tmp_path / "cut.mcap"
    run_journal(ended)
    before, size = content(ended), ended.stat().st_size
    run_journal(cut, finish=False)
    assert compact(ended).bytes < 2 / 3 * size
    compact(cut)
    *kept, digests = content(ended)
    assert kept == before
    assert isinstance(digests, Metadata)
    assert digests.name == DIGESTS
    *kept, recovered, other = content(cut)
    assert kept == before
    assert recovered == Metadata(RECOVERED, {"torn_bytes": "0"})
    assert isinstance(other, Metadata)
    assert other.metadata.items() - digests.metadata.items() == {
        ("note recovered", other.metadata["note recovered"])
    }


def test_compacting_a_recording_gives_the_same_bytes(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    first = record(path, RUNS["ok"])
    before = path.read_bytes()
    assert compact(path) == first
    assert path.read_bytes() == before


@pytest.mark.slow
def test_a_recording_has_its_checksums(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    whole = path.read_bytes()
    kinds = {type(item).__name__: item for item in StreamReader(io.BytesIO(whole)).records}
    assert kinds["DataEnd"].data_section_crc != 0  # type: ignore[attr-defined]
    assert kinds["Footer"].summary_crc != 0  # type: ignore[attr-defined]
    for place in range(MAGIC, len(whole), 61):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises(RecordingError):
            list(read(path))


@pytest.mark.slow
def test_a_flipped_bit_in_a_journal_costs_what_follows_at_most(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.fsync", lambda handle: None)
    path = tmp_path / "run.mcap"
    small_journal(path)
    whole = path.read_bytes()
    for place in range(MAGIC, len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
        assert compact(path).messages <= 5
        with path.open("rb") as stream:
            make_reader(stream, validate_crcs=True).get_summary()


def test_a_file_that_is_not_mcap_is_not_changed(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("not a recording")
    with pytest.raises(RecordingError, match=r"notes\.txt: is not an MCAP file"):
        compact(path)
    assert path.read_text() == "not a recording"
    with pytest.raises(RecordingError, match="No such file"):
        compact(tmp_path / "missing.mcap")
    assert list(tmp_path.iterdir()) == [path]


def test_a_disk_that_fails_leaves_the_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path)
    before = path.read_bytes()

    def refuse(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", refuse)
    with pytest.raises(OSError, match="No space left"):
        compact(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("place", [0.5, 0.99, 1.0])
def test_a_disk_that_keeps_other_bytes_leaves_the_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: float
) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path)
    before, fsync = path.read_bytes(), os.fsync

    def spoil(handle: int) -> None:
        os.pwrite(handle, b"\xff", round(place * (os.fstat(handle).st_size - 1)))
        fsync(handle)

    monkeypatch.setattr("os.fsync", spoil)
    with pytest.raises(RecordingError, match="of 199 messages; check the disk"):
        compact(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_live_journal_can_be_read_up_to_where_it_is(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_journal(path, finish=False)
    with pytest.raises(RecordingTruncated, match="cut off or damaged after 199") as caught:
        list(read(path))
    assert caught.value.messages == 199
