"""Reading recordings."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from logs import (
    Goal,
    LogLine,
    Message,
    Record,
    Recording,
    RecordingError,
    RecordingTruncated,
    Result,
    Sent,
    read,
    table,
)
from logs.reading.indexed import IndexedRecording
from logs.reading.reader import MAX_BYTES
from logs.reading.tolerant_reader import TolerantReader
from logs.views.narrative import Listing, listing, overview
from tests.logs.test_run import RUNS, plan, record

DUE = (0.0, 1.0, None)


def test_topics_can_be_chosen(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    frames = [bytes(message.data.data) for message in read(path, ["/serial/tx"])]
    assert frames == [item.data for item in RUNS["ok"] if isinstance(item, Sent)]


def test_reading_is_lazy(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    first = next(read(path))
    assert first.topic == "/goal"
    assert first.fields()["name"] == "pick"


def test_unknown_numbers_in_a_column_are_nan(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    words = Result(3.0, "0" * 32, 1, "ABORTED", False, "x", "x", 0, 3.0)
    record(path, [Sent(float(n), b"b", due, due is None, (), ()) for n, due in enumerate(DUE)])
    due = table(path, "/serial/timing")["scheduled"]
    assert due.dtype == float
    np.testing.assert_array_equal(due, [0.0, 1.0, np.nan])
    record(tmp_path / "other.mcap", [words])
    columns = table(tmp_path / "other.mcap", "/result")
    assert np.isnan(columns["value"]).all()
    assert columns["code"].tolist() == ["x"]


def test_only_json_has_fields(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    state = next(read(path, ["/joint_states"]))
    with pytest.raises(TypeError, match=r"/joint_states carries sensor_msgs/msg/JointState"):
        state.fields()


@pytest.mark.slow
def test_a_large_message_is_one_of_a_motion(tmp_path: Path) -> None:
    motion = plan(1.0, "arm", ("a", "b"), (0.0, 0.0))
    count = 60_000
    rows = tuple((n / 7, -n / 3) for n in range(count))
    motion = replace(motion, times=tuple(n / 100 for n in range(count)), positions=rows)
    record(path := tmp_path / "run.mcap", [motion])
    assert list(Recording(path).records()) == [motion]
    (message,) = read(path, ["/plan/arm"])
    assert len(message.cdr) > MAX_BYTES
    other = replace(message, topic="/goal")
    for decode in (other.fields, lambda: other.data):
        with pytest.raises(RecordingError, match=r"a message on /goal has \d+ bytes; the limit is"):
            decode()
    for each, count, most in (("[", 400_002, 250_000), (":", 40_000, 20_000)):
        text = each.encode() * count + b" " * MAX_BYTES
        head = b"\0\1\0\0" + (len(text) + 1).to_bytes(4, "little")
        words = re.escape(f"it contains {each} {count} times; the limit is {most} times")
        with pytest.raises(RecordingError, match=words):
            replace(message, cdr=head + text + b"\0").fields()


def test_a_text_that_is_not_utf_8_is_refused(tmp_path: Path) -> None:
    record(path := tmp_path / "run.mcap", RUNS["ok"])
    goal = next(read(path, ["/goal"]))
    with pytest.raises(RecordingError, match=r"a message on /goal can\w* be .*utf-8"):
        replace(goal, cdr=goal.cdr.replace(b"pick", b"pic\xff")).fields()


def test_a_long_text_is_cut_before_it_is_recorded(tmp_path: Path) -> None:
    text = "\U0001f600" * 1_000_000
    failed = Result(3.0, "0" * 32, 1, "ABORTED", False, "x", text, 0, 3.0, hint=text)
    record(path := tmp_path / "run.mcap", [failed, LogLine(3.0, 20, "x", text)])
    found, line = Recording(path).records()
    assert isinstance(found, Result)
    assert isinstance(line, LogLine)
    assert found.message == found.hint == line.message == f"{text[:20_000]} ..."


def test_an_unreadable_file_raises_at_once(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"gone\.mcap: cannot be read \(No such file"):
        read(tmp_path / "gone.mcap")
    (tmp_path / "image.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(RecordingError, match="is not an MCAP file; give a recording"):
        read(tmp_path / "image.png")


def test_a_cut_file_yields_the_valid_messages_then_raises(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    whole = record(path, RUNS["ok"])
    path.write_bytes(path.read_bytes()[:-5])
    messages = read(path)
    found = list(islice(messages, whole.messages))
    assert found[0].topic == "/goal"
    with pytest.raises(
        RecordingTruncated, match="`armtree log recover FILE` makes a complete file"
    ):
        next(messages)


def test_an_empty_file_is_a_cut_recording(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.touch()
    with pytest.raises(RecordingTruncated, match="after 0 valid messages"):
        list(read(path))


def test_an_overview_reads_the_file_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, records, given = tmp_path / "run.mcap", TolerantReader.__iter__, 0

    def counted(salvage: TolerantReader) -> Iterator[Any]:
        nonlocal given
        for each in records(salvage):
            given += 1
            yield each

    whole = record(path, RUNS["ok"])
    total = sum(1 for _ in TolerantReader(path))
    monkeypatch.setattr(TolerantReader, "__iter__", counted)
    found = overview(path)
    assert (found.messages, found.complete, found.files) == (whole.messages, True, ("task.yaml",))
    assert given < total + 10  # the head is read before


OF_A_SERVER = [replace(each, seed=0) if isinstance(each, Goal) else each for each in RUNS["ok"]]


@pytest.mark.parametrize("run", [*RUNS.values(), OF_A_SERVER], ids=[*RUNS, "of a server"])
def test_a_list_shows_what_an_overview_finds(tmp_path: Path, run: list[Record]) -> None:
    path = tmp_path / "run.mcap"
    record(path, run)
    found, whole = listing(path), overview(path)
    assert type(found) is Listing
    assert found == Listing(*(getattr(whole, each.name) for each in fields(Listing)))


def test_a_list_decodes_no_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, decoded = tmp_path / "run.mcap", []
    record(path, RUNS["ok"])
    original = IndexedRecording.record

    def noted(self: IndexedRecording, messages: Sequence[Message]) -> Any:
        decoded.append(messages[0].topic)
        return original(self, messages)

    monkeypatch.setattr(Recording, "record", noted)
    assert listing(path).frames
    assert decoded == ["/goal", "/result"]


@pytest.mark.parametrize("part", ["chunk", "summary", "end"])
def test_a_list_reads_all_of_a_damaged_recording(tmp_path: Path, part: str) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    data = bytearray(path.read_bytes())
    if part == "end":
        del data[-20:]
    else:
        at = -60 if part == "summary" else IndexedRecording(path).chunks[0].offset + 100
        data[at] ^= 1
    path.write_bytes(data)
    assert listing(path) == overview(path)
    assert not listing(path).complete


def test_a_summary_whose_channel_lost_its_schema_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, RUNS["ok"])
    data = bytearray(path.read_bytes())
    topic = data.rindex(b"/serial/tx")
    data[topic - 6 : topic - 4] = b"\0\0"  # the number of its schema, before the topic's length
    path.write_bytes(data)
    with pytest.raises(RecordingTruncated):
        list(read(path))
