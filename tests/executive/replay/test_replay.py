"""Commands for recordings: verify, send again, watch, list, compare, recover."""

import json
import os
import re
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

import logs
from executive.api.outcome import Outcome
from executive.cli.terminal import keyboard
from executive.cli.terminal.player import Player
from executive.replay.verification import verify
from logs.reading.file_state import locked
from logs.records.cdr import decode, encode
from logs.views.comparison import compare
from logs.views.narrative import narrative, overview
from logs.views.table import export
from logs.views.timeline import timeline
from tests.conftest import RigMaker
from tests.end_to_end.test_command_line import events, robot as quick, sent_frames, start
from tests.support.command_line.typed import typed as finish
from tests.support.paths import ROOT
from tests.support.recordings.alterations import altered, lacking, replace, retold

pytestmark = pytest.mark.slow

__all__ = ["quick"]


def test_verify_holds_and_names_what_it_compared(tmp_path: Path, picked: Path) -> None:
    status, out, err = finish(tmp_path, "replay", str(picked.parent), "--verify")
    assert (status, err) == (0, "")
    assert "plan -> frames  holds    31 frames of 1 schedule" in out
    status, out, _ = finish(tmp_path, "replay", str(picked), "--verify", "--json")
    assert json.loads(out)["holds"] is True


def test_verify_of_another_file_exits_with_3(tmp_path: Path, picked: Path) -> None:
    (picked.parent / "z.mcap").write_text("no recording")
    status, out, _ = finish(tmp_path, "replay", str(picked.parent), "--verify")
    assert status == 3
    assert "is not an MCAP file" in out
    assert "1 of 2 recordings are verified" in out


def test_the_worst_of_many_is_the_exit_status(tmp_path: Path, picked: Path) -> None:
    whole = picked.read_bytes()
    folder = picked.parent
    (folder / "a.mcap").write_text("no recording")
    (folder / "b.mcap").write_bytes(whole[:-100])
    verify = ["replay", str(folder), "--verify", "--jobs", "1"]
    assert finish(tmp_path, *verify)[0] == 10
    other = altered(picked, replace("Message", b"b089,", b"b088,"))
    other.write_bytes(other.read_bytes()[:-100])  # a difference has the higher exit status
    other.rename(folder / "z.mcap")
    status, out, _ = finish(tmp_path, *verify)
    assert status == 12
    assert [line.split() for line in out.splitlines()[-4:]] == [
        ["1", "of", "4", "recordings", "are", "verified;", "the", "others:"],
        [str(folder / "a.mcap"), "log.unreadable"],
        [str(folder / "b.mcap"), "log.truncated"],
        [str(folder / "z.mcap"), "replay.differs"],
    ]


def test_reading_a_cut_file_is_reported(tmp_path: Path, picked: Path) -> None:
    picked.write_bytes(picked.read_bytes()[:-100])
    path, folder = str(picked), str(picked.parent)
    for command in (
        ["log", "show", path],
        ["log", "export", path, "-o", folder],
        ["log", "plot", path],
        ["log", "diff", path, path],
        ["replay", path, "--watch", "--speed", "1000"],
        ["replay", path, "--watch", "--at", "1"],
        ["show", path],
    ):
        status, out, err = finish(tmp_path, *command)
        assert (status, bool(out)) == (10, True)
        assert "cut off or damaged" in err
    status, out, err = finish(tmp_path, "log", "info", path)
    assert (status, err) == (10, "")
    assert "cut off or damaged; type: armtree log recover" in out
    with pytest.warns(UserWarning, match="cut off or damaged"):
        assert len(logs.table(picked, "/joint_states")["joint_1"]) == 31


def test_a_file_of_another_program_is_not_drawn(tmp_path: Path, picked: Path) -> None:
    path = tmp_path / "theirs.mcap"
    writer = Writer(str(path))
    writer.start("ros2", "rosbag2")
    writer.finish()  # type: ignore[no-untyped-call]
    status, out, err = finish(tmp_path, "log", "plot", str(path))
    assert (status, out) == (3, "")
    why = "was not recorded by armtree, or the beginning of the file is missing"
    assert err == f"Error: {path}: {why} [log.unreadable]\n"
    assert not path.with_suffix(".png").exists()
    bent = altered(picked, retold("/goal", lambda goal: goal.pop("seed")))
    status, _, err = finish(tmp_path, "log", "plot", str(bent))
    assert (status, "a message on /goal lacks seed" in err) == (3, True)
    status, out, err = finish(tmp_path, "log", "ls", str(path))
    assert (status, out) == (2, "")
    assert "is a file" in err


