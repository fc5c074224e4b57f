"""Recordings in windows: nothing is missing or twice, and the state before each is right."""

import shutil
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice, pairwise
from json import dumps
from pathlib import Path
from struct import pack
from typing import Any

import pytest

import logs
from executive.api.events import EVENTS, event_to_json, kind_of
from executive.server.playback.node_state import NodeState
from executive.server.playback.seek import Timeline
from executive.testing import SimulatedArm
from logs.reading.indexed import IndexedRecording
from tests.support.recordings.alterations import lacking
from tests.support.recordings.large_messages import LARGE
from tests.support.recordings.long_recording import write_long

Window = dict[str, Any]

MESSAGES = 8_000
SHOWN = frozenset(EVENTS.values()) - {"question", "received"}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording of a short run."""
    path = tmp_path_factory.mktemp("recordings") / "run.mcap"
    with SimulatedArm() as arm:
        shutil.copyfile(arm.run("home").recording, path)
    return path


@pytest.fixture(scope="module")
def long(run: Path) -> Path:
    path = run.with_name("20261101T000000.000Z-1.mcap")
    write_long(run, path, MESSAGES)
    return path


@pytest.fixture(scope="module")
def timeline(long: Path) -> Timeline:
    return Timeline(long)


@pytest.fixture(scope="module")
def found(timeline: Timeline) -> list[Window]:
    return list(windows(timeline))


def windows(of: Timeline) -> Iterator[Window]:
    at = 0.0
    while at < of.duration:
        yield (window := window_at(of, at))
        at = window["to_s"]


def window_at(of: Timeline, at: float) -> Window:
    window = of.events(at)
    return {**window, "state": list(window["state"]), "events": list(window["events"])}


@pytest.mark.slow
def test_the_windows_of_a_long_recording_have_every_event_once(
    long: Path, timeline: Timeline, found: list[Window]
) -> None:
    assert len(found) > 3
    middle = found[2]
    assert window_at(timeline, (middle["from_s"] + middle["to_s"]) / 2) == middle
    records = (each for each in logs.Recording(long).records() if kind_of(each) in SHOWN)
    wanted = list(map(event_to_json, records))
    events = [each for window in found for each in window["events"]]
    assert events[-1]["result"]["state"] == "SUCCEEDED"
    assert [each for each in events if each["event"] != "status"] == wanted
    assert max(len(window["events"]) for window in found) < 1500


def test_the_state_before_a_window_is_what_the_events_before_it_amount_to(
    found: list[Window],
) -> None:
    nodes: dict[str, tuple[NodeState, dict[str, Any]]] = {}
    last: dict[str, Any] = {}
    for window in found:
        state = window["state"]
        by_path = {each["path"]: each for each in state if each["event"] == "node"}
        assert by_path == {
            path: event
            | {"status": node.status, "began_s": node.began, "ended_s": node.ended}
            | {"starts": node.starts}
            for path, (node, event) in nodes.items()
        }
        plain = [
            each for each in state if each["event"] in ("plan", "schedule", "feedback", "goal")
        ]
        for each in plain:
            assert each == last[each["event"] + str(each.get("group"))]
        sent = [each for each in state if each["event"] == "sent"]
        assert sent == ([last["sentNone"]] if nodes else [])
        for each in window["events"]:
            last[each["event"] + str(each.get("group"))] = each
            if each["event"] == "node":
                before, _ = nodes.get(each["path"], (NodeState(), {}))
                nodes[each["path"]] = before.after(each["status"], each["time_s"]), each
    assert any(node.starts > 5 for node, _ in nodes.values())


def test_steps_lead_from_window_to_window(timeline: Timeline, found: list[Window]) -> None:
    steps = timeline.steps
    for window, after in pairwise(found):
        assert window["next_s"] == next(each for each in steps if each > window["to_s"])
        before = [each for each in steps if each < after["from_s"] - 1e-6]
        assert after["previous_s"] == before[-1]
    assert found[0]["previous_s"] is None
    assert found[-1]["next_s"] is None


def test_samples_cover_the_whole_recording(run: Path, timeline: Timeline) -> None:
    few = timeline.series(50)["commanded"]
    (times, positions) = few["times_s"], few["positions"]
    assert 20 < len(times) <= 50
    assert times == sorted(times)
    assert {len(column) for column in positions.values()} == {len(times)}
    frames = list(logs.Recording(run).frames())
    *_, motion = logs.Recording(run).records(logs.Schedule)
    assert isinstance(motion, logs.Schedule)
    end = motion.samples[-1]
    assert tuple(column[-1] for column in positions.values()) == end != frames[-1].positions
    values = {q for frame in frames for q in frame.positions} | {*end}
    assert all(q in values for column in positions.values() for q in column)
    assert Timeline(run).series(50)["measured"]["times_s"] == []
    whole = timeline.series(50)
    assert len(whole["lateness"]["late_s"]) > 20
    assert set(whole["velocity_limits"]) >= set(positions)
    phases = [each["phase"] for each in whole["events"] if each["event"] == "feedback"]
    assert {"planning", "executing"} <= set(phases)


@pytest.mark.slow
@pytest.mark.parametrize("name", LARGE)
def test_an_answer_is_small_or_an_error(tmp_path: Path, name: str) -> None:
    path = tmp_path / "large.mcap"
    path.write_bytes(LARGE[name]())
    with suppress(logs.RecordingError):
        timeline = Timeline(path)
        for answer in (*islice(windows(timeline), 2), timeline.series(2000)):
            assert len(dumps(answer)) < 16e6


def test_a_message_counts_once(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = IndexedRecording(run)
    (chunk, *_) = recording.with_topic(("/tree",))
    opened = recording.open(chunk)
    assert len(opened.messages(("/tree",))) > 1
    entries = opened.entries("/tree")
    monkeypatch.setattr(opened, "entries", lambda _: entries * 1000)
    with pytest.raises(logs.RecordingError, match="an index in which messages overlap"):
        opened.messages(("/tree",))


def test_what_cannot_be_read_by_its_index_says_so(run: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(run.read_bytes()[:-100])
    with pytest.raises(logs.RecordingError, match="has no index; type armtree log recover FILE"):
        Timeline(cut)
    damaged = tmp_path / "damaged.mcap"
    data = bytearray(run.read_bytes())
    data[len(data) // 2] ^= 0xFF
    damaged.write_bytes(data)
    with pytest.raises(logs.RecordingError):
        list(windows(Timeline(damaged)))
    # A hole in place of the summary, or a record that ends after it.
    whole = run.read_bytes()
    for name, record in {"hole": bytes(9), "long": pack("<BQ", 0x0B, 1 << 30)}.items():
        holey, begin = tmp_path / f"{name}.mcap", len(whole)
        with holey.open("wb") as stream:
            stream.write(whole + record)
            stream.seek(1 << 40)
            stream.write(pack("<BQQQI", 0x02, 20, begin, 0, 0) + whole[-8:])
        with pytest.raises(logs.RecordingError, match="has no index; type armtree log recover"):
            Timeline(holey)
    shutil.copyfile(run, silent := tmp_path / "silent.mcap")
    assert Timeline(lacking(silent, "/goal", "/tree")).goal is None
    assert Timeline(silent).to_json()["ended"]
    shutil.copyfile(run, killed := tmp_path / "killed.mcap")
    *_, end = Timeline(lacking(killed, "/result")).events(1e9)["events"]
    assert end["result"]["frames"] == len(list(logs.Recording(run).frames())) > 0
