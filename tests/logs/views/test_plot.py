"""The figure of a run shows the right content."""

import dataclasses
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from logs import Measured, NodeStatus, Plan, RecordingError, Sent, plot
from logs.views.comparison import compare
from logs.views.comparison_figure import draw_comparison
from logs.views.timeline import Timeline, timeline
from tests.logs.test_run import ARM, GRIPPER, RUNS, frame, node, plan, record

pytestmark = pytest.mark.slow

RUNNING, SUCCESS = (0x56, 0xB4, 0xE9), (0x00, 0x9E, 0x73)
FAILURE, INVALID = (0xD5, 0x5E, 0x00), (0x99, 0x99, 0x99)


def drawn(tmp_path: Path, records: list[Any], keep: int | None = None) -> tuple[Timeline, Any]:
    """The timeline that was drawn, and the image as (H, W, 3) bytes."""
    recording, output = tmp_path / "run.mcap", tmp_path / "run.png"
    record(recording, records)
    if keep is not None:
        recording.write_bytes(recording.read_bytes()[:keep])
    plot(recording, output)
    picture = matplotlib.image.imread(output)
    return timeline(recording), np.round(picture[:, :, :3] * 255).astype(np.uint8)


def share(picture: Any, colour: tuple[int, int, int]) -> float:
    """Share of an image that has a colour."""
    return float((picture == np.array(colour, np.uint8)).all(axis=2).mean())


def test_what_was_measured_is_drawn_beside_what_was_commanded(tmp_path: Path) -> None:
    records = RUNS["ok"]
    late = [
        Measured(each.time + 0.05, each.joints, tuple(q + 0.1 for q in each.positions), *[()] * 6)
        for each in records
        if isinstance(each, Sent) and each.joints
    ]
    run, _ = drawn(tmp_path, sorted([*records, *late], key=lambda each: each.time))
    trace = run.traces[0]
    assert len(trace.measured) == len(run.frames)
    assert trace.errors == pytest.approx([0.1] * len(run.frames))
    assert trace.measured_times[0] == pytest.approx(run.frames[0] + 0.05)


def test_a_run_that_ended_well(tmp_path: Path) -> None:
    run, picture = drawn(tmp_path, RUNS["ok"])
    assert picture.shape[1] == 2148  # 7.16 in at 300 dpi: two columns
    assert picture.std() > 20
    assert share(picture, RUNNING) > share(picture, SUCCESS) > 0.002
    assert share(picture, FAILURE) < 0.00008  # only the legend
    assert [trace.joint for trace in run.traces] == [f"joint_{i}" for i in range(1, 6)]
    assert [trace.group for trace in run.traces] == ["arm"] * 3 + ["gripper"] * 2
    assert (len(run.frames), run.holds) == (33, ())
    ((time, what),) = run.marks
    assert time == pytest.approx(0.72)
    assert what == "plan ready"
    assert [(row.name, row.depth) for row in run.rows] == [
        ("Reach", 0), ("SetStart", 1), ("CheckBounds", 1), ("Plan both", 1), ("PlanArm", 2),
        ("PlanGripper", 2), ("Execute", 1), ("Succeed", 1),
    ]  # fmt: skip
    states = [span.state for span in run.lifecycle]
    assert states == ["unconfigured", "configuring", "inactive", "activating", "active"]


def back(time: float) -> list[Any]:
    """A second motion, of the arm only: from the end of task 1 back to zero."""
    there = plan(time, "arm", ARM, (-1.4, -0.6, -0.07))
    home = dataclasses.replace(there, positions=there.positions[::-1])
    both = [(*arm, -0.7, 0.7) for arm in home.positions]
    dues = [time + 0.1 + due for due in home.times]
    rows = zip(dues, both, strict=True)
    return [home, *(Sent(due, frame(row), due, False, ARM + GRIPPER, row) for due, row in rows)]


def test_curves_follow_one_motion_after_the_other(tmp_path: Path) -> None:
    run, _ = drawn(tmp_path, [*RUNS["ok"][:-2], *back(50.0), *RUNS["ok"][-2:]])
    curve = next(trace for trace in run.traces if trace.joint == "joint_1")
    assert curve.times == tuple(sorted(curve.times))
    assert max(abs(np.diff(curve.positions))) < 0.1  # no jump
    assert curve.positions[0] == pytest.approx(0.0)
    assert min(curve.positions) == pytest.approx(-1.4)
    assert curve.positions[-1] == pytest.approx(0.0)
    assert {trace.group for trace in run.traces} == {"arm", "gripper"}
    assert [(round(time, 2), what) for time, what in run.marks] == [
        (0.72, "plan ready"), (10.0, "plan ready"),
    ]  # fmt: skip


def test_the_marks_of_many_motions_do_not_cover_the_title(tmp_path: Path) -> None:
    more = [item for number in range(9) for item in back(48.0 + 4 * number)]
    run, picture = drawn(tmp_path, [*RUNS["ok"][:-2], *more, *RUNS["ok"][-2:]])
    assert len(run.marks) == 10
    assert (picture[:130, 700:1500] == 255).all()  # between the task and the outcome