def test_a_full_disk_is_no_internal_error_and_a_figure_goes_to_a_pipe(
    tmp_path: Path, picked: Path
) -> None:
    full = "Error: /dev/full: the disk is full; delete files, then try again [file]\n"
    assert finish(tmp_path, "log", "plot", str(picked), "-o", "/dev/full") == (3, "", full)
    status, out, _ = finish(tmp_path, "log", "diff", str(picked), str(picked), "-o", "/dev/full")
    assert (status, "/dev/full" in out) == (3, False)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor() as pool:
        drawn = pool.submit(pipe.read_bytes)
        assert finish(tmp_path, "log", "plot", str(picked), "-o", str(pipe))[0] == 0
        assert drawn.result().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--verify", "--watch"],
        ["--on", "virtual", "--speed", "2"],
        ["--on", "virtual", "--speed", "0.009"],
        ["--watch", "--speed", "0"],
        ["--watch", "--speed", "nan"],
        ["--watch", "--at", "nan"],
        ["--watch", "--at", "-1"],
    ],
)
def test_wrong_usage_is_2(tmp_path: Path, picked: Path, arguments: list[str]) -> None:
    assert finish(tmp_path, "replay", str(picked), *arguments)[0] == 2


def test_watching_shows_what_the_run_showed(tmp_path: Path, picked: Path) -> None:
    status, out, err = finish(tmp_path, "replay", str(picked), "--watch", "--speed", "100")
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == "task 1 pick"
    assert "Execute      success  31 of 31 frames" in out
    assert "task 1 SUCCEEDED" in out
    status, out, _ = finish(tmp_path, "replay", str(picked), "--watch", "--at", "0", "--json")
    reported = [event["event"] for event in events(out)]
    assert reported[0] == "goal"  # and what happened in the same instant of simulated time
    assert set(reported) <= {"goal", "lifecycle", "log"}


class Seen:
    """A view that only keeps the records."""

    def __init__(self) -> None:
        self.reported: list[logs.Record] = []

    def put(self, item: logs.Record | Outcome) -> None:
        if not isinstance(item, Outcome):
            self.reported.append(item)


def test_every_recording_starts_with_the_state_of_the_arm(tmp_path: Path, rig: RigMaker) -> None:
    first, second = (Path(outcome.recording) for outcome in rig().run(0, 1))
    for path, state in (first, "unconfigured"), (second, "active"):
        seen = Seen()
        Player(logs.Recording(path), seen, 1.0).show_until(1e-6)  # type: ignore[arg-type]
        reported = [record for record in seen.reported if isinstance(record, logs.Transition)]
        assert (reported[0].label, reported[0].goal) == ("", state)
        lines = narrative(path, everything=False)
        at = next(at for at, words in lines if words == f"arm: {state}")
        assert at == pytest.approx(0.0, abs=1e-6)
        assert timeline(path).lifecycle[0].state == state
    assert [span.state for span in timeline(second).lifecycle][-1] == "finalized"
    assert verify(second).holds


def test_moving_back_starts_from_the_beginning(picked: Path) -> None:
    seen = Seen()
    player = Player(logs.Recording(picked), seen, 1.0)  # type: ignore[arg-type]
    player.show_until(3.0)
    first = list(seen.reported)
    seen.reported.clear()
    player.show_until(1.0)
    assert 0 < len(seen.reported) < len(first)
    player.show_until(3.0)
    assert seen.reported == first
    player.show_until(1e9)
    assert player.over
    assert isinstance(seen.reported[-1], logs.Transition | logs.Result | logs.LogLine)


def test_recordings_are_listed_shown_and_exported(tmp_path: Path, picked: Path) -> None:
    folder = str(picked.parent)
    assert "1 pick" in finish(tmp_path, "log", "ls", folder)[1]
    assert "task 1 pick, seed 1" in finish(tmp_path, "log", "info", str(picked))[1]
    reported = finish(tmp_path, "log", "info", str(picked))[1]
    assert (
        "configured  port board, seed 1, planning_timeout_s 5.0, policy reject, solo True"
        in reported
    )
    story = finish(tmp_path, "log", "show", str(picked))[1].splitlines()
    assert story[0].split() == ["+0.000", "goal:", "task", "1", "pick,", "seed", "1"]
    _, out, _ = finish(tmp_path, "log", "export", str(picked), "-o", folder)
    joints, frames = (Path(line).read_text().splitlines() for line in out.splitlines())
    assert joints[0] == "time_s,joint_1_rad,joint_2_rad,joint_3_rad,joint_4_rad"
    assert frames[-1].endswith('no,"b009,s125,e085,g000,"')
    assert len(joints) == len(frames) == 32