def test_a_plan_that_fails_after_a_motion_is_marked_beside_it(tmp_path: Path) -> None:
    none = dataclasses.replace(back(50.0)[0], code="plan.none", times=(), positions=())
    run, _ = drawn(tmp_path, [*RUNS["ok"][:-2], none, *RUNS["ok"][-2:]])
    assert [what for _, what in run.marks] == ["plan ready", "no plan"]


def test_a_canceled_run(tmp_path: Path) -> None:
    run, picture = drawn(tmp_path, RUNS["canceled"])
    assert (len(run.frames), len(run.holds)) == (15, 1)
    assert [what for _, what in run.marks] == ["plan ready", "cancel"]
    assert share(picture, INVALID) > 0.0005
    assert share(picture, FAILURE) > 0.00012  # the legend and the hold


def test_a_fault_is_marked(tmp_path: Path) -> None:
    run, _ = drawn(tmp_path, RUNS["faulted"])
    (_, ready), (time, what) = run.marks
    assert (ready, what) == ("plan ready", "fault")
    assert time == pytest.approx(run.frames[-1] + 0.0501, abs=1e-6)
    assert run.lifecycle[-2].state == "errorprocessing"


def test_a_refused_run_has_no_frames(tmp_path: Path) -> None:
    run, picture = drawn(tmp_path, RUNS["refused"])
    assert run.traces == ()
    assert run.frames == ()
    assert run.marks == ()
    assert share(picture, FAILURE) > 0.003
    assert picture.std() > 15


def test_a_plan_that_failed_is_marked_so(tmp_path: Path) -> None:
    records = [
        dataclasses.replace(item, code="plan.none", times=(), positions=())
        if isinstance(item, Plan)
        else item
        for item in RUNS["canceled"]
        if not isinstance(item, Sent)
    ]
    run, _ = drawn(tmp_path, records)
    assert run.marks[0][1] == "no plan"
    assert run.traces == ()


def test_cancel_is_found_without_feedback(tmp_path: Path) -> None:
    records = [item for item in RUNS["canceled"] if getattr(item, "phase", "") != "canceling"]
    record(tmp_path / "run.mcap", records)
    _, (time, what) = timeline(tmp_path / "run.mcap").marks
    assert time == pytest.approx(2.2603, abs=1e-6)
    assert what == "cancel"


def test_many_nodes_in_one_millisecond(tmp_path: Path) -> None:
    burst = [node(40.64 + i * 1e-5, f"Step {i}", "SUCCESS", "$x^2") for i in range(20)]
    run, picture = drawn(tmp_path, [*RUNS["ok"][:7], *burst, *RUNS["ok"][7:]])
    assert len(run.rows) == 28
    assert picture.shape[0] > 2500


def test_a_text_of_a_recording_is_neither_a_formula_nor_printed(tmp_path: Path) -> None:
    """matplotlib fails at a wrong formula, and prints a control character in a warning."""
    words = "$x_{$ \x1b]0;owned\x07"
    renamed = [
        dataclasses.replace(each, joints=tuple(words + joint for joint in each.joints))
        if isinstance(each, Sent)
        else each
        for each in RUNS["ok"]
    ]
    run, _ = drawn(tmp_path, [*renamed, node(49.0, words, "FAILURE", words)])
    assert any(words in trace.joint for trace in run.traces)
    path = tmp_path / "run.mcap"
    draw_comparison(compare(path, path), tmp_path / "both.png")


@pytest.mark.parametrize("keep", [0, 100, 9_000])
def test_a_cut_recording_is_drawn_as_far_as_it_goes(tmp_path: Path, keep: int) -> None:
    run, picture = drawn(tmp_path, RUNS["ok"], keep)
    assert not run.complete
    assert picture.std() > 5


def test_frames_without_plan_or_goal(tmp_path: Path) -> None:
    frames = [item for item in RUNS["ok"] if isinstance(item, Sent)]
    run, _ = drawn(tmp_path, frames)
    assert {trace.group for trace in run.traces} == {"joints"}
    assert run.goal is None
    assert run.frames[0] == 0.0


def test_siblings_stay_with_their_parent(tmp_path: Path) -> None:
    changes = [
        NodeStatus(time, path, path[-1], "SUCCESS", "")
        for time, path in [(1, "a/b/c"), (2, "a/d"), (3, "a/b/e"), (4, "a/b"), (5, "a")]
    ]
    record(tmp_path / "run.mcap", list(changes))
    rows = timeline(tmp_path / "run.mcap").rows
    assert "".join(row.name for row in rows) == "abced"


def test_a_missing_file_cannot_be_plotted(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="No such file"):
        plot(tmp_path / "gone.mcap", tmp_path / "run.png")
    record(tmp_path / "run.mcap", list(RUNS["refused"]))
    with pytest.raises(OSError, match="No such file"):
        plot(tmp_path / "run.mcap", tmp_path / "missing" / "run.png")


def test_no_drawing_replaces_a_recording(tmp_path: Path) -> None:
    run = tmp_path / "run.mcap"
    record(run, list(RUNS["refused"]))
    before = run.read_bytes()
    with pytest.raises(RecordingError, match="is a recording; name another file"):
        plot(run, run)
    assert run.read_bytes() == before