def test_a_table_takes_three_lines(picked: Path) -> None:
    joints = logs.table(picked, "/joint_states")
    assert list(joints) == ["time_ns", "joint_1", "joint_2", "joint_3", "joint_4"]
    assert joints["joint_1"][-1] == pytest.approx(-1.4, abs=0.01)
    assert (joints["time_ns"][1:] > joints["time_ns"][:-1]).all()


def test_a_path_as_it_is_typed_into_a_notebook(picked: Path) -> None:
    typed = str(picked)
    assert list(logs.table(typed, "/joint_states")) == list(logs.table(picked, "/joint_states"))
    assert len(list(logs.read(typed, ["/serial/tx"]))) == 31
    assert len(list(logs.Recording(typed).records(logs.Sent))) == 31


def test_runs_are_compared_while_both_moved(picked: Path) -> None:
    short = lacking(picked, "/serial", "/joint_states", after=3 * 10)
    both = compare(picked, short)
    assert both.first.startswith("frame 11: ")
    assert both.joints["joint_1"] == (0.0, 0.0)


def test_a_run_without_frames_is_a_table_with_a_head(tmp_path: Path, rig: RigMaker) -> None:
    tasks = tmp_path / "tasks"
    tasks.mkdir()
    (tasks / "4_end.yaml").write_text(
        "task: 4\nname: end\ndescription: End.\ntree: {Succeed: {}}\n"
    )
    (outcome,) = rig(tasks).run(4)
    joints, frames = export(Path(outcome.recording), tmp_path)
    assert joints.read_text().split() == ["time_s"]
    assert frames.read_text().startswith("time_s,")


def test_every_topic_is_a_table() -> None:
    path = ROOT / "trees" / "examples" / "recordings" / "7_measure.mcap"
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary
    assert summary.statistics
    for number, count in summary.statistics.channel_message_counts.items():
        columns = logs.table(path, summary.channels[number].topic)
        assert len(columns["time_ns"]) == count
    assert list(logs.table(path, "/rosout"))[-3:] == ["file", "function", "line"]
    assert logs.table(path, "/lifecycle")["goal_state.label"][-1] == "finalized"
    assert logs.table(path, "/robot_description")["data"][0].startswith("<?xml")
    assert logs.table(path, "/diagnostics") == {}  # no frame was late
    with pytest.raises(logs.RecordingError, match=r"no topic /joint_state; .* /joint_states"):
        logs.table(path, "/joint_state")


def test_the_narrative_has_late_frames_and_no_node_that_never_ran(picked: Path) -> None:
    reported = [words for _, words in narrative(picked, everything=False)]
    assert not [words for words in reported if "INVALID" in words or "late" in words]

    def change(record: Any) -> None:
        if type(record).__name__ == "Message" and b'"scheduled"' in record.data:
            text = decode("std_msgs/msg/String", record.data)
            timing = json.loads(text.data)
            if timing["scheduled"]:
                text.data = json.dumps({**timing, "scheduled": timing["time"] - 0.025})
            record.data = encode("std_msgs/msg/String", text)

    path = altered(picked, change)
    reported = [words for _, words in narrative(path, everything=False)]
    assert "frame 31 was sent 25.0 ms late" in reported
    assert overview(path).late == {25.0: 31}


def test_a_recording_that_is_being_written_is_not_called_damaged(
    tmp_path: Path, picked: Path
) -> None:
    path = tmp_path / ("live" * 12 + ".mcap")
    shutil.copy(picked, path)
    path.write_bytes(path.read_bytes()[:-100])
    with locked(path):
        assert "being written" in finish(tmp_path, "log", "info", str(path))[1]
        assert "being written" in finish(tmp_path, "log", "ls", str(tmp_path))[1]
        assert "being written" in finish(tmp_path, "log", "show", str(path))[2]
        status, out, _ = finish(tmp_path, "replay", str(tmp_path), str(picked), "--verify")
        assert status == 0
        assert out.splitlines()[-1] == "1 of 1 recordings are verified, 1 still being written"
        assert "is being written by another armtree" in out
        assert "recover" not in out
        status, out, _ = finish(tmp_path, "replay", str(path), "--verify")
        assert (status, "holds" in out) == (10, False)
    assert "cut off or damaged" in finish(tmp_path, "log", "info", str(path))[1]
    assert "UNFINISHED" in finish(tmp_path, "log", "ls", str(tmp_path))[1]


def test_a_killed_run_is_recovered_by_the_next_run_and_by_command(
    tmp_path: Path, quick: Path
) -> None:
    with start(tmp_path, "run", "1", "--robot", str(quick), "--json") as process:
        assert process.stdout
        heard = 0
        for line in process.stdout:
            heard += json.loads(line)["event"] == "sent"
            if heard == 3:
                process.kill()
    (left,) = tmp_path.glob("*-1.mcap")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    copy = Path(shutil.copy(left, elsewhere))
    for mend, status in (
        (["run", "0", "--robot", str(quick)], 0),
        (["log", "recover", str(copy)], 10),
    ):
        done, out, _ = finish(tmp_path, *mend)
        assert done == status
        assert re.search(r"recovered \d+ messages; \d+ bytes after them .* (miss|kept)", out)
    (after,) = tmp_path.glob("*-0.mcap")
    assert f"{left}: recovered " in finish(tmp_path, "log", "show", str(after))[1]
    for mended in (left, copy):
        assert len(sent_frames(mended)) >= 2  # at most the frame in flight is lost
    assert finish(tmp_path, "replay", str(left), str(copy), "--verify", "--jobs", "1")[0] == 10


def test_pinned_recordings_outlive_the_rule(
    tmp_path: Path, picked: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = str(picked.parent)
    os.utime(picked, (0, 0))
    assert finish(tmp_path, "log", "pin", str(picked))[0] == 0
    assert "pinned" in finish(tmp_path, "log", "ls", folder)[1]
    assert finish(tmp_path, "log", "prune", folder, "--days", "1")[1] == ""
    assert finish(tmp_path, "log", "pin", "--off", str(picked))[0] == 0
    monkeypatch.setenv("ARMTREE_KEEP_DAYS", "1")
    assert "would be deleted" in finish(tmp_path, "log", "prune", folder, "--dry-run")[1]
    monkeypatch.delenv("ARMTREE_KEEP_DAYS")
    assert "deleted" in finish(tmp_path, "log", "prune", folder, "--days", "1")[1]
    assert not picked.exists()
    assert "set keep_days or keep_mb" in finish(tmp_path, "log", "prune", folder)[2]
    nowhere = ["log", "prune", str(tmp_path / "recodings"), "--days", "1"]
    assert "there are no recordings in this folder" in finish(tmp_path, *nowhere)[2]


@pytest.mark.parametrize("value", ["-1", "nan", "inf"])
def test_an_invalid_rule_deletes_nothing(tmp_path: Path, picked: Path, value: str) -> None:
    os.utime(picked, (0, 0))
    folder = str(picked.parent)
    for option in ("--days", "--mb"):
        assert finish(tmp_path, "log", "prune", folder, option, value)[0] == 2
        status = finish(tmp_path, "run", "0", "--recordings", folder, f"--keep-{option[2:]}", value)
        assert status[0] == 2
    assert picked.exists()


def test_keys_that_come_at_once_all_count() -> None:
    reader, writer = os.pipe()
    os.write(writer, b"\x1b[D\x1b[D\x1bOC q")
    assert keyboard.pressed_keys(reader, 0.0) == ["\x1b[D", "\x1b[D", "\x1b[C", " ", "q"]
    assert keyboard.pressed_keys(reader, 0.0) == []
    os.close(reader)
    os.close(writer)


def test_a_path_that_is_not_there_is_no_bug(tmp_path: Path, picked: Path) -> None:
    gone, file = tmp_path / "gone", tmp_path / "file"
    file.touch()
    for command, words in (
        (["export", str(picked), "-o", str(file / "x")], f"{file}/x: Not a directory"),
        (["pin", str(gone)], f"{tmp_path}: no recording is here"),
    ):
        status, _, err = finish(tmp_path, "log", *command)
        assert status == 3
        assert words in err
